// Student-t components of poses: samples, and the density of a mixture.
#pragma once
#include <vector>

#include "vec.hpp"

namespace tanteo {

// A component in the straight coordinates of a bent ridge: x_i - sum_jk bend_ijk x_j x_k for offsets x from its base about
// the centre. The bend of some directions depends on the others alone, so that volumes are equal.
struct MixtureComponent {
    int owner;  // whose share it counts for
    Pose base;
    std::vector<double> bend;  // 21 products j <= k for each i; empty if all are zero
    double mean[6];
    double inverse[36];  // inverse of the Cholesky factor of the scale matrix, row-major, lower
    double log_weight;
};

// Density of the mixture at a pose over the invariant measure of shifts of the centre and turns; shares by owner.
class Mixture {
  public:
    Mixture(std::vector<MixtureComponent> components, int owners, double freedom, const Vec3& centre);
    double log_density(const Pose& pose, double* shares) const;

  private:
    std::vector<MixtureComponent> components;
    std::vector<double> weights, reach_shift, reach_turn;  // squared distances from the base beyond which it is negligible
    std::vector<Vec3> middles;                             // places of the centre at the bases
    int owners;
    double freedom;
    Vec3 centre;
};

}  // namespace tanteo
