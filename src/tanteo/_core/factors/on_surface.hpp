// Common base of points that were sensed on the surface of the part: on its faces, edges or corners.
#pragma once
#include "factors/factor.hpp"
#include "factors/registry.hpp"

namespace tanteo {

class OnSurface : public Factor {
  public:
    double radius = 0;       // of the ball [m]; 0 for a point of the surface itself
    Vec3 inward;             // direction of the beam or approach, or roughly into the material; zero if unknown
    bool directed = false;   // inward is the direction of a beam or approach
    bool sided = false;      // inward is not zero
    double free_reach = 0;   // length of the free path along the beam before the point [m]
    bool round_face = false; // whether its label refers to a curved face

    Sites sites(const Shape& shape) const final;
    double rough_cost(const Shape& shape, const Pose& pose, double blur, double tilt) const override;
    NearestElement nearest(const Shape& shape, const Pose& pose, const Vec3& p, bool coarse) const override;
    NearestPlace beside(const Shape& shape, const Pose& pose, const Vec3& p) const final;

    void fill(const Columns& columns, size_t row);

  protected:
    // Whether the free path before the point runs through the part, also if displaced by the noise.
    bool is_blocked(const Placement& at) const;
};

}  // namespace tanteo
