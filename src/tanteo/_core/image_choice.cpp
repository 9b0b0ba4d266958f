#include "image_choice.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "vec.hpp"

namespace tanteo {

double ChoiceWeigher::weigh(const bool* other, double* mean, double* covariance) {
    const size_t n = t.n;
    std::copy(t.information, t.information + n * n, A.begin());
    std::copy(t.gradient, t.gradient + n, b.begin());
    double log = 0;
    for (size_t edge = 0; edge < t.G; ++edge) {
        const size_t row = 2 * edge + other[edge];
        const double *more = t.edge_information + row * n * n, *pull = t.edge_gradients + row * n;
        for (size_t k = 0; k < n * n; ++k) A[k] += more[k];
        for (size_t k = 0; k < n; ++k) b[k] += pull[k];
        log += t.edge_logs[row];
    }
    // unknowns of different sizes: with ones on the diagonal
    for (size_t i = 0; i < n; ++i) scale[i] = std::sqrt(A[i * n + i]);
    for (size_t i = 0; i < n; ++i)
        for (size_t j = 0; j <= i; ++j) A[i * n + j] /= scale[i] * scale[j];
    if (!cholesky(A.data(), static_cast<int>(n))) return -std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < n; ++i) {
        log -= std::log(A[i * n + i] * scale[i]);
        double* row = covariance + i * n;
        std::fill(row, row + n, 0.0);
        row[i] = 1;
        solve_cholesky(A.data(), static_cast<int>(n), row);
        mean[i] = 0;
        for (size_t j = 0; j < n; ++j) {
            row[j] /= scale[i] * scale[j];
            mean[i] += row[j] * b[j];
        }
        log += 0.5 * b[i] * mean[i];
    }
    return log;
}

}  // namespace tanteo
