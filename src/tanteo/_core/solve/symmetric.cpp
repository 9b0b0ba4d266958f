#include "solve/symmetric.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tanteo {

namespace {

// One Jacobi rotation, which makes A(i, j) zero; V accumulates the rotations.
void turn(std::vector<double>& A, std::vector<double>& V, int n, int i, int j) {
    const double theta = 0.5 * (A[j * n + j] - A[i * n + i]) / A[i * n + j];
    const double t = (theta < 0 ? -1 : 1) / (std::fabs(theta) + std::sqrt(theta * theta + 1));
    const double c = 1 / std::sqrt(t * t + 1), s = t * c;
    for (int k = 0; k < n; ++k) {
        const double a = A[k * n + i], b = A[k * n + j];
        A[k * n + i] = c * a - s * b;
        A[k * n + j] = s * a + c * b;
    }
    for (int k = 0; k < n; ++k) {
        const double a = A[i * n + k], b = A[j * n + k];
        A[i * n + k] = c * a - s * b;
        A[j * n + k] = s * a + c * b;
        const double u = V[k * n + i], v = V[k * n + j];
        V[k * n + i] = c * u - s * v;
        V[k * n + j] = s * u + c * v;
    }
}

}  // namespace

Eigen eigen(std::vector<double> A, int n) {
    std::vector<double> V(static_cast<size_t>(n) * n, 0.0);
    for (int i = 0; i < n; ++i) V[i * n + i] = 1;
    for (int sweep = 0; sweep < 30; ++sweep) {
        bool done = true;
        for (int i = 0; i < n; ++i)
            for (int j = i + 1; j < n; ++j) {
                const double on = std::sqrt(std::fabs(A[i * n + i] * A[j * n + j]));
                if (!(std::fabs(A[i * n + j]) > 1e-17 * on) || A[i * n + j] == 0) continue;
                turn(A, V, n, i, j);
                done = false;
            }
        if (done) break;
    }
    std::vector<int> order(n);
    std::iota(order.begin(), order.end(), 0);
    const bool numbers = std::all_of(A.begin(), A.end(), [](double a) { return std::isfinite(a); });
    if (numbers) std::sort(order.begin(), order.end(), [&](int a, int b) { return A[a * n + a] < A[b * n + b]; });
    Eigen out{std::vector<double>(n), std::vector<double>(static_cast<size_t>(n) * n)};
    for (int k = 0; k < n; ++k) {
        out.values[k] = A[order[k] * n + order[k]];
        for (int i = 0; i < n; ++i) out.vectors[i * n + k] = V[i * n + order[k]];
    }
    return out;
}

}  // namespace tanteo
