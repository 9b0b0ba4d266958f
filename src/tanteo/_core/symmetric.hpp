// Eigenvalues of small symmetric matrices, and systems of a few unknowns.
#pragma once
#include <vector>

namespace tanteo {

struct Eigen {
    std::vector<double> values;   // ascending
    std::vector<double> vectors;  // (n, n) row-major, in columns
};

// Of a symmetric matrix (n, n), by Jacobi's turns; of one that is not finite, in no order.
Eigen eigen(std::vector<double> A, int n);

// Solves A x = b for a symmetric positive definite A (n, n), in place of b; false if it is none.
bool solve_symmetric(std::vector<double> A, int n, double* b);

}  // namespace tanteo
