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
// origin and its sides. A rectangle about each triangle in the plane across the axis at distance one excludes most rays.
class Seen {
  public:
    // The axes u and v are across that of the cone.
    Seen(const Shape& shape, const std::vector<int>& triangles, const Cone& cone, const Vec3& u, const Vec3& v);
    // The first hit of the ray along axis + a u + b v, which turns with the cone.
    ConeEcho echo(double a, double b) const;
    // Whether all triangles are in one plane, so that the range is smooth over the cone wherever it hits.
    bool is_one_plane() const { return one_plane; }

  private:
    struct Triangle {
        Vec3 normal, sides[3];
        double height;  // of the origin over its plane
        double least[2], most[2];  // rectangle along u and v
        int number;
    };
    const Cone& cone;
    const Vec3 u, v;
    std::vector<Triangle> all;
    bool one_plane = true;
};

// The nearest point of the outer side of the triangles inside the cone; a range of 1e300 if there is none.
ConeEcho nearest_in(const Shape& shape, const std::vector<int>& triangles, const Cone& cone);

}  // namespace tanteo
