// Echoes of a wide beam: the nearest point of the part inside a cone, and hits of rays that fill the cone.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "lanes/lane_kernels.hpp"
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

// Section of a beam at distance one along its axis: axis + x u + y v, where (x, y) is in the unit disc, or in the square from
// -1 to 1. u and v are half axes across the axis, right-handed with it, and need not be perpendicular.
struct Section {
    Vec3 axis, u, v;
    bool round;
    // The area in x and y.
    double area() const { return round ? 3.14159265358979324 : 4; }
    // Vectors across the axis whose products with u and v are 1 and 0, 0 and 1.
    std::pair<Vec3, Vec3> duals() const {
        const double per = 1 / dot(cross(u, v), axis);
        return {per * cross(v, axis), per * cross(axis, u)};
    }
};

// A place that is seen from the origin of a beam.
struct RayHit {
    double range, cosine;  // cosine: of the incidence
    Vec3 along, normal;    // along: not of unit length
    int triangle;
    double share;          // fraction of the section that it represents
    double length() const { return norm(along); }
    double height() const { return range * cosine; }  // of the origin over the plane of the triangle
};

// Places that fill a disc or a square evenly, sorted by x.
struct RayPattern {
    static constexpr int MOST = 63;
    // The pattern of a number of rays; one for each number and shape.
    static const RayPattern& of(int count, bool round);
    // The first ray with x at or beyond a bound; up to some earlier.
    int first_from(double bound) const;
    // A number of rays beyond which x is greater than a bound.
    int end_at(double bound) const;

    int count;
    bool round;
    float x[MOST], y[MOST];

  private:
    static constexpr int BINS = 32;
    RayPattern(int count, bool round);
    int bins[BINS + 1];
};

// Triangles seen from one origin, for many rays: over the plane across the axis at distance one, the sides of a triangle
// and one over its depth are linear.
class Seen {
  public:
    Seen(const Shape& shape, const std::vector<int>& triangles, const Vec3& origin, const Section& section);
    // The first hits of the rays of a pattern, which turn with the beam: over the whole section, or over the part of it
    // that the triangles may cover.
    void cast(const RayPattern& pattern, bool whole, std::vector<RayHit>& hits) const;
    // The fraction of the section that the rays of a pattern fill, if they are not to fill the whole, at most 1.
    double covered() const { return std::min(1.0, (section.round ? 2 : 1) * window(0).second * window(1).second); }
    // Middle and half width of the rectangle about the triangles along u and v.
    std::pair<double, double> window(int i) const { return {0.5 * (lo[i] + hi[i]), 0.5 * (hi[i] - lo[i])}; }
    // The same of the section that the rays of a pattern fill.
    std::pair<double, double> filled(int i, bool whole) const {
        return whole ? std::pair{0.0, 1.0} : std::pair{window(i).first, window(i).second * (section.round ? 1.4142135623730951 : 1)};
    }

  private:
    struct Triangle {
        Vec3 normal, depth;            // depth: coefficients of x, y and 1
        SeenTriangle seen;             // sides and depth, for the comparison of triangles
        double height;                 // of the origin over its plane
        double least, most;            // bounds of x
        int number;
    };

    bool is_inside(double x, double y) const {
        return (section.round ? x * x + y * y : std::max(std::fabs(x), std::fabs(y))) <= 1;
    }

    const Section& section;
    std::vector<Triangle> all;
    double lo[2] = {1, 1}, hi[2] = {-1, -1};  // rectangle about the triangles, in x and y of the section
};

// The nearest point of the outer side of the triangles inside the cone; a range of 1e300 if there is none.
ConeEcho nearest_in(const Shape& shape, const std::vector<int>& triangles, const Cone& cone);

}  // namespace tanteo
