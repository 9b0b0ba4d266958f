// Conversion of normal densities of the pose from arrays of Python.
#pragma once
#include <algorithm>
#include <vector>

#include "bindings/conversion.hpp"
#include "solve/problem.hpp"

namespace tanteo {

inline std::vector<PosePrior> pose_priors(const Doubles& means, const Doubles& roots, const Doubles& log_weights) {
    const std::vector<Pose> at = poses(means, "prior_means");
    expect(roots, "prior_roots", {at.size(), 6, 6});
    expect(log_weights, "prior_log_weights", {at.size()});
    std::vector<PosePrior> out(at.size());
    for (size_t k = 0; k < at.size(); ++k) {
        out[k].mean = at[k];
        std::copy_n(roots.data() + 36 * k, 36, out[k].root);
        out[k].log_weight = log_weights.data()[k];
    }
    return out;
}

}  // namespace tanteo
