#include "shape.hpp"

#include <cmath>
#include <map>
#include <stdexcept>
#include <tuple>
#include <unordered_map>

#include "normal.hpp"

namespace tanteo {

Profile::At Profile::at(const Vec3& p, bool with_bends) const {
    const Vec3 away = p - point;
    const double height = dot(away, axis);
    const Vec3 across = away - height * axis;
    const double rho = norm(across);
    const Vec3 out = rho > 1e-12 ? (1 / rho) * across : any_across(axis);
    At at;
    double by_out, by_axis, tube = 0;
    if (radius == 0) {
        by_out = std::cos(slope);
        by_axis = -std::sin(slope);
        at.distance = sign * ((rho - offset) * by_out + height * by_axis);
    } else {
        const double beyond = rho - offset;
        tube = std::max(std::hypot(beyond, height), 1e-300);
        by_out = beyond / tube;
        by_axis = height / tube;
        at.distance = sign * (tube - radius);
    }
    at.normal = sign * (by_out * out + by_axis * axis);
    if (with_bends) {
        at.e[0] = cross(axis, out);
        at.e[1] = cross(at.normal, at.e[0]);
        at.bend[0] = rho > 1e-12 ? sign * by_out / rho : 0;
        at.bend[1] = radius > 0 ? sign / tube : 0;
    }
    return at;
}

double point_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c, Vec3& q) {  // Ericson, 5.1.5
    const Vec3 ab = b - a, ac = c - a, ap = p - a;
    const double d1 = dot(ab, ap), d2 = dot(ac, ap);
    double v = 0, w = 0;
    if (d1 <= 0 && d2 <= 0) {
    } else {
        const Vec3 bp = p - b, cp = p - c;
        const double d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp), d6 = dot(ac, cp);
        const double va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
        if (d3 >= 0 && d4 <= d3) {
            v = 1;
        } else if (vc <= 0 && d1 >= 0 && d3 <= 0) {
            v = d1 > 0 ? d1 / (d1 - d3) : 0;
        } else if (d6 >= 0 && d5 <= d6) {
            w = 1;
        } else if (vb <= 0 && d2 >= 0 && d6 <= 0) {
            w = d2 > 0 ? d2 / (d2 - d6) : 0;
        } else if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
            w = d4 > d3 ? (d4 - d3) / ((d4 - d3) + (d5 - d6)) : 0;
            v = 1 - w;
        } else {  // the sum is twice the area, squared
            const double scale = 1 / (va + vb + vc);
            v = vb * scale;
            w = vc * scale;
        }
    }
    q = a + v * ab + w * ac;
    return squared(p - q);
}

Shape::Shape(std::vector<Vec3> vertices_, std::vector<int> triangles_, std::vector<int> faces_,
             std::vector<int> profile_rows, std::vector<Profile> profiles_, std::vector<Segment> edges_,
             std::vector<Vec3> corners_, const Vec3& centre_)
    : vertices(std::move(vertices_)), triangles(std::move(triangles_)), faces(std::move(faces_)),
      profiles(std::move(profiles_)), edges(std::move(edges_)), corners(std::move(corners_)), centre(centre_) {
    const int T = static_cast<int>(faces.size());
    Box all;
    std::vector<Box> boxes(T);
    normals.resize(T);
    for (int t = 0; t < T; ++t) {
        const Vec3 &a = vertices[triangles[3 * t]], &b = vertices[triangles[3 * t + 1]],
                   &c = vertices[triangles[3 * t + 2]];
        for (const Vec3* p : {&a, &b, &c}) boxes[t].add(*p);
        all.add(boxes[t]);
        const Vec3 n = cross(b - a, c - a);
        normals[t] = unit(n);
        const double own = 0.5 * norm(n);
        area += own;
        if (faces[t] >= static_cast<int>(face_area.size())) face_area.resize(faces[t] + 1, 0.0);
        face_area[faces[t]] += own;
    }
    diagonal = T ? norm(all.hi - all.lo) : 0;
    if (!(area > 0) || !std::isfinite(area * diagonal))
        throw std::invalid_argument("triangles: expected some with an area, got none, or too large a one.");
    for (const Segment& e : edges) edge_length += e.length;
    triangle_tree.build(boxes);
    make_flats(profile_rows);
    if (flats.empty()) throw std::invalid_argument("triangles: expected some that are no slivers, got none.");
    make_outlines();
    make_convex_edges();
}

void Shape::make_flats(const std::vector<int>& profile_rows) {
    const int T = static_cast<int>(faces.size());
    using Key = std::tuple<int, int64_t, int64_t, int64_t, int64_t>;
    std::map<Key, int> known;
    flat_of.assign(T, -1);
    const double fine = 1e-7 * diagonal;
    for (int t = 0; t < T; ++t) {
        const Vec3 &a = vertices[triangles[3 * t]], &b = vertices[triangles[3 * t + 1]],
                   &c = vertices[triangles[3 * t + 2]];
        const double own = 0.5 * norm(cross(b - a, c - a));
        if (!(own > 1e-14 * diagonal * diagonal)) continue;  // a sliver has no normal, and nothing is on it
        const Vec3& n = normals[t];
        const double offset = dot(n, a);
        const Key key{faces[t], std::llround(1e5 * n.x), std::llround(1e5 * n.y), std::llround(1e5 * n.z),
                      std::llround(offset / (10 * fine))};
        const auto [at, is_new] = known.try_emplace(key, static_cast<int>(flats.size()));
        if (is_new) {
            Flat flat;
            flat.normal = n;
            flat.origin = a;
            flat.offset = offset;
            flat.u = any_across(n);
            flat.v = cross(n, flat.u);
            flat.face = faces[t];
            flat.profile = profile_rows[t];
            flats.push_back(std::move(flat));
        }
        flat_of[t] = at->second;
        flats[at->second].area += own;
    }
    for (int t = 0; t < T; ++t) {
        if (flat_of[t] < 0 || profile_rows[t] < 0) continue;
        const Vec3 middle = (1.0 / 3) * (vertices[triangles[3 * t]] + vertices[triangles[3 * t + 1]] +
                                         vertices[triangles[3 * t + 2]]);
        const double off = std::fabs(profiles[profile_rows[t]].at(middle, false).distance);
        sagitta = std::max(sagitta, std::min(1.1 * off, 0.05 * diagonal));
    }
}

void Shape::make_outlines() {
    std::map<std::tuple<int, int, int>, int> directed;  // flat, from, to: how often
    const int T = static_cast<int>(faces.size());
    std::vector<Box> boxes(flats.size());
    for (int t = 0; t < T; ++t) {
        const int f = flat_of[t];
        if (f < 0) continue;
        for (int j = 0; j < 3; ++j) {
            const int a = triangles[3 * t + j], b = triangles[3 * t + (j + 1) % 3];
            boxes[f].add(vertices[a]);
            const auto back = directed.find({f, b, a});
            if (back != directed.end() && back->second > 0)
                --back->second;
            else
                ++directed[{f, a, b}];
        }
    }
    for (const auto& [key, count] : directed) {
        Flat& flat = flats[std::get<0>(key)];
        const Vec3 a = vertices[std::get<1>(key)] - flat.origin, b = vertices[std::get<2>(key)] - flat.origin;
        OutlineEdge e{dot(a, flat.u), dot(a, flat.v), 0, 0, 0, 0};
        const double dx = dot(b, flat.u) - e.x, dy = dot(b, flat.v) - e.y;
        e.length = std::hypot(dx, dy);
        if (!(e.length > 0)) continue;
        e.dx = dx / e.length;
        e.dy = dy / e.length;
        for (int k = 0; k < count; ++k) flat.outline.push_back(e);
        for (const double x : {e.x, e.x + dx}) flat.lo[0] = std::min(flat.lo[0], x), flat.hi[0] = std::max(flat.hi[0], x);
        for (const double y : {e.y, e.y + dy}) flat.lo[1] = std::min(flat.lo[1], y), flat.hi[1] = std::max(flat.hi[1], y);
    }
    for (Flat& flat : flats) {
        const int n = std::max(1, static_cast<int>(flat.outline.size()) / 8);
        flat.bins.resize(n);
        flat.bin_lo = flat.lo[1];
        flat.bin_step = std::max((flat.hi[1] - flat.lo[1]) / n, 1e-300);
        for (int k = 0; k < static_cast<int>(flat.outline.size()); ++k) {
            OutlineEdge& e = flat.outline[k];
            const double y1 = e.y + e.dy * e.length;
            const auto bin = [&](double y) {
                return static_cast<int>(std::clamp((y - flat.bin_lo) / flat.bin_step, 0.0, n - 1.0));
            };
            e.first_bin = bin(std::min(e.y, y1));
            for (int b = e.first_bin; b <= bin(std::max(e.y, y1)); ++b) flat.bins[b].push_back(k);
        }
    }
    flat_tree.build(boxes);
}

void Shape::make_convex_edges() {
    std::map<std::pair<int, int>, int> owner;  // from, to: triangle
    const int T = static_cast<int>(faces.size());
    for (int t = 0; t < T; ++t)
        for (int j = 0; j < 3; ++j) owner[{triangles[3 * t + j], triangles[3 * t + (j + 1) % 3]}] = t;
    std::vector<Box> boxes;
    for (const auto& [key, t] : owner) {
        if (key.first > key.second) continue;
        const auto back = owner.find({key.second, key.first});
        if (back == owner.end()) continue;
        const int s = back->second;
        if (flat_of[t] < 0 || flat_of[s] < 0 || flat_of[t] == flat_of[s]) continue;
        const Vec3 a = vertices[key.first], b = vertices[key.second], d = unit(b - a);
        // with the first triangle on the left of the edge, a convex one turns down to the second
        if (dot(cross(normals[t], normals[s]), d) <= 1e-3) continue;
        ConvexEdge e{a, d, {normals[t], normals[s]}, {cross(normals[t], d), cross(d, normals[s])}, norm(b - a), faces[t]};
        Box box;
        box.add(a);
        box.add(b);
        boxes.push_back(box);
        convex_edges.push_back(e);
    }
    edge_tree.build(boxes);
}

Closest Shape::closest(const Vec3& p, int guess) const {
    Closest best;
    const auto look = [&](int t, double limit) {
        Vec3 q;
        const double d2 = point_triangle(p, vertices[triangles[3 * t]], vertices[triangles[3 * t + 1]],
                                         vertices[triangles[3 * t + 2]], q);
        if (d2 < limit) {
            best.squared = d2;
            best.point = q;
            best.triangle = t;
        }
        return d2;
    };
    look(guess, 1e300);
    triangle_tree.closest(p, best.squared, look);
    return best;
}

Closest Shape::closest(const Vec3& p) const {
    const Cell cell = cell_of(p);
    const size_t row = grid_shape[2], plane = row * grid_shape[1];
    const size_t near = (cell.f[0] > 0.5) * plane + (cell.f[1] > 0.5) * row + (cell.f[2] > 0.5);
    return closest(p, grid_triangle[cell.node + near]);
}

double Shape::cast(const Vec3& origin, const Vec3& direction, double reach, int* triangle) const {
    int which = -1;
    const double far = triangle_tree.cast(origin, direction, reach, [&](int t, double nearest) {
        const Vec3 &a = vertices[triangles[3 * t]], &b = vertices[triangles[3 * t + 1]],
                   &c = vertices[triangles[3 * t + 2]];
        const Vec3 e1 = b - a, e2 = c - a, h = cross(direction, e2);  // Moeller and Trumbore 1997
        const double det = dot(e1, h);
        if (std::fabs(det) < 1e-300) return 1e300;
        const Vec3 s = origin - a;
        const double u = dot(s, h) / det, slack = 1e-9;
        if (u < -slack || u > 1 + slack) return 1e300;
        const Vec3 q = cross(s, e1);
        const double v = dot(direction, q) / det;
        if (v < -slack || u + v > 1 + slack) return 1e300;
        const double along = dot(e2, q) / det;
        if (along <= 0 || along >= nearest) return 1e300;
        which = t;
        return along;
    });
    if (triangle) *triangle = which;
    return which < 0 ? 1e300 : far;
}

void Shape::build_grid(int cells) {
    Box all;
    for (const Vec3& p : vertices) all.add(p);
    const Vec3 size = all.hi - all.lo;
    const double pad = 0.12 * diagonal;
    grid_step = (std::max({size.x, size.y, size.z}) + 2 * pad) / cells;
    for (int k = 0; k < 3; ++k) {
        grid_origin[k] = all.lo[k] - pad;
        grid_shape[k] = static_cast<int>(std::ceil((size[k] + 2 * pad) / grid_step)) + 1;
    }
    const size_t count = static_cast<size_t>(grid_shape[0]) * grid_shape[1] * grid_shape[2];
    grid.resize(count);
    grid_triangle.resize(count);
    size_t at = 0;
    int guess = 0;
    for (int i = 0; i < grid_shape[0]; ++i)
        for (int j = 0; j < grid_shape[1]; ++j)
            for (int k = 0; k < grid_shape[2]; ++k, ++at) {
                const Closest c = closest(grid_origin + grid_step * Vec3{double(i), double(j), double(k)}, guess);
                grid[at] = static_cast<float>(std::sqrt(c.squared));
                guess = grid_triangle[at] = c.triangle;
            }
}

Shape::Cell Shape::cell_of(const Vec3& p) const {
    Cell cell{0, {0, 0, 0}, 0};
    for (int k = 0; k < 3; ++k) {
        const double l = (p[k] - grid_origin[k]) / grid_step;
        const double m = l > 0 ? std::min(l, grid_shape[k] - 1.001) : 0.0;  // 0 also for what is no number
        const int i = static_cast<int>(m);
        cell.away += (l - m) * (l - m);
        cell.f[k] = m - i;
        cell.node = cell.node * grid_shape[k] + i;
    }
    return cell;
}

double Shape::field(const Vec3& p, int* flat) const {
    const Cell cell = cell_of(p);
    const double* f = cell.f;
    const size_t row = grid_shape[2], plane = row * grid_shape[1];
    const float* g = &grid[cell.node];
    const double x0 = g[0] + (g[1] - g[0]) * f[2], x1 = g[row] + (g[row + 1] - g[row]) * f[2];
    const double x2 = g[plane] + (g[plane + 1] - g[plane]) * f[2];
    const double x3 = g[plane + row] + (g[plane + row + 1] - g[plane + row]) * f[2];
    if (flat)
        *flat = std::max(0, flat_of[grid_triangle[cell.node + (f[0] > 0.5) * plane + (f[1] > 0.5) * row + (f[2] > 0.5)]]);
    const double y0 = x0 + (x1 - x0) * f[1], y1 = x2 + (x3 - x2) * f[1], d = y0 + (y1 - y0) * f[0];
    return cell.away > 0 ? d + grid_step * std::sqrt(cell.away) : d;
}

}  // namespace tanteo
