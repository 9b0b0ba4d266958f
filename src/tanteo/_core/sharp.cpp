// What of the part a point may have met, and how dense it is there: convex edges under a ball, edges, corners.
#include <cstring>

#include "likelihood.hpp"
#include "share.hpp"

namespace tanteo {

// A ball that touches a convex edge: its centre is on a cylinder about the edge, between the two faces.
void Likelihood::look_over_edges(const Point& point, int j, double variance) {
    const Vec3& p = seen[j].in_part;
    const double sd = std::sqrt(variance), per_sd = 1 / sd, nothing = NOTHING * problem.mean_rate;
    shape.convex_edges_near(p, REACH * sd + point.radius, [&](int which) {
        const ConvexEdge& e = shape.convex_edges[which];
        const Vec3 off = p - e.a;
        const double t = dot(off, e.direction);
        const Vec3 out = off - t * e.direction;
        const double far = norm(out), r = (far - point.radius) * per_sd;
        if (std::fabs(r) > REACH || far < 1e-12) return;
        const double h0 = -dot(out, e.inward[0]) * per_sd, h1 = -dot(out, e.inward[1]) * per_sd;
        if (dot(out, e.normal[0]) < 0 && dot(out, e.normal[1]) < 0) return;
        const double along = normal_below(t * per_sd) - normal_below((t - e.length) * per_sd);
        const double share = normal_below(h0) * normal_below(h1) * along;
        const double weight = share * per_sd / shape.area * fast_exp(-0.5 * r * r - HALF_LOG_TWO_PI - point.log_outlier);
        if (!(weight >= nothing)) return;
        Hit hit;
        hit.weight = weight;
        hit.distance = far - point.radius;
        hit.per_sd = per_sd;
        hit.normal = (1 / far) * out;
        hit.face = e.face;
        hit.tilted = 0;
        hit.slope = (-per_sd * normal_density(h0) / std::max(normal_below(h0), 1e-300)) * e.inward[0];
        hit.slope += (-per_sd * normal_density(h1) / std::max(normal_below(h1), 1e-300)) * e.inward[1];
        hit.slope += ((normal_density(t * per_sd) - normal_density((t - e.length) * per_sd)) * per_sd /
                      std::max(along, 1e-300)) * e.direction;
        hit.stiff = {};
        hits.push_back(hit);
    });
}

// A point that was sensed on a straight edge: normal about the edge, even along it.
void Likelihood::look_at_edges(const Point& point, int j, const Mat3& C) {
    const Vec3& p = seen[j].in_part;
    const double nothing = NOTHING * problem.mean_rate;
    for (size_t k = 0; k < shape.edges.size(); ++k) {
        const Segment& e = shape.edges[k];
        const Vec3 off = p - e.a, u = any_across(e.direction), v = cross(e.direction, u);
        const double uu = dot(u, C * u), uv = dot(u, C * v), vv = dot(v, C * v), det = uu * vv - uv * uv;
        const double x = dot(off, u), y = dot(off, v);
        Mat3 info;
        add_outer(info, vv / det, u, u);
        add_outer(info, -uv / det, u, v);
        add_outer(info, -uv / det, v, u);
        add_outer(info, uu / det, v, v);
        const double q = (vv * x * x - 2 * uv * x * y + uu * y * y) / det;
        if (q > REACH * REACH) continue;
        const double sd = std::sqrt(dot(e.direction, C * e.direction)), t = dot(off, e.direction);
        const double along = normal_below(t / sd) - normal_below((t - e.length) / sd);
        const double weight =
            along / shape.edge_length / std::sqrt(det) * fast_exp(-0.5 * q - 2 * HALF_LOG_TWO_PI - point.log_outlier);
        if (!(weight >= nothing)) continue;
        Hit hit;
        hit.weight = weight;
        hit.distance = std::hypot(x, y);
        hit.per_sd = hit.distance > 0 ? std::sqrt(q) / hit.distance : 1 / std::sqrt(uu);
        hit.normal = {};  // all of it is in slope and stiff
        hit.face = -2 - static_cast<int>(k);
        hit.tilted = 0;
        const double near = normal_density(t / sd), far = normal_density((t - e.length) / sd);
        hit.slope = -(info * off) + ((near - far) / sd / std::max(along, 1e-300)) * e.direction;
        hit.spread = (far * (t - e.length) - near * t) / sd / std::max(along, 1e-300);
        hit.stiff = info;
        hits.push_back(hit);
    }
}

// A point that was sensed on a corner: normal about it, all corners alike.
void Likelihood::look_at_corners(const Point& point, int j, const Mat3& C) {
    const Vec3& p = seen[j].in_part;
    double L[9];
    std::memcpy(L, C.m, sizeof L);
    if (!cholesky(L, 3)) return;
    const double log_det = std::log(L[0] * L[4] * L[8]), nothing = NOTHING * problem.mean_rate;
    Mat3 info;
    for (int i = 0; i < 3; ++i) {
        double column[3] = {0, 0, 0};
        column[i] = 1;
        solve_cholesky(L, 3, column);
        for (int k = 0; k < 3; ++k) info(k, i) = column[k];
    }
    for (size_t k = 0; k < shape.corners.size(); ++k) {
        const Vec3 off = p - shape.corners[k], pull = info * off;
        const double q = dot(off, pull);
        if (q > REACH * REACH) continue;
        Hit hit;
        hit.weight = fast_exp(-0.5 * q - 3 * HALF_LOG_TWO_PI - log_det - point.log_outlier) / shape.corners.size();
        if (!(hit.weight >= nothing)) continue;
        hit.distance = norm(off);
        hit.per_sd = hit.distance > 0 ? std::sqrt(q) / hit.distance : 0;
        hit.normal = {};
        hit.face = -2 - static_cast<int>(shape.edges.size() + k);
        hit.tilted = 0;
        hit.slope = -pull;
        hit.stiff = info;
        hits.push_back(hit);
    }
}

}  // namespace tanteo
