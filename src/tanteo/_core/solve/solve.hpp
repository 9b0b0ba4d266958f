// From poses to better poses: coarse steps to the nearest surface, then Levenberg-Marquardt on the log density itself.
#pragma once
#include <vector>

#include "solve/likelihood.hpp"

namespace tanteo {

struct Settled {
    Pose pose;
    double cost = 0;  // robust, at the last scale: 4 for a point that is far off
    int from = 0;     // which of the starts
    double offset = 0;  // of all points along their approach [m], where it has a prior
};

// Robust least squares from points to the nearest place of the surface, at scales from coarse to fine [m], of the
// points in rows. Poses that cost far more than the best are given up on the way. With offset_sd > 0 [m] all points have a
// common offset along their approach, or along the surface's normal where no approach is known, with that prior.
std::vector<Settled> settle(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                            const std::vector<double>& scales, const std::vector<Pose>& starts, double offset_sd = 0);

// Signed distances of points from the nearest element at a settled pose, less the offset [m]; infinite where the part has
// none, or where it is approached from behind.
std::vector<double> distances_at(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                                 const Settled& at);

// A maximum: where it is, and what is known there.
struct Maximum {
    State state;
    double log = 0;
    std::vector<double> information;
    int from = 0;  // which of the starts
};

// Levenberg-Marquardt steps with that much blur, until one gains less than enough.
void ascend(Likelihood& likelihood, const Shape& shape, const Problem& problem, double blur, int steps, double enough,
            Maximum& maximum);

// Maximizations from all starts to maxima, through blurred noise first. After each level, and a few steps into the last one,
// those that are behind the best by more than a margin are given up.
std::vector<Maximum> maximize_all(const Shape& shape, const Problem& problem, const std::vector<State>& starts,
                             const std::vector<double>& blurs, int steps, double enough, double margin);

// log of the integral over shared errors and noise scale at a pose, by Laplace's method about their best values,
// which replace those of the state.
double marginal(Likelihood& likelihood, const Problem& problem, State& state);

}  // namespace tanteo
