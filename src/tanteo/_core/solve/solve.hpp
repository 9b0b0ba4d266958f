// Refinement of poses: robust ICP steps to the nearest surface, then Levenberg-Marquardt on the log density.
#pragma once
#include <vector>

#include "solve/likelihood.hpp"

namespace tanteo {

struct RefinedPose {
    Pose pose;
    double cost = 0;    // robust cost at the last scale: 4 for a distant point
    int from = 0;       // index of its start
    double offset = 0;  // common offset of all points along their approach [m]; 0 without a prior for it
};

// Robust ICP of the points in rows to the nearest surface, at scales from coarse to fine [m]. Poses of much higher cost
// than the best, or than a known one of another part, are dropped. With offset_sd > 0 [m], the prior of it, all points have a common offset along their approach,
// or along the surface's normal if no approach is known.
std::vector<RefinedPose> refine_poses(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                                      const std::vector<double>& scales, const std::vector<Pose>& starts,
                                      double offset_sd = 0, double known = 1e300);

// Signed distances of points from the nearest element at a refined pose, with the offset [m]; infinite if the part has no
// such element, or if it is approached from the inner side.
std::vector<double> distances_at(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                                 const RefinedPose& at);

// The log density at a state, its gradient and information over some of the states.
struct Linear {
    double value = 0, of_pose_prior = 0;  // of_pose_prior: the part of the value that the pose priors are
    double scale_slope = 0;               // what the integral over other states adds to the last gradient
    std::vector<double> gradient, information;
};

// A maximum of the log density, with the linearization there.
struct Maximum {
    State state;
    Linear at;
    double blur = -1;  // of the noise in this linearization [m]; -1: there is none yet
    int from = 0;      // index of its start
    std::vector<int> also = {};  // indices of other starts that led near it and were dropped
};

// Levenberg-Marquardt steps with blurred noise [m], until a step gains less than `enough`.
void ascend(Likelihood& likelihood, const Shape& shape, const Problem& problem, double blur, int steps, double enough,
            Maximum& maximum);

// Maximizations from all starts, with blurred noise first. After each level, and after a few steps of the last one, maxima
// below the best by more than a margin are dropped, and those nearer to a better one than `near`, a squared distance in
// standard deviations of its information. Before the first step the measurements alone are compared: a tight prior, which is
// not blurred, contradicts every start that was made without it, and the first step goes to the prior.
std::vector<Maximum> maximize_all(const Shape& shape, const Problem& problem, const std::vector<State>& starts,
                             const std::vector<double>& blurs, int steps, double enough, double margin, double near = 0);

// Log of the integral over shared errors and noise scale at a pose, by Laplace's method about their best values, which
// replace those of the state.
double marginal(Likelihood& likelihood, const Problem& problem, State& state);

}  // namespace tanteo
