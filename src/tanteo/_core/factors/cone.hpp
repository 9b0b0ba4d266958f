// Echoes of a wide beam: the nearest point of the part inside a cone, and hits of rays that fill the cone.
#pragma once
#include <algorithm>
#include <array>
#include <utility>
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

// Directions that fill a disc of radius one evenly, sorted by x.
struct RayPattern {
    static constexpr int MOST = 255;
    explicit RayPattern(int count);
    // The first ray with x at or beyond a bound; up to some earlier.
    int first_from(double bound) const;
    // A number of rays beyond which x is greater than a bound.
    int end_at(double bound) const;
    int count;
    float x[MOST], y[MOST];

  private:
    static constexpr int BINS = 32;
    int bins[BINS + 1];
};

// A ray of a cone that a surface answers, along axis + a u + b v.
struct RayHit {
    double range, cosine;
    Vec3 along, normal;  // along: not of unit length
    int triangle;
};

// Triangles seen from one origin, for many rays: over the plane across the axis at distance one, the sides of a triangle
// and one over its depth are linear.
class Seen {
  public:
    // The axes u and v are across that of the cone; u, v and the axis are right-handed.
    Seen(const Shape& shape, const std::vector<int>& triangles, const Cone& cone, const Vec3& u, const Vec3& v);
    // The first hits of the rays of a pattern, which turn with the cone: over the whole cone, or in the ellipse about the
    // rectangle that the triangles may cover.
    void cast(const RayPattern& pattern, bool whole, std::vector<RayHit>& hits) const;
    // The fraction of the cone's square that the ellipse about the triangles covers, at most 1.
    double covered() const { return std::min(1.0, 2 * middle_and_half(0).second * middle_and_half(1).second); }
    // Whether all triangles are in one plane, so that the range is smooth over the cone wherever it hits.
    bool is_one_plane() const { return one_plane; }

  private:
    struct Triangle {
        Vec3 normal, depth;            // depth: coefficients of x, y and 1
        std::array<float, 3> sides[3], near;  // the same of the sides and the depth, for the comparison of triangles
        double height;                 // of the origin over its plane
        double least, most;            // bounds of x
        int number;
    };
    std::pair<double, double> middle_and_half(int i) const { return {0.5 * (lo[i] + hi[i]), 0.5 * (hi[i] - lo[i])}; }

    const Cone& cone;
    double slope;
    std::vector<Triangle> all;
    double lo[2] = {1, 1}, hi[2] = {-1, -1};  // rectangle about the triangles, in half widths of the cone
    bool one_plane = true;
};

// The nearest point of the outer side of the triangles inside the cone; a range of 1e300 if there is none.
ConeEcho nearest_in(const Shape& shape, const std::vector<int>& triangles, const Cone& cone);

}  // namespace tanteo
