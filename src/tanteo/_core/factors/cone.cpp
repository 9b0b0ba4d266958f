#include "factors/cone.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <mutex>

#include "normal.hpp"

namespace tanteo {

namespace {

// Whether a sphere may touch the cone: its centre is at most radius from the cone's surface.
bool may_touch(const Cone& cone, double sine, double cosine, const Vec3& centre, double radius) {
    const Vec3 w = centre - cone.origin;
    const double along = dot(w, cone.axis), most = radius + along * sine;  // near its side or inside
    return along > -radius && most >= 0 && (squared(w) - along * along) * cosine * cosine <= most * most;
}

// Part of the segment p + t e, 0 <= t <= 1, inside the cone, which is convex. Returns false if there is none.
bool inside_part(const Cone& cone, double cosine, const Vec3& w, const Vec3& e, double& lo, double& hi) {
    const double c2 = cosine * cosine, wa = dot(w, cone.axis), ea = dot(e, cone.axis);
    const double A = ea * ea - c2 * dot(e, e), B = wa * ea - c2 * dot(w, e), C = wa * wa - c2 * dot(w, w);
    lo = 0;
    hi = 1;
    if (ea > 0) lo = std::max(lo, -wa / ea);  // in front of the apex
    if (ea < 0) hi = std::min(hi, -wa / ea);
    if (ea == 0 && wa < 0) return false;
    const double D = B * B - A * C;
    if (std::fabs(A) < 1e-300) {
        if (B > 0) lo = std::max(lo, -0.5 * C / B);
        else if (B < 0) hi = std::min(hi, -0.5 * C / B);
        else if (C < 0) return false;
    } else if (A < 0) {  // between the roots
        if (D < 0) return false;
        const double root = std::sqrt(D);
        lo = std::max(lo, (-B + root) / A);
        hi = std::min(hi, (-B - root) / A);
    } else if (D > 0) {  // beyond one root, as the other belongs to the opposite cone
        const double root = std::sqrt(D);
        if (ea > 0) lo = std::max(lo, (-B + root) / A);
        else hi = std::min(hi, (-B - root) / A);
    }
    return lo <= hi;
}

// The point of a segment inside the cone that is nearest to the apex.
bool nearest_of_segment(const Cone& cone, double cosine, const Vec3& p, const Vec3& q, ConeEcho& best) {
    const Vec3 w = p - cone.origin, e = q - p;
    double lo, hi;
    if (!inside_part(cone, cosine, w, e, lo, hi)) return false;
    const double free = -dot(w, e) / std::max(squared(e), 1e-300), t = std::clamp(free, lo, hi);
    const Vec3 y = w + t * e;
    const double range = norm(y);
    if (!(range < best.range) || !(range > 0)) return false;
    const Vec3 u = (1 / range) * y;
    best.range = range;
    best.ray = u;
    best.by_origin = -u;
    best.by_axis = {};
    const bool at_cone = t != free && t > 0 && t < 1;
    if (!at_cone) return true;
    // the point moves along the edge so that it stays on the cone: u . a = cos(half angle)
    const Vec3 across = cone.axis - dot(cone.axis, u) * u;
    const double per = dot(across, e);
    if (std::fabs(per) < 1e-3 * norm(across) * norm(e)) return true;
    const double moves = dot(u, e) / per;
    best.by_origin = moves * across - u;
    best.by_axis = (-range * moves) * u;
    return true;
}

}  // namespace

std::vector<int> triangles_in(const Shape& shape, const Cone& cone, double reach) {
    std::vector<int> found;
    const double sine = std::sin(cone.half_angle), cosine = std::cos(cone.half_angle);
    shape.triangles_where(
        [&](const Box& box) {
            if (box.squared_distance(cone.origin) > reach * reach) return false;
            return may_touch(cone, sine, cosine, 0.5 * (box.lo + box.hi), 0.5 * norm(box.hi - box.lo));
        },
        [&](int t) {
            const int corner = shape.triangles[3 * static_cast<size_t>(t)];
            if (dot(shape.normals[t], cone.origin - shape.vertices[corner]) > 0) found.push_back(t);
        });
    if (found.empty()) return found;
    int first = -1;  // from inside the part, the first hit of any ray is the inner side of a surface
    const Vec3 middle = shape.vertices[shape.triangles[3 * static_cast<size_t>(found[0])]] +
                        shape.vertices[shape.triangles[3 * static_cast<size_t>(found[0]) + 1]] +
                        shape.vertices[shape.triangles[3 * static_cast<size_t>(found[0]) + 2]];
    const Vec3 ray = unit((1. / 3) * middle - cone.origin);
    if (!(shape.bounds().squared_distance(cone.origin) > 0) && shape.cast(cone.origin, ray, 1e299, &first) < 1e299 && dot(shape.normals[first], ray) > 0) found.clear();
    return found;
}

ConeEcho nearest_in(const Shape& shape, const std::vector<int>& triangles, const Cone& cone) {
    const double cosine = std::cos(cone.half_angle), sine = std::sin(cone.half_angle);
    ConeEcho best;
    double in_front = 1e300;  // distance of surfaces that answer nothing but hide others
    for (const int t : triangles) {
        const Vec3& n = shape.normals[t];
        const int* corner = &shape.triangles[3 * static_cast<size_t>(t)];
        const Vec3 &a = shape.vertices[corner[0]], &b = shape.vertices[corner[1]], &c = shape.vertices[corner[2]];
        const double h = dot(n, cone.origin - a);
        if (h >= best.range) continue;
        ConeEcho own;
        own.range = best.range;
        const Vec3 down = -n;  // from the origin to the plane
        const double along = dot(down, cone.axis);
        Vec3 u = down;
        double tilt = 1;  // cosine between u and down
        Vec3 e;
        const bool edge = along < cosine;
        if (edge) {  // the nearest ray of the cone to the perpendicular
            e = unit(down - along * cone.axis);
            u = cosine * cone.axis + sine * e;
            tilt = dot(u, down);
        }
        if (!(tilt > 1e-6) || h / tilt >= best.range) continue;  // every point of the plane in the cone is farther
        bool found = shape.hit_at(t, cone.origin, u) < 1e299;
        if (found) {
            own.range = h / tilt;
            own.ray = u;
            own.by_origin = (-1 / tilt) * down;
            own.by_axis = edge ? (-own.range * std::sqrt(std::max(1 - tilt * tilt, 0.0)) / tilt) * e : Vec3{};
        } else {
            found = nearest_of_segment(cone, cosine, a, b, own);
            found = nearest_of_segment(cone, cosine, b, c, own) || found;
            found = nearest_of_segment(cone, cosine, c, a, own) || found;
        }
        if (!found) continue;
        own.cosine = h / own.range;
        own.triangle = t;
        if (own.cosine < cone.least_cosine) {
            in_front = std::min(in_front, own.range);
            continue;
        }
        best = own;
    }
    if (best.triangle < 0 || in_front >= best.range) return best;
    // a nearer surface answers nothing; it may hide the point
    const double reach = best.range * (1 - 1e-6);
    if (shape.cast(cone.origin, best.ray, reach) < reach) return {};
    return best;
}

// A disc is filled by a sunflower (Vogel 1979), a square by a lattice of the golden ratio.
RayPattern::RayPattern(int count, bool round) : count(count), round(round) {
    constexpr double GOLDEN_TURN = 2.39996322972865332, GOLDEN = 0.61803398874989485;
    std::vector<std::pair<double, double>> places(count);
    for (int k = 0; k < count; ++k) {
        const double along = (k + 0.5) / count, radius = std::sqrt(along), turns = (k + 0.5) * GOLDEN;
        places[k] = round ? std::pair{radius * std::cos(k * GOLDEN_TURN), radius * std::sin(k * GOLDEN_TURN)}
                          : std::pair{2 * along - 1, 2 * (turns - std::floor(turns)) - 1};
    }
    std::sort(places.begin(), places.end());
    for (int k = 0; k < count; ++k) x[k] = static_cast<float>(places[k].first), y[k] = static_cast<float>(places[k].second);
    for (int bin = 0, k = 0; bin <= BINS; ++bin) {
        while (k < count && x[k] < 2.0 * bin / BINS - 1) ++k;
        bins[bin] = k;
    }
}

const RayPattern& RayPattern::of(int count, bool round) {
    static std::mutex mutex;
    static std::map<std::pair<int, bool>, std::unique_ptr<RayPattern>> known;
    const std::lock_guard<std::mutex> lock(mutex);
    auto& found = known[{count, round}];
    if (!found) found.reset(new RayPattern(count, round));
    return *found;
}

int RayPattern::first_from(double bound) const {
    if (!(bound > -1)) return 0;
    return bound > 1 ? count : bins[static_cast<int>(0.5 * BINS * (bound + 1))];
}

int RayPattern::end_at(double bound) const { return first_from(bound + 2.0 / BINS); }

Seen::Seen(const Shape& shape, const std::vector<int>& triangles, const Vec3& origin, const Section& section)
    : section(section) {
    all.reserve(triangles.size());
    const auto [across, up] = section.duals();
    for (const int t : triangles) {
        const int* corner = &shape.triangles[3 * static_cast<size_t>(t)];
        Vec3 at[3];  // depth times x and y, and depth
        bool beyond = false;
        double least[2] = {1e300, 1e300}, most[2] = {-1e300, -1e300};
        for (int k = 0; k < 3; ++k) {
            const Vec3 w = shape.vertices[corner[k]] - origin;
            at[k] = {dot(w, across), dot(w, up), dot(w, section.axis)};
            beyond |= at[k].z <= 0;
            for (int i = 0; i < 2; ++i) {
                least[i] = std::min(least[i], at[k][i] / at[k].z);
                most[i] = std::max(most[i], at[k][i] / at[k].z);
            }
        }
        if (beyond)
            least[0] = least[1] = -1, most[0] = most[1] = 1;
        else if (least[0] > 1 || most[0] < -1 || least[1] > 1 || most[1] < -1)
            continue;
        for (int i = 0; i < 2; ++i) {
            lo[i] = std::min(lo[i], std::max(least[i], -1.0));
            hi[i] = std::max(hi[i], std::min(most[i], 1.0));
        }
        Triangle one;
        one.least = least[0];
        one.most = most[0];
        one.normal = shape.normals[t];
        one.height = dot(one.normal, origin - shape.vertices[corner[0]]);
        one.depth = (-1 / one.height) * Vec3{dot(one.normal, section.u), dot(one.normal, section.v), dot(one.normal, section.axis)};
        for (int i = 0; i < 3; ++i) one.seen.near[i] = static_cast<float>(one.depth[i]);
        for (int k = 0; k < 3; ++k) {
            const Vec3 side = cross(at[k], at[(k + 1) % 3]);
            const double per = 1 / std::max(std::fabs(side.x) + std::fabs(side.y) + std::fabs(side.z), 1e-300);
            for (int i = 0; i < 3; ++i) one.seen.sides[k][i] = static_cast<float>(per * side[i]);
        }
        one.number = t;
        one.seen.number = static_cast<int>(all.size());
        all.push_back(one);
    }
}

void Seen::cast(const RayPattern& pattern, bool whole, std::vector<RayHit>& hits) const {
    hits.clear();
    if (all.empty()) return;
    // in single precision: an error of 1e-7 changes the triangle of a ray on its side only, as the depth is computed again
    constexpr int SIZE = RayPattern::MOST + 2 * static_cast<int>(WIDEST_LANES);
    float nearest[SIZE] = {}, x[SIZE] = {}, y[SIZE] = {};
    int who[SIZE];
    std::fill_n(who, SIZE, -1);
    const auto [middle, half] = filled(0, whole);
    const auto [centre, height] = filled(1, whole);
    for (int k = 0; k < pattern.count; ++k) {
        x[k] = static_cast<float>(middle + half * pattern.x[k]);
        y[k] = static_cast<float>(centre + height * pattern.y[k]);
    }
    const auto cover = lane_kernels().cover;
    for (const Triangle& one : all)  // the outer side is towards the origin, so that the corners turn clockwise about the ray
        cover({x, y, nearest, who}, pattern.first_from((one.least - middle) / half),
              pattern.end_at((one.most - middle) / half), one.seen);
    for (int k = 0; k < pattern.count; ++k) {
        if (who[k] < 0 || !is_inside(x[k], y[k])) continue;
        const Triangle& one = all[who[k]];
        const Vec3 along = section.axis + static_cast<double>(x[k]) * section.u + static_cast<double>(y[k]) * section.v;
        const double length = norm(along), depth = one.depth.z + one.depth.x * x[k] + one.depth.y * y[k];
        const RayHit hit{length / depth, depth * one.height / length, along, one.normal, one.number, 1.0 / pattern.count};
        if (hit.cosine > 1e-3) hits.push_back(hit);
    }
}

}  // namespace tanteo
