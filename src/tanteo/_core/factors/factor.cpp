#include "factors/factor.hpp"

#include <cmath>

namespace tanteo {

void Factor::set_noise(const Mat3& covariance, double tolerance_variance) {
    cov = covariance;
    extra = tolerance_variance;
    const double v = cov(0, 0);
    isotropic = true;
    for (int i = 0; i < 9; ++i) isotropic = isotropic && std::fabs(cov.m[i] - (i % 4 ? 0 : v)) <= 1e-9 * v;
}

NearestPlace nearest_on_surface(const Factor& factor, const Shape& shape, const Pose& pose, const Vec3& p, double radius,
                                const Vec3& inward, bool directed) {
    const Closest closest = shape.closest(p);
    const Vec3& normal = shape.normals[closest.triangle];
    const double sign = dot(p - closest.point, normal) < 0 ? -1 : 1;
    const Vec3 d = pose.R * unit(p - closest.point), n = pose.R * normal;
    NearestPlace out;
    out.distance = sign * std::sqrt(closest.squared) - radius;
    out.per_sd = 1 / std::sqrt(dot(d, factor.cov * d) + factor.extra);
    // density of a point exactly on a face with this normal
    double density = directed ? std::max(-dot(n, inward), 0.0) : 1 / shape.area;
    if (factor.oriented) {
        const double per_tilt = 1 / factor.direction_sd;
        const double squared = 2 * (1 - dot(n, factor.direction)) * per_tilt * per_tilt;
        density *= per_tilt * per_tilt / (2 * PI) * std::exp(-0.5 * squared);
    }
    out.density = density * std::exp(-factor.log_outlier) / std::sqrt(2 * PI) * out.per_sd;
    out.normal = closest.squared > 0 ? sign * unit(p - closest.point) : normal;
    out.element = shape.faces[closest.triangle];
    return out;
}

void add_component(LocalSlope& sum, const Component& c, double weight) {
    const double r = c.distance * c.per_sd;
    if (c.element >= 0) {
        sum.p += (-weight * r * c.per_sd) * c.normal;
        add_outer(sum.pp, weight * c.per_sd * c.per_sd, c.normal, c.normal);
    }
    if (c.turns) {
        sum.m += (-weight * r * c.per_sd) * c.by_turn;
        add_outer(sum.pm, weight * c.per_sd * c.per_sd, c.normal, c.by_turn);
        add_outer(sum.mm, weight * c.per_sd * c.per_sd, c.by_turn, c.by_turn);
        return;
    }
    sum.p += weight * c.slope;
    // the block of p and m that a tilt adds is positive semidefinite by itself
    const Mat3 stiff = c.tilted ? not_negative(c.stiff) : c.stiff;
    for (int i = 0; i < 9; ++i) sum.pp.m[i] += weight * stiff.m[i];
    if (!c.tilted) return;
    for (int i = 0; i < 2; ++i) {  // tilt_i = e_i . m / sd; the curvature turns e_i with p
        const Vec3 by_p = (-c.bend[i] * c.along * c.per_tilt[i]) * c.e[i];
        const Vec3 by_m = c.per_tilt[i] * c.e[i];
        sum.p += (-weight * c.tilt[i]) * by_p;
        sum.m += (-weight * c.tilt[i]) * by_m;
        add_outer(sum.pp, weight, by_p, by_p);
        add_outer(sum.pm, weight, by_p, by_m);
        add_outer(sum.mm, weight, by_m, by_m);
    }
}

double tilt_density(const Vec3* e, const double* bend, const Vec3& n, const Mat3& C, const Vec3& m, double variance,
                    Component& component) {
    constexpr double INTO_PART = 2e-22;  // factor for a sensed normal that points into the part
    component.along = dot(n, m);
    component.tilted = true;
    double log = -2 * HALF_LOG_TWO_PI;
    for (int i = 0; i < 2; ++i) {
        component.e[i] = e[i];
        component.bend[i] = bend[i];
        double own = variance;
        if (bend[i] != 0) own += bend[i] * bend[i] * dot(e[i], C * e[i]);
        component.per_tilt[i] = 1 / std::sqrt(own);
        component.tilt[i] = dot(e[i], m) * component.per_tilt[i];
        log -= 0.5 * component.tilt[i] * component.tilt[i];
    }
    const double density = component.per_tilt[0] * component.per_tilt[1] * fast_exp(log);
    return component.along > 0 ? density : INTO_PART * density;
}

}  // namespace tanteo
