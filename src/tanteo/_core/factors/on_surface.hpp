// What points have in common that were sensed on the surface of the part: on its faces, edges or corners.
#pragma once
#include "factors/factor.hpp"
#include "factors/registry.hpp"

namespace tanteo {

class OnSurface : public Factor {
  public:
    double radius = 0;       // of the ball [m]; 0 for a point of the surface itself
    Vec3 inward;             // direction of the beam or approach, or about into the material; zero where unknown
    bool directed = false;   // inward is the direction of a beam or approach
    bool sided = false;      // inward is known at all
    double free_reach = 0;   // length of the path along the beam before the point on which nothing was met [m]
    bool round_face = false; // its label names a face that is not flat

    Sites sites(const Shape& shape) const final;
    double rough_cost(const Shape& shape, const Pose& pose, double blur, double tilt) const final;
    NearestElement nearest(const Shape& shape, const Pose& pose, const Vec3& p, bool coarse) const final;
    NearestPlace beside(const Shape& shape, const Pose& pose, const Vec3& p) const final;

    void fill(const Columns& columns, size_t row);

  protected:
    // Whether the free path before the point runs through the part, also a little beside it.
    bool is_blocked(const Placement& at) const;
};

}  // namespace tanteo
