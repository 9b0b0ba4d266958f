#include "factors/cone.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <mutex>
#include <numeric>

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

namespace {

using Polygon = std::vector<std::pair<double, double>>;

// The part of a convex polygon where a x + b y <= c.
Polygon below(const Polygon& all, double a, double b, double c) {
    Polygon out;
    for (size_t k = 0; k < all.size(); ++k) {
        const auto& [x, y] = all[k];
        const auto& [X, Y] = all[(k + 1) % all.size()];
        const double here = a * x + b * y - c, there = a * X + b * Y - c;
        if (here <= 0) out.push_back(all[k]);
        if ((here < 0) != (there < 0) && here != there) {
            const double t = here / (here - there);
            out.emplace_back(x + t * (X - x), y + t * (Y - y));
        }
    }
    return out;
}

}  // namespace

// Depths of two facets of one face that differ by less are one smooth surface, as fraction.
static constexpr double SMOOTH = 1e-3;
// Faces between two neighbouring rays that are followed at most.
static constexpr int MOST_FACES = 4;

// Where a path from inside of the unit disc or square leaves it.
static double leaves_at(double x, double y, double dx, double dy, bool round) {
    if (round) {
        const double A = dx * dx + dy * dy, B = x * dx + y * dy, C = x * x + y * y - 1;
        return (-B + std::sqrt(std::max(B * B - A * C, 0.0))) / A;
    }
    const double of_x = dx > 0 ? (1 - x) / dx : dx < 0 ? (-1 - x) / dx : 1, of_y = dy > 0 ? (1 - y) / dy : dy < 0 ? (-1 - y) / dy : 1;
    return std::min(of_x, of_y);
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
    Polygon domain;
    const int corners = round ? 48 : 4;
    for (int k = 0; k < corners; ++k) {
        const double turn = (k + 0.5) * 2 * PI / corners, reach = round ? 1.0 : std::sqrt(2.0);
        domain.emplace_back(reach * std::cos(turn), reach * std::sin(turn));
    }
    for (int i = 0; i < count; ++i) {
        Polygon cell = domain;
        const auto bisector = [&](int j) {
            const double a = places[j].first - places[i].first, b = places[j].second - places[i].second;
            return std::array<double, 3>{a, b, a * 0.5 * (places[i].first + places[j].first) +
                                                   b * 0.5 * (places[i].second + places[j].second)};
        };
        for (int j = 0; j < count; ++j) {
            const double far = std::max(std::fabs(places[j].first - places[i].first), std::fabs(places[j].second - places[i].second));
            if (j == i || far * far * count > 40) continue;  // beyond five spacings
            const auto [a, b, c] = bisector(j);
            cell = below(cell, a, b, c);
        }
        share[i] = 0;
        for (size_t k = 0; k < cell.size(); ++k) {
            const auto& [x0, y0] = cell[k];
            const auto& [x1, y1] = cell[(k + 1) % cell.size()];
            share[i] += 0.5 * (x0 * y1 - x1 * y0);
        }
        for (int j = i + 1; j < count; ++j) {
            const auto [a, b, c] = bisector(j);
            for (size_t k = 0; k < cell.size(); ++k) {
                const auto& [x0, y0] = cell[k];
                const auto& [x1, y1] = cell[(k + 1) % cell.size()];
                const double slack = 1e-9 * std::hypot(a, b);
                if (std::fabs(a * x0 + b * y0 - c) > slack || std::fabs(a * x1 + b * y1 - c) > slack) continue;
                const double size = std::hypot(x1 - x0, y1 - y0) / std::hypot(a, b);
                if (size > 0) sides.push_back({i, j, size * a, size * b, {0.5 * (x0 + x1), 0.5 * (y0 + y1)}});
            }
        }
    }
    const double per = count / std::accumulate(share, share + count, 0.0);
    for (int i = 0; i < count; ++i) share[i] *= per;
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
    : shape(shape), section(section) {
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
        if (!all.empty() && (shape.faces[t] != shape.faces[all[0].number] || dot(one.normal, all[0].normal) < 1 - 1e-12 ||
                             std::fabs(one.height - all[0].height) > 1e-9 * all[0].height))
            one_plane = false;
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
        RayHit hit = hit_at(who[k], x[k], y[k]);
        hit.ray = k;
        hit.share = pattern.share[k];
        if (hit.cosine > 1e-3) hits.push_back(hit);
    }
}

RayHit Seen::hit_at(int row, double x, double y) const {
    const Triangle& one = all[row];
    const Vec3 along = section.axis + x * section.u + y * section.v;
    const double length = norm(along), depth = depth_at(row, x, y);
    return {length / depth, depth * one.height / length, x, y, along, one.normal, one.number, row, -1};
}

// Follows a face from triangle to triangle until it ends, turns away from the origin or comes to another triangle, or the
// path ends.
Seen::End Seen::end_along(const Path& path, int row, const Walk& walk, int other) const {
    constexpr int MOST_STEPS = 32;
    End end{row, -1, 1, 0, 0};
    for (int k = 0; k < MOST_STEPS; ++k) {
        const Triangle& own = all[end.row];
        int through = -1;
        double above = 1, below = 1;  // the place is their ratio
        for (int i = 0; i < 3; ++i) {
            const float* side = own.seen.sides[i];
            const double a = side[0], b = side[1], rate = a * path.dx + b * path.dy;
            if (!(rate > 0)) continue;
            const double inside = -(side[2] + a * path.x + b * path.y);
            if (inside * below < above * rate) through = i, above = inside, below = rate;
        }
        end.at = above / below;
        end.x = end.y = 0;
        if (through < 0) break;
        end.x = own.seen.sides[through][0], end.y = own.seen.sides[through][1];
        const int beyond = walk.beyond[3 * own.number + through], next = beyond < 0 ? -1 : walk.rows[beyond];
        end.next = next < 0 ? -1 : beyond;
        if (next < 0 || next == other || shape.faces[beyond] != shape.faces[own.number]) break;
        end.row = next;
    }
    return end;
}

// An outline crosses the strip of the common side of two cells. The area between both is N.n (p - m).n, where N is the normal
// of the side times its length, m its middle, p a place of the outline, and n its unit normal. These areas of all neighbours
// of a ray add up to its cell as the outline passes the ray.
void Seen::add_outlines(const RayPattern& pattern, bool whole, bool with_slope, std::vector<RayHit>& hits,
                        std::vector<Outline>& outlines) const {
    outlines.clear();
    if (one_plane && static_cast<int>(hits.size()) == pattern.count) return;
    thread_local std::vector<int> rows;  // of each triangle of the shape among all; -1 except during this call
    rows.resize(std::max(rows.size(), shape.faces.size()), -1);
    for (size_t k = 0; k < all.size(); ++k) rows[all[k].number] = static_cast<int>(k);
    const Walk walk{rows.data(), shape.neighbours().data()};
    int hit_of[RayPattern::MOST];
    std::fill_n(hit_of, pattern.count, -1);
    for (size_t k = 0; k < hits.size(); ++k) hit_of[hits[k].ray] = static_cast<int>(k);
    const auto [middle, half] = filled(0, whole);
    const auto [centre, height] = filled(1, whole);
    const auto [across, up] = section.duals();
    const double per_area = pattern.count / (pattern.area() * half * height);
    for (const RayPattern::Side& side : pattern.sides) {
        int i = hit_of[side.i], j = hit_of[side.j];
        if (i < 0 && j < 0) continue;
        int from = side.i, to = side.j;
        if (i < 0) std::swap(i, j), std::swap(from, to);
        const int a = hits[i].row, b = j < 0 ? -1 : hits[j].row;
        if (j >= 0) {
            if (a == b) continue;
            const Triangle &one = all[a], &two = all[b];
            if (dot(one.normal, two.normal) > 1 - 1e-12 && std::fabs(one.height - two.height) < 1e-9 * one.height) continue;
        }
        const Path path{middle + half * pattern.x[from], centre + height * pattern.y[from],
                        half * (static_cast<double>(pattern.x[to]) - pattern.x[from]),
                        height * (static_cast<double>(pattern.y[to]) - pattern.y[from])};
        const Path back{path.x + path.dx, path.y + path.dy, -path.dx, -path.dy};
        if (j >= 0 && shape.faces[all[a].number] == shape.faces[all[b].number]) {  // facets of a curved surface
            const double x = path.x + 0.5 * path.dx, y = path.y + 0.5 * path.dy, here = depth_at(a, x, y);
            if (std::fabs(here - depth_at(b, x, y)) < SMOOTH * here) continue;
        }
        const double turn = from == side.i ? per_area : -per_area;
        // adds the outline at a place of the path between two triangles, whose normal is (ex, ey)
        const auto add = [&](int own, int hidden, double at, double ex, double ey, bool moves) {
            double size = std::sqrt(ex * ex + ey * ey);
            if (path.dx * ex + path.dy * ey < 0) size = -size;
            const double nx = ex / size, ny = ey / size;
            const double strip = turn * (side.x * height * nx + side.y * half * ny);
            const double x = path.x + at * path.dx, y = path.y + at * path.dy;
            const double area = strip * ((x - middle - half * side.middle[0]) * nx + (y - centre - height * side.middle[1]) * ny);
            Outline outline;
            double nearest = 0;
            for (int k = 0; k < 2; ++k) {
                const int row = k ? hidden : own;
                if (row < 0) continue;
                RayHit hit = hit_at(row, x, y);
                if (!(hit.cosine > 1e-3) || !(hit.range > 0)) continue;
                hit.share = k ? -area : area;
                nearest = nearest > 0 ? std::min(nearest, hit.range) : hit.range;
                outline.sides[k] = static_cast<int>(hits.size());
                hits.push_back(hit);
            }
            if (!with_slope || !moves || !(nearest > 0)) return;
            // the outline moves with the nearer surface
            const double inward = nx * x + ny * y;
            const Vec3 normal = nx * across + ny * up, off = x * section.u + y * section.v;
            const double length = norm(section.axis + off);
            outline.by_origin = (-strip * length / nearest) * (normal - inward * section.axis);
            outline.by_axis = -strip * (normal + inward * off);
            outlines.push_back(outline);
        };
        const int last = j < 0 ? -1 : shape.faces[all[b].number];
        const bool leaves = j < 0 && !is_inside(back.x, back.y);  // the beam may end before the surface
        const double beam = leaves ? leaves_at(path.x, path.y, path.dx, path.dy, section.round) : 1;
        // follows the surfaces to the one of the other ray, or to the end of all
        End end{a, -1, 1, 0, 0};
        for (int k = 0; k < MOST_FACES; ++k) {
            end = end_along(path, end.row, walk, b);
            if (end.at >= beam || end.next < 0) break;
            const bool arrived = shape.faces[end.next] == last;
            const int next = arrived ? b : walk.rows[end.next];
            add(end.row, next, end.at, end.x, end.y, true);
            end = {next, end.next, end.at, 0, 0};
            if (arrived) break;
        }
        if (end.row == b) continue;
        const bool ends = end.at < beam && (end.x != 0 || end.y != 0);
        if (leaves && !ends) {
            const double x = path.x + beam * path.dx, y = path.y + beam * path.dy;
            const bool sideways = std::fabs(x) > std::fabs(y);
            add(end.row, -1, beam, section.round || sideways ? x : 0, section.round || !sideways ? y : 0, false);
        } else if (j < 0) {
            if (ends) add(end.row, -1, end.at, end.x, end.y, true);
        } else {  // one surface hides the other
            const End other = end_along(back, b, walk, a);
            const double x = path.x + end.at * path.dx, y = path.y + end.at * path.dy;
            const bool second = other.x != 0 || other.y != 0;
            if (ends && !(second && depth_at(end.row, x, y) < depth_at(b, x, y))) add(end.row, b, end.at, end.x, end.y, true);
            else if (second) add(end.row, other.row, std::clamp(1 - other.at, 0.0, 1.0), other.x, other.y, true);
        }
    }
    for (const Triangle& one : all) rows[one.number] = -1;
}

}  // namespace tanteo
