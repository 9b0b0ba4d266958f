// Eigenvalues of small symmetric matrices.
#pragma once
#include <vector>

namespace tanteo {

struct Eigen {
    std::vector<double> values;   // ascending
    std::vector<double> vectors;  // (n, n) row-major, in columns
};

// Eigenvalues of a symmetric matrix (n, n) by Jacobi rotations; in no order if it is not finite.
Eigen eigen(std::vector<double> A, int n);

}  // namespace tanteo
