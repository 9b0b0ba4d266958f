// The iterative fits of poses. One step and two loops around it:
//
//   maximize      a smooth function: Levenberg (1944) and Marquardt (1963), as in Madsen, Nielsen and Tingleff, "Methods
//                 for non-linear least squares problems" (2004), section 3.2
//   gauss_newton  a sequence of quadratic functions: the problem changes at every step as a kernel shrinks or features are
//                 matched anew, so the values before and after a step are not compared
//
// With the gradient g and the Gauss-Newton information H at the state x, a weak prior W (diagonal) for directions that
// no measurement constrains, and the damping d:
//
//     (H + d diag(H) + W) step = g,     x' = retract(x, step)
//
// In `maximize` the prior W only limits steps: it is not part of the function, so it does not move the maximum. A step that
// does not raise the function is rejected and the damping grows.
#pragma once
#include <algorithm>
#include <utility>

#include "matrix.hpp"

namespace tanteo {

// The information of a weak prior on state i: a shift with that standard deviation [m], a turn with that one [rad], and
// nothing about the other states. It limits steps along motions of the pose that no measurement constrains.
inline double weak_prior(int i, double shift, double turn) {
    if (i > 5) return 0;
    const double root = 1 / (i < 3 ? shift : turn);
    return root * root;
}

// The normal equations of residuals: H = sum w J' J (lower triangle), g = -sum w J' r, and cost = sum w r^2 / 2.
template <int K>
struct NormalEquations {
    Matrix<K, K> information;
    Matrix<K, 1> gradient;
    double cost = 0;

    void add(const double* J, double r, double weight) {
        cost += 0.5 * weight * r * r;
        for (int i = 0; i < K; ++i) {
            gradient[i] -= weight * J[i] * r;
            for (int k = 0; k <= i; ++k) information(i, k) += weight * J[i] * J[k];
        }
    }
    // The weak prior on a pose, and a fraction of the diagonal as damping.
    void add_weak_prior(double shift, double turn, double damping = 0) {
        for (int i = 0; i < K; ++i) information(i, i) += damping * information(i, i) + weak_prior(i, shift, turn);
    }
};

// Leaves the Cholesky factor of H in its place, and the step in place of g. False if H is not positive definite.
template <class Square, class Column>
bool newton_step(Square& H, Column& g) {
    const int K = static_cast<int>(g.size());
    if (!cholesky(H.data(), K)) return false;
    solve_cholesky(H.data(), K, g.data());
    return true;
}

// Runs at most so many Gauss-Newton steps. A Problem provides
//     State, linearize(State, k)       normal equations at step k, with their weak prior
//     take(State&, step, factor)       moves the state by a step; the Cholesky factor says how well it is known
template <class Problem>
void gauss_newton(Problem& problem, typename Problem::State& state, int steps) {
    for (int k = 0; k < steps; ++k) {
        auto at = problem.linearize(state, k);
        if (!newton_step(at.information, at.gradient)) return;
        problem.take(state, at.gradient, at.information);
    }
}

struct Damping {
    double start, fewer, least;   // first damping, factor after an accepted step, and the smallest damping
    double more, first, most;     // factor after a rejected step, the smallest damping then, and the largest damping
};

// Runs at most so many steps from a linearized state. Returns whether they ended before: they converged, or no step raises
// the function even at the largest damping. A Problem provides
//     State, Linear                    Linear has `information` (K x K row-major, lower triangle) and `gradient`
//     linearize(State, Linear&)        value, gradient and information at a state
//     slope(Linear, double* g)         gradient of what is maximized
//     damped(i, diagonal, damping)     what is added to H_ii, which is `diagonal`: damping and weak prior
//     ends(Linear, step, predicted)    whether to end before a step; it is predicted to gain half of `predicted`
//     retract(State, double* step)     the next state; it also limits the length of the step
//     gain(State, Linear, State, Linear)      increase from the first state to the second
//     accepts(Linear, gain, predicted)        whether the step is taken
//     converged(gain, predicted)              whether an accepted step is the last one
//     accepted(State, Linear)                 called when a step was taken
template <class Problem>
bool maximize(Problem& problem, typename Problem::State& state, typename Problem::Linear& at, const Damping& rule,
              int steps) {
    typename Problem::Linear there;
    auto L = at.information;
    auto slope = at.gradient, step = slope;
    double damping = rule.start;
    for (int k = 0; k < steps; ++k) {
        const int K = static_cast<int>(at.gradient.size());
        slope = at.gradient;
        problem.slope(at, slope.data());
        L = at.information;
        for (int i = 0; i < K; ++i) L[i * K + i] += problem.damped(i, L[i * K + i], damping);
        bool taken = false, last = false;
        step = slope;
        if (newton_step(L, step)) {
            double predicted = 0;  // twice the gain of a quadratic function
            for (int i = 0; i < K; ++i) predicted += step[i] * slope[i];
            if (problem.ends(at, step.data(), predicted)) return true;
            auto next = problem.retract(state, step.data());
            problem.linearize(next, there);
            const double gain = problem.gain(state, at, next, there);
            taken = problem.accepts(at, gain, predicted);
            if (taken) {
                last = problem.converged(gain, predicted);
                std::swap(state, next);
                std::swap(at, there);
                problem.accepted(state, at);
            }
        }
        if (last) return true;
        if (!taken && damping > rule.most) return true;
        damping = taken ? std::max(rule.fewer * damping, rule.least) : std::max(rule.more * damping, rule.first);
    }
    return false;
}

}  // namespace tanteo
