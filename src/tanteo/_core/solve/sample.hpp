// Student-t components of poses: samples, and the density of a mixture.
#pragma once
#include <vector>

#include "vec.hpp"

namespace tanteo {

struct MixtureComponent {
    int owner;         // components of one owner are consecutive and share its base
    double mean[6];    // in the straight coordinates of the base about the centre
    double inverse[36];  // inverse of the Cholesky factor of the scale matrix, row-major, lower
    double log_weight;
};

// Offsets x from a base, along a bent ridge: the straight coordinates are x_i - sum_jk bend_ijk x_j x_k. The bend of some
// directions depends on the others alone, so that volumes are equal.
struct MixtureBase {
    Pose pose;
    bool straight;     // all of the bend is zero
    double bend[216];  // row-major
};

// Density of the mixture at a pose over the invariant measure of shifts of the centre and turns; shares by owner.
class Mixture {
  public:
    Mixture(std::vector<MixtureBase> bases, std::vector<MixtureComponent> components, double freedom, const Vec3& centre);
    double log_density(const Pose& pose, double* shares) const;
    int owners() const { return static_cast<int>(bases.size()); }

  private:
    std::vector<MixtureBase> bases;
    std::vector<MixtureComponent> components;
    std::vector<double> weights, reach_shift, reach_turn;  // squared distances from the base of each owner beyond which its density is negligible
    double freedom;
    Vec3 centre;
};

}  // namespace tanteo
