#include "factors/cone.hpp"

#include <cmath>

namespace tanteo {

namespace {

// Whether a sphere may touch the cone: its centre is at most radius from the cone's surface.
bool may_touch(const Cone& cone, double sine, double cosine, const Vec3& centre, double radius) {
    const Vec3 w = centre - cone.origin;
    const double along = dot(w, cone.axis), across = std::sqrt(std::max(squared(w) - along * along, 0.0));
    if (across * cosine - along * sine <= radius) return along > -radius;  // near its side or inside
    return false;
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
    if (shape.cast(cone.origin, ray, 1e299, &first) < 1e299 && dot(shape.normals[first], ray) > 0) found.clear();
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

Seen::Seen(const Shape& shape, const std::vector<int>& triangles, const Cone& cone, const Vec3& u, const Vec3& v)
    : cone(cone), u(u), v(v) {
    const double slope = std::tan(cone.half_angle);
    all.reserve(triangles.size());
    for (const int t : triangles) {
        const int* corner = &shape.triangles[3 * static_cast<size_t>(t)];
        Vec3 at[3];
        for (int k = 0; k < 3; ++k) at[k] = shape.vertices[corner[k]] - cone.origin;
        Triangle one;
        bool beyond = false;
        for (int i = 0; i < 2; ++i) one.least[i] = 1e300, one.most[i] = -1e300;
        for (const Vec3& corner_at : at) {
            const double ahead = dot(corner_at, cone.axis);
            beyond |= ahead <= 0;
            const double across[2] = {dot(corner_at, u) / ahead, dot(corner_at, v) / ahead};
            for (int i = 0; i < 2; ++i) {
                one.least[i] = std::min(one.least[i], across[i]);
                one.most[i] = std::max(one.most[i], across[i]);
            }
        }
        if (beyond) {
            for (int i = 0; i < 2; ++i) one.least[i] = -1e300, one.most[i] = 1e300;
        } else if (one.least[0] > slope || one.most[0] < -slope || one.least[1] > slope || one.most[1] < -slope) {
            continue;
        }
        one.normal = shape.normals[t];
        one.height = -dot(one.normal, at[0]);
        for (int k = 0; k < 3; ++k) one.sides[k] = cross(at[k], at[(k + 1) % 3]);
        one.number = t;
        if (!all.empty() && (shape.faces[t] != shape.faces[all[0].number] || dot(one.normal, all[0].normal) < 1 - 1e-12 ||
                             std::fabs(one.height - all[0].height) > 1e-9 * all[0].height))
            one_plane = false;
        all.push_back(one);
    }
}

ConeEcho Seen::echo(double a, double b) const {
    ConeEcho echo;
    const Vec3 ray = unit(cone.axis + a * u + b * v);
    const Triangle* hit = nullptr;
    for (const Triangle& one : all) {
        if (a < one.least[0] || a > one.most[0] || b < one.least[1] || b > one.most[1]) continue;
        // the outer side is towards the origin, so that the corners turn clockwise about the ray
        if (dot(one.sides[0], ray) > 0 || dot(one.sides[1], ray) > 0 || dot(one.sides[2], ray) > 0) continue;
        const double cosine = -dot(one.normal, ray);
        if (!(cosine > 0) || one.height >= echo.range * cosine) continue;
        echo.range = one.height / cosine;
        hit = &one;
    }
    if (!hit) return {};
    const Vec3& n = hit->normal;
    echo.cosine = -dot(n, ray);
    if (!(echo.cosine > std::max(cone.least_cosine, 1e-3))) return {};
    echo.triangle = hit->number;
    echo.ray = ray;
    // range = height / cosine, and a turn of the axis turns the ray with it
    echo.by_origin = (1 / echo.cosine) * n;
    echo.by_axis = (echo.range / echo.cosine) * (dot(cone.axis, ray) * n - dot(n, cone.axis) * ray);
    return echo;
}

}  // namespace tanteo
