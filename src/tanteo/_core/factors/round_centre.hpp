// Sensed centres of round features: centres of circles on the axis of a hole or boss, of spheres and tori, apexes of
// cones, with axis and size if they were sensed. The part has them as landmarks (Shape::axes).
#pragma once
#include "factors/factor.hpp"
#include "factors/registry.hpp"

namespace tanteo {

// p(x, m, s | pose) = sum_i w_i f_i(x) tilt(m; d_i) N(s - s_i; 0, sd_s^2), over the landmarks i of its kind, with w_i the
// fraction of the landmark among those of its kind and s_i the nearest size in its range.
class RoundCentre : public Factor {
  public:
    double size = 0, size_sd = 1;    // radius [m] or half angle [rad]; 0 where unknown
    double other = 0, other_sd = 1;  // a second size, such as the radius of a torus's tube; 0 where unknown
    int side = 0;                  // 1: hole, -1: boss, 0: unknown
    double offset = 0;             // distance of the point from the landmark along the axis [m]

    bool on_surface() const final { return false; }
    void evaluate(const Placement& at, Components& out) const final;
    Sites sites(const Shape& shape) const final;
    double rough_cost(const Shape& shape, const Pose& pose, double blur, double tilt) const final;
    NearestElement nearest(const Shape& shape, const Pose& pose, const Vec3& p, bool coarse) const final;
    NearestPlace beside(const Shape& shape, const Pose& pose, const Vec3& p) const final;

    void fill(const Columns& columns, size_t row);

  protected:
    virtual int landmark() const = 0;                      // code of its landmarks
    virtual bool is_line() const { return false; }         // whether the landmarks are lines, with the point anywhere on one
    virtual bool axis_is_signed() const { return false; }  // whether the axis has a first end
    virtual bool size_is_angle() const { return false; }

  private:
    bool may_measure(const RoundAxis& axis, double sds, double blur) const;
    Vec3 start(const RoundAxis& axis) const { return axis.a + offset * axis.direction; }
    int nearest_landmark(const Shape& shape, const Vec3& p, Vec3& off) const;
};

}  // namespace tanteo
