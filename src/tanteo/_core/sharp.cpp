// What of the part a point may have met, and how dense it is there: convex edges under a ball, edges, corners.
#include <algorithm>
#include <cstring>
#include <vector>

#include "aim.hpp"
#include "likelihood.hpp"
#include "share.hpp"

namespace tanteo {

namespace {

constexpr double PARALLEL = 1e-3;  // least sine between two surfaces of which one keeps a ball off the other

// Share of the noise about a place that is on the side to which a direction points; its slope is added.
double kept_on(const Vec3& side, const Vec3& place, double per_sd, Vec3& slope) {
    const double h = dot(place, side) * per_sd, share = normal_below(h);
    slope += (per_sd * normal_density(h) / std::max(share, 1e-300)) * side;
    return share;
}

// Density of a point that is on a line from a, normal about it and even along its length; all but weight and face of the
// hit. 0 far away.
double meet_line(const Vec3& a, const Vec3& direction, double length, const Vec3& p, const Mat3& C, Hit& hit) {
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
    const double sd = std::sqrt(dot(direction, C * direction));
    const double along = normal_below(t / sd) - normal_below((t - length) / sd);
    const double near = normal_density(t / sd), far = normal_density((t - length) / sd);
    hit.distance = std::hypot(x, y);
    hit.per_sd = hit.distance > 0 ? std::sqrt(q) / hit.distance : 1 / std::sqrt(uu);
    hit.normal = {};  // all of it is in slope and stiff
    hit.slope = -(info * off) + ((near - far) / sd / std::max(along, 1e-300)) * direction;
    hit.spread = (far * (t - length) - near * t) / sd / std::max(along, 1e-300);
    hit.stiff = info;
    return along / length / std::sqrt(det) * fast_exp(-0.5 * q - 2 * HALF_LOG_TWO_PI);
}

// A covariance, and the density that a point has about a place that is one point of the part.
struct Whitened {
    Mat3 info;
    double log_det = 0;
    bool possible = false;

    explicit Whitened(const Mat3& C) {
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
    // all but weight and face of the hit; 0 far away
    double meet(const Vec3& place, const Vec3& p, Hit& hit) const {
        const Vec3 off = p - place, pull = info * off;
        const double q = dot(off, pull);
        if (!possible || q > REACH * REACH) return 0;
        hit.distance = norm(off);
        hit.per_sd = hit.distance > 0 ? std::sqrt(q) / hit.distance : 0;
        hit.normal = {};
        hit.slope = -pull;
        hit.stiff = info;
        return fast_exp(-0.5 * q - 3 * HALF_LOG_TWO_PI - log_det);
    }
};

}  // namespace

// A ball that touches one thing must not be inside of another face in front of it: the share of the noise along what it
// touches that leaves it outside, and where it is near the other face at all.
void Likelihood::keep_outside(size_t first) {
    const double apart = 1e-9 * shape.diagonal;
    for (size_t k = first; k < hits.size(); ++k) {
        Hit& hit = hits[k];
        const BallSees& own = ball_sees[k - first];
        for (const BallSees& other : faces_near) {
            if (other.flat == own.flat || (own.round && other.round && own.face == other.face)) continue;
            if (dot(other.normal, own.on_it - other.on_it) <= apart) continue;
            if (own.flat >= 0 && dot(own.normal, other.on_it - own.on_it) <= apart) continue;
            const double cosine = dot(other.normal, own.normal), sine = std::sqrt(std::max(1 - cosine * cosine, 0.0));
            if (sine < PARALLEL) continue;
            const double per = hit.per_sd / sine, u = (other.gap - cosine * own.gap) * per;
            const double outside = 1 - other.share * normal_below(-u);
            if (outside > 1 - 1e-9) continue;
            const double pull = other.share * normal_density(u) / std::max(outside, 1e-300);
            const Vec3 by_p = per * (other.normal - cosine * own.normal);
            hit.weight *= outside;
            hit.slope += pull * by_p;
            add_outer(hit.stiff, std::max(pull * (pull + u), 0.0), by_p, by_p);
        }
    }
}

// A ball that touches an edge or a vertex: its centre is as far from it as the radius, along n, which turns along
// across[i] by bend[i]; share and slope are of the noise that falls where nothing else is nearer.
void Likelihood::meet_sharp(const Ball& ball, const BallSees& sees, const Vec3 across[2], const double bend[2],
                            const Vec3& slope) {
    const Point& point = ball.point;
    const double r = sees.gap * ball.per_sd;
    Hit hit;
    hit.tilted = 0;
    hit.weight = sees.share * met(point, sees.normal, ball.along, 1 / shape.area) * ball.per_sd *
                 fast_exp(-0.5 * r * r - HALF_LOG_TWO_PI - point.log_outlier);
    if (point.oriented)
        hit.weight *= tilt_density(across, bend, sees.normal, ball.C, ball.felt, ball.normal_variance, hit);
    if (!(hit.weight >= NOTHING * problem.mean_rate)) return;
    hit.distance = sees.gap;
    hit.per_sd = ball.per_sd;
    hit.normal = sees.normal;
    hit.face = sees.face;
    hit.slope = slope;
    hit.stiff = {};
    hits.push_back(hit);
    ball_sees.push_back(sees);
}

// A ball that touches a convex edge: its centre is on a cylinder about the edge, between the two faces.
void Likelihood::look_over_edges(const Ball& ball) {
    const double per_sd = ball.per_sd, radius = ball.point.radius;
    std::vector<Tip> tips;
    shape.convex_edges_near(ball.centre, REACH / per_sd + radius, [&](int which) {
        const ConvexEdge& e = shape.convex_edges[which];
        if (e.tip[0] >= 0) tips.push_back({e.tip[0], e.face, e.a, e.direction});
        if (e.tip[1] >= 0) tips.push_back({e.tip[1], e.face, e.a + e.length * e.direction, -e.direction});
        const Vec3 off = ball.centre - e.a;
        const double t = dot(off, e.direction);
        const Vec3 out = off - t * e.direction;
        const double far = norm(out);
        if (std::fabs(far - radius) * per_sd > REACH || far < 1e-12) return;
        if (dot(out, e.normal[0]) < 0 && dot(out, e.normal[1]) < 0) return;
        const double near = normal_density(t * per_sd), end = normal_density((t - e.length) * per_sd);
        const double along = normal_below(t * per_sd) - normal_below((t - e.length) * per_sd);
        double share = along;
        Vec3 slope = ((near - end) * per_sd / std::max(along, 1e-300)) * e.direction;
        for (const Vec3& inward : e.inward) share *= kept_on(-inward, out, per_sd, slope);
        const Vec3 n = (1 / far) * out, across[2] = {e.direction, cross(n, e.direction)};
        const double bend[2] = {0, 1 / far};
        meet_sharp(ball, {-1, e.face, false, n, e.a, far - radius, share}, across, bend, slope);
    });
    look_over_vertices(ball, tips);
}

// A ball that touches a convex vertex: its centre is on a sphere about it, on the outer side of all its edges.
void Likelihood::look_over_vertices(const Ball& ball, std::vector<Tip>& tips) {
    const double per_sd = ball.per_sd, radius = ball.point.radius;
    std::sort(tips.begin(), tips.end(), [](const Tip& a, const Tip& b) { return a.vertex < b.vertex; });
    for (size_t k = 0; k < tips.size();) {
        const Tip& tip = tips[k];
        const Vec3 out = ball.centre - tip.at;
        const double far = norm(out);
        double share = 1;
        Vec3 slope;
        for (; k < tips.size() && tips[k].vertex == tip.vertex; ++k) share *= kept_on(-tips[k].away, out, per_sd, slope);
        if (std::fabs(far - radius) * per_sd > REACH || far < 1e-12) continue;
        const Vec3 n = (1 / far) * out, u = any_across(n), across[2] = {u, cross(n, u)};
        const double bend[2] = {1 / far, 1 / far};
        meet_sharp(ball, {-1, tip.face, false, n, tip.at, far - radius, share}, across, bend, slope);
    }
}

// A point that was sensed on a straight edge: normal about the edge, even along it.
void Likelihood::look_at_edges(const Point& point, int j, const Mat3& C) {
    const Vec3& p = seen[j].in_part;
    const double nothing = NOTHING * problem.mean_rate;
    for (size_t k = 0; k < shape.edges.size(); ++k) {
        const Segment& e = shape.edges[k];
        Hit hit;
        hit.tilted = 0;
        hit.weight = meet_line(e.a, e.direction, e.length, p, C, hit) * e.length / shape.edge_length *
                     fast_exp(-point.log_outlier);
        if (!(hit.weight >= nothing)) continue;
        hit.face = -2 - static_cast<int>(k);
        hits.push_back(hit);
    }
}

// The centre of a circle: normal about the axis of a hole or boss, even along it; that of a sphere, or the apex of a cone,
// normal about it. With the tilts of a sensed axis, of a circle with either end first, and the size where it is known.
void Likelihood::look_at_axes(const Point& point, int j, const Mat3& R, const Mat3& C) {
    const Vec3& p = seen[j].in_part;
    const bool line = point.kind == Kind::CENTRE, apex = point.kind == Kind::APEX;
    const double nothing = NOTHING * problem.mean_rate, width = std::hypot(point.circle_sd, apex ? blur_turn : blur);
    const Vec3 m = point.oriented ? transposed_times(R, point.normal) : Vec3{};
    const double tilt_variance = point.normal_sd * point.normal_sd + blur_turn * blur_turn;
    const Whitened about(C);
    for (const RoundAxis& axis : shape.axes) {
        if (!axis.may_have(point, REACH * width)) continue;
        Hit hit;
        hit.tilted = 0;
        hit.weight = axis.weight * fast_exp(-point.log_outlier) *
                     (line ? meet_line(axis.a, axis.direction, axis.length, p, C, hit) : about.meet(axis.start(point), p, hit));
        if (point.circle > 0) {
            const double r = (point.circle - std::clamp(point.circle, axis.least, axis.most)) / width;
            hit.weight *= fast_exp(-0.5 * r * r - HALF_LOG_TWO_PI) / width;
        }
        if (point.hole) hit.weight *= 2;  // than where nobody said which
        if (point.oriented && hit.weight >= nothing) {
            const Vec3 n = line && dot(axis.direction, m) < 0 ? -axis.direction : axis.direction, u = any_across(n);
            const Vec3 across[2] = {u, cross(n, u)};
            const double bend[2] = {0, 0};
            hit.weight *= (line ? 0.5 : 1) * tilt_density(across, bend, n, C, m, tilt_variance, hit);
        }
        if (!(hit.weight >= nothing)) continue;
        hit.face = shape.number_of(axis);
        hits.push_back(hit);
    }
}

// A point that was sensed on a corner: normal about it, all corners alike.
void Likelihood::look_at_corners(const Point& point, int j, const Mat3& C) {
    const double nothing = NOTHING * problem.mean_rate;
    const Whitened about(C);
    for (size_t k = 0; k < shape.corners.size(); ++k) {
        Hit hit;
        hit.tilted = 0;
        hit.weight = about.meet(shape.corners[k], seen[j].in_part, hit) * fast_exp(-point.log_outlier) / shape.corners.size();
        if (!(hit.weight >= nothing)) continue;
        hit.face = -2 - static_cast<int>(shape.edges.size() + k);
        hits.push_back(hit);
    }
}

}  // namespace tanteo
