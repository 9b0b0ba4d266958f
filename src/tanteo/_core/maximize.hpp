// The iterative maximization of a smooth function on a manifold: Levenberg (1944) and Marquardt (1963), as in Madsen,
// Nielsen and Tingleff, "Methods for non-linear least squares problems" (2004), section 3.2.
//
// With the gradient g and the Gauss-Newton information H at the state x, a weak prior W (diagonal) for directions that
// no measurement constrains, and the damping d:
//
//     (H + d diag(H) + W) step = g,     x' = retract(x, step)
//
// The prior W only limits steps: it is not part of the function, so it does not move the maximum. A step that does not
// raise the function is rejected and the damping grows.
//
// A Problem provides
//     State, Linear                    Linear has the member `information` (K x K row-major, lower triangle)
//     linearize(State, Linear&)        value, gradient and information at a state
//     slope(Linear, double* g)         gradient of what is maximized
//     prior(i, diagonal, damping)      W_ii; `diagonal` is H_ii
//     retract(State, double* step)     the next state; it also limits the length of the step
//     gain(State, Linear, State, Linear)      increase from the first state to the second
//     accepts(Linear, gain, predicted)        whether the step is taken
//     converged(gain, predicted)              whether an accepted step is the last one
//     accepted(State, Linear)                 called when a step was taken
#pragma once
#include <algorithm>
#include <utility>
#include <vector>

#include "vec.hpp"

namespace tanteo {

struct Damping {
    double start, fewer, least;   // first damping, factor after an accepted step, and the smallest damping
    double more, first, most;     // factor after a rejected step, the smallest damping then, and the largest damping
};

// Runs at most so many steps from a linearized state. Returns whether they converged, or no step raises the function even
// at the largest damping. Steps that are predicted to gain less than `enough` are not taken.
template <class Problem>
bool maximize(Problem& problem, typename Problem::State& state, typename Problem::Linear& at, const Damping& rule,
              int steps, double enough) {
    typename Problem::Linear there;
    std::vector<double> L, slope, step;
    double damping = rule.start;
    for (int k = 0; k < steps; ++k) {
        const int K = static_cast<int>(at.gradient.size());
        slope.resize(K);
        problem.slope(at, slope.data());
        L = at.information;
        for (int i = 0; i < K; ++i) {
            const double diagonal = L[i * K + i];
            L[i * K + i] += damping * diagonal + problem.prior(i, diagonal, damping);
        }
        bool taken = false, last = false;
        if (cholesky(L.data(), K)) {
            step = slope;
            solve_cholesky(L.data(), K, step.data());
            double predicted = 0;  // twice the gain of a quadratic function
            for (int i = 0; i < K; ++i) predicted += step[i] * slope[i];
            if (predicted < enough) return true;
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
