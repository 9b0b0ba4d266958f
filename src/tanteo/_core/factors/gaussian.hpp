// Normal densities of a position about a point and about a line segment, with gradient and curvature.
#pragma once
#include <cstring>

#include "factors/factor.hpp"

namespace tanteo {

// Density of a position p measured beside an infinite line through a: normal across it, N(u; 0, C_uu), at any position
// along it. Sets the component except weight and element; returns 0 if p is beyond REACH.
inline double line_density(const Vec3& a, const Vec3& direction, const Vec3& p, const Mat3& C, Component& component) {
    const Vec3 off = p - a;
    const double t = dot(off, direction);
    if (squared(off) - t * t > REACH * REACH * (C(0, 0) + C(1, 1) + C(2, 2))) return 0;
    const Vec3 u = any_across(direction), v = cross(direction, u);
    const double uu = dot(u, C * u), uv = dot(u, C * v), vv = dot(v, C * v), det = uu * vv - uv * uv;
    const double x = dot(off, u), y = dot(off, v);
    const double q = (vv * x * x - 2 * uv * x * y + uu * y * y) / det;
    if (q > REACH * REACH) return 0;
    Mat3 info;
    add_outer(info, vv / det, u, u);
    add_outer(info, -uv / det, u, v);
    add_outer(info, -uv / det, v, u);
    add_outer(info, uu / det, v, v);
    component.distance = std::hypot(x, y);
    component.per_sd = component.distance > 0 ? std::sqrt(q) / component.distance : 1 / std::sqrt(uu);
    component.normal = {};
    component.slope = -(info * off);
    component.stiff = info;
    return fast_exp(-0.5 * q - 2 * HALF_LOG_TWO_PI) / std::sqrt(det);
}

// Density of a position p measured on a segment from a: normal about the line, uniform along the length L,
//   f(p) = N(u; 0, C_uu) [Phi(t / s) - Phi((t - L) / s)] / L,
// with u across and t along the line, s the standard deviation along it. Sets the component except weight and element;
// returns 0 if p is beyond REACH.
inline double segment_density(const Vec3& a, const Vec3& direction, double length, const Vec3& p, const Mat3& C,
                              Component& component) {
    const double beside = line_density(a, direction, p, C, component);
    if (!(beside > 0)) return 0;
    const double t = dot(p - a, direction), sd = std::sqrt(dot(direction, C * direction));
    const double along = normal_below(t / sd) - normal_below((t - length) / sd);
    const double near = normal_density(t / sd), far = normal_density((t - length) / sd);
    component.slope = component.slope + ((near - far) / sd / std::max(along, 1e-300)) * direction;
    component.spread = (far * (t - length) - near * t) / sd / std::max(along, 1e-300);
    return along / length * beside;
}

// The normal density N(p; c, C) about points c of the part, for one covariance.
class PointDensity {
  public:
    explicit PointDensity(const Mat3& C) {
        double L[9];
        std::memcpy(L, C.m, sizeof L);
        if (!cholesky(L, 3)) return;
        possible = true;
        log_det = std::log(L[0] * L[4] * L[8]);
        for (int i = 0; i < 3; ++i) {
            double column[3] = {0, 0, 0};
            column[i] = 1;
            solve_cholesky(L, 3, column);
            for (int k = 0; k < 3; ++k) info(k, i) = column[k];
        }
    }
    // Sets the component except weight and element; returns 0 if p is beyond REACH.
    double at(const Vec3& c, const Vec3& p, Component& component) const {
        const Vec3 off = p - c, pull = info * off;
        const double q = dot(off, pull);
        if (!possible || q > REACH * REACH) return 0;
        component.distance = norm(off);
        component.per_sd = component.distance > 0 ? std::sqrt(q) / component.distance : 0;
        component.normal = {};
        component.slope = -pull;
        component.stiff = info;
        return fast_exp(-0.5 * q - 3 * HALF_LOG_TWO_PI - log_det);
    }

  private:
    Mat3 info;
    double log_det = 0;
    bool possible = false;
};

}  // namespace tanteo
