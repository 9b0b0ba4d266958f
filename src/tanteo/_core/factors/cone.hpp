// Echoes of a wide beam: the nearest point of the part inside a cone, and hits of rays that fill the cone.
#pragma once
#include <vector>

#include "shape/shape.hpp"
#include "vec.hpp"

namespace tanteo {

// A distance that a device may report, with its derivatives by the origin and the axis of the cone.
struct ConeEcho {
    double range = 1e300, cosine = 1;  // cosine of the incidence
    Vec3 ray;            // unit direction to the point
    Vec3 by_origin, by_axis;
    int triangle = -1;
};

struct Cone {
    Vec3 origin, axis;  // axis: unit vector
    double half_angle, least_cosine;  // least cosine of the incidence at which a surface answers
};

// Triangles whose outer side is towards the origin, and that may be in the cone and nearer than `reach`; none if the
// origin is inside the part.
std::vector<int> triangles_in(const Shape& shape, const Cone& cone, double reach);

// Triangles seen from one origin, for many rays: a ray hits one if it is on the same side of the three planes through the
// origin and its sides.
class Seen {
  public:
    Seen(const Shape& shape, const std::vector<int>& triangles, const Cone& cone);
    // The first hit of one ray at a unit direction; the axis of the cone turns it with the cone.
    ConeEcho echo(const Vec3& ray) const;

  private:
    struct Triangle {
        Vec3 normal, sides[3];
        double height;  // of the origin over its plane
        int number;
    };
    const Cone& cone;
    std::vector<Triangle> all;
};

// The nearest point of the outer side of the triangles inside the cone; a range of 1e300 if there is none.
ConeEcho nearest_in(const Shape& shape, const std::vector<int>& triangles, const Cone& cone);

}  // namespace tanteo
