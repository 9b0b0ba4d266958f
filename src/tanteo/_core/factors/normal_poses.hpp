// A mixture of normal densities of the pose, each in the tangent space at its mean:
//
//   log p(T) = log sum_k exp(w_k - |L_k log(T_k^-1 T)|^2 / 2),
//
// with L_k' L_k the information, order x y z rx ry rz, part frame, and w_k the log weight with the normalization.
#pragma once
#include <utility>
#include <vector>

#include "solve/pose_term.hpp"
#include "solve/problem.hpp"

namespace tanteo {

// The whitened residuals of the most probable normal density at a pose, and their derivatives by a small motion about a
// centre, six for each residual.
void nearest_normal_pose(const std::vector<PosePrior>& normals, const Pose& pose, const Vec3& centre, double r[6],
                         double rows[36]);

double add_normal_poses(const std::vector<PosePrior>& normals, const Pose& pose, const Slope* slope);

class NormalPoses : public PoseTerm {
  public:
    explicit NormalPoses(std::vector<PosePrior> normals) : normals(std::move(normals)) {}
    double add(const State& state, const Slope* slope) const override {
        return add_normal_poses(normals, state.pose, slope);
    }

  private:
    std::vector<PosePrior> normals;
};

}  // namespace tanteo
