// The one iterative fit: Levenberg (1944) and Marquardt (1963), as in Madsen, Nielsen and Tingleff, "Methods for non-linear
// least squares problems" (2004), section 3.2.
//
// With the gradient g and the Gauss-Newton information H at the state x, a weak prior W (diagonal) for directions that
// no measurement constrains, and the damping d:
//
//     (H + d diag(H) + W) step = g,     x' = retract(x, step)
//
// A caller that compares values rejects a step that does not raise the function; the damping then grows, and W only limits
// steps. A caller whose function changes at every step, because a kernel shrinks or features are matched again, takes
// every step: this is the Gauss-Newton method.
#pragma once
#include <algorithm>
#include <array>

#include "vec.hpp"

namespace tanteo {

// Information of a weak prior on state i: shift [m] and turn [rad] are standard deviations of the pose; zero for states
// other than the pose.
inline double weak_prior(int i, double shift, double turn) {
    if (i > 5) return 0;
    const double root = 1 / (i < 3 ? shift : turn);
    return root * root;
}

// The normal equations of residuals: H = sum w J' J (lower triangle), g = -sum w J' r, and cost = sum w r^2 / 2.
template <int K>
struct NormalEquations {
    std::array<double, K * K> information{};
    std::array<double, K> gradient{};
    double cost = 0;

    void add(const double* J, double r, double weight) {
        cost += 0.5 * weight * r * r;
        for (int i = 0; i < K; ++i) {
            gradient[i] -= weight * J[i] * r;
            for (int k = 0; k <= i; ++k) information[K * i + k] += weight * J[i] * J[k];
        }
    }
    void add_weak_prior(double shift, double turn, double damping = 0) {
        for (int i = 0; i < K; ++i) {
            double& diagonal = information[(K + 1) * i];
            diagonal += damping * diagonal + weak_prior(i, shift, turn);
        }
    }
};

struct Damping {
    double start = 0, fewer = 1, least = 0;   // first damping, factor after an accepted step, and the smallest damping
    double more = 1, first = 0, most = -1;    // factor after a rejected step, the smallest damping then, and the largest
};

enum class Attempt { REJECTED, TAKEN, LAST };

// Runs at most `steps` steps from `at`, which has the information (row-major, lower triangle) and the gradient at the state.
// Returns whether it converged: `attempt` returned LAST, or even the largest damping gave no step.
//     damped(i, diagonal, damping)    returns the addition to H_ii, which is `diagonal`: damping and weak prior
//     attempt(step, predicted, L)     takes the step and recomputes `at`, or rejects it. A quadratic function would gain
//                                     half of `predicted`; L is the Cholesky factor.
template <class Linear, class Damped, class Try>
bool maximize(Linear& at, int steps, const Damping& rule, Damped&& damped, Try&& attempt) {
    auto L = at.information;
    auto step = at.gradient;
    double damping = rule.start;
    for (int k = 0; k < steps; ++k) {
        const int K = static_cast<int>(at.gradient.size());
        L = at.information;
        step = at.gradient;
        for (int i = 0; i < K; ++i) L[i * K + i] += damped(i, L[i * K + i], damping);
        Attempt result = Attempt::REJECTED;
        if (cholesky(L.data(), K)) {
            solve_cholesky(L.data(), K, step.data());
            double predicted = 0;
            for (int i = 0; i < K; ++i) predicted += step[i] * at.gradient[i];
            result = attempt(step.data(), predicted, L.data());
        }
        const bool taken = result == Attempt::TAKEN;
        if (result == Attempt::LAST || (!taken && damping > rule.most)) return true;
        damping = taken ? std::max(rule.fewer * damping, rule.least) : std::max(rule.more * damping, rule.first);
    }
    return false;
}

// Takes a number of Gauss-Newton steps: linearize(k) returns the normal equations of step k, with their weak prior, and
// take(step, L) moves the state.
template <class Linearize, class Take>
void gauss_newton(int steps, Linearize&& linearize, Take&& take) {
    if (steps < 1) return;
    auto at = linearize(0);
    int k = 0;
    const auto undamped = [](int, double, double) { return 0.0; };
    maximize(at, steps, {}, undamped, [&](double* step, double, const double* L) {
        take(step, L);
        if (++k < steps) at = linearize(k);
        return Attempt::TAKEN;
    });
}

}  // namespace tanteo
