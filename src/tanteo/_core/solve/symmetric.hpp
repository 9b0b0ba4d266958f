// Eigenvalues of small symmetric matrices.
#pragma once
#include <vector>

namespace tanteo {

struct Eigen {
    std::vector<double> values;   // ascending
    std::vector<double> vectors;  // (n, n) row-major, in columns
};

// Of a symmetric matrix (n, n), by Jacobi's turns; of one that is not finite, in no order.
Eigen eigen(std::vector<double> A, int n);

}  // namespace tanteo
