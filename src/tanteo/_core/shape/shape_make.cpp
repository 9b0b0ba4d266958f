// Construction of a shape from a mesh: flats with outlines, convex edges, the grid of distances.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <tuple>

#include "normal.hpp"
#include "shape/shape.hpp"

namespace tanteo {

constexpr double FLAT_COSINE = 0.9999;  // least cosine between the flats of a planar face

Shape::Shape(Solid solid, int cells)
    : vertices(std::move(solid.vertices)), triangles(std::move(solid.triangles)), faces(std::move(solid.faces)),
      profiles(std::move(solid.profiles)), edges(std::move(solid.edges)), axes(std::move(solid.axes)),
      corners(std::move(solid.corners)),
      hull(std::move(solid.hull)), samples(std::move(solid.samples)), sample_normals(std::move(solid.sample_normals)) {
    centre = solid.centre;
    const int T = static_cast<int>(faces.size());
    Box all;
    std::vector<Box> boxes(T);
    std::vector<Vec3> across(T);
    std::vector<double> areas;
    for (int t = 0; t < T; ++t) {
        const Vec3 &a = vertices[triangles[3 * t]], &b = vertices[triangles[3 * t + 1]],
                   &c = vertices[triangles[3 * t + 2]];
        for (const Vec3* p : {&a, &b, &c}) boxes[t].add(*p);
        all.add(boxes[t]);
        const Vec3 n = cross(b - a, c - a);
        across[t] = unit(n);
        const double own = 0.5 * norm(n);
        area += own;
        if (faces[t] >= static_cast<int>(areas.size())) areas.resize(faces[t] + 1, 0.0);
        areas[faces[t]] += own;
    }
    diagonal = T ? norm(all.hi - all.lo) : 0;
    if (!(area > 0) || !std::isfinite(area * diagonal))
        throw std::invalid_argument("triangles: expected a positive finite area, got zero or infinity.");
    if (!solid.areas.empty()) {
        if (solid.areas.size() < areas.size())
            throw std::invalid_argument("areas: expected one for each face, got too few.");
        areas = std::move(solid.areas);
        area = std::accumulate(areas.begin(), areas.end(), 0.0);
    }
    normals = std::move(across);
    face_area = std::move(areas);
    for (const Segment& e : edges) edge_length += e.length;
    triangle_tree.build(boxes);
    std::vector<Flat> made;
    make_flats(solid.profile_rows, made);
    if (made.empty()) throw std::invalid_argument("triangles: expected at least one that is no sliver, got none.");
    std::vector<int> round(face_area.size(), 0);
    std::vector<const Flat*> first(round.size(), nullptr);
    for (const Flat& flat : made) {
        if (!first[flat.face]) first[flat.face] = &flat;
        if (dot(flat.normal, first[flat.face]->normal) < FLAT_COSINE || flat.profile >= 0) round[flat.face] = 1;
    }
    face_round = std::move(round);
    make_outlines(made);
    flats = std::move(made);
    make_places();
    make_convex_edges();
    make_grid(cells);
}

void Shape::make_flats(const std::vector<int>& profile_rows, std::vector<Flat>& made) {
    const int T = static_cast<int>(faces.size());
    using Key = std::tuple<int, int64_t, int64_t, int64_t, int64_t, int>;  // face, normal, offset, triangle
    std::vector<Key> keys;
    std::vector<double> areas(T, 0.0);
    const double fine = 1e-7 * diagonal;
    for (int t = 0; t < T; ++t) {
        const Vec3 &a = vertices[triangles[3 * t]], &b = vertices[triangles[3 * t + 1]],
                   &c = vertices[triangles[3 * t + 2]];
        const double own = 0.5 * norm(cross(b - a, c - a));
        if (!(own > 1e-14 * diagonal * diagonal)) continue;  // a sliver has no reliable normal and no area
        const Vec3& n = normals[t];
        areas[t] = own;
        keys.emplace_back(faces[t], std::llround(1e5 * n.x), std::llround(1e5 * n.y), std::llround(1e5 * n.z),
                          std::llround(dot(n, a) / (10 * fine)), t);
    }
    std::sort(keys.begin(), keys.end());
    std::vector<int> first(T, -1), owner(T, -1);  // first triangle of the flat of each triangle; flat of each triangle
    const auto plane = [](const Key& k) {
        return std::tie(std::get<0>(k), std::get<1>(k), std::get<2>(k), std::get<3>(k), std::get<4>(k));
    };
    for (size_t k = 0; k < keys.size(); ++k) {
        const int t = std::get<5>(keys[k]);
        first[t] = k && plane(keys[k]) == plane(keys[k - 1]) ? first[std::get<5>(keys[k - 1])] : t;
    }
    std::vector<Key>().swap(keys);
    for (int t = 0; t < T; ++t) {
        if (first[t] < 0) continue;
        if (first[t] == t) {
            Flat flat;
            flat.normal = normals[t];
            flat.origin = vertices[triangles[3 * t]];
            flat.offset = dot(flat.normal, flat.origin);
            flat.u = any_across(flat.normal);
            flat.v = cross(flat.normal, flat.u);
            flat.face = faces[t];
            flat.profile = profile_rows[t];
            owner[t] = static_cast<int>(made.size());
            made.push_back(std::move(flat));
        }
        owner[t] = owner[first[t]];
        made[owner[t]].area += areas[t];
    }
    for (int t = 0; t < T; ++t) {
        if (owner[t] < 0 || profile_rows[t] < 0) continue;
        const Vec3 middle = (1.0 / 3) * (vertices[triangles[3 * t]] + vertices[triangles[3 * t + 1]] +
                                         vertices[triangles[3 * t + 2]]);
        const double off = std::fabs(profiles[profile_rows[t]].at(middle, false).distance);
        Flat& flat = made[owner[t]];
        flat.sagitta = std::max(flat.sagitta, std::min(1.1 * off, 0.05 * diagonal));
    }
    flat_of = std::move(owner);
}

void Shape::make_outlines(std::vector<Flat>& made) {
    const int T = static_cast<int>(faces.size());
    struct Side {  // of a triangle, in the direction from vertex to vertex
        int flat, from, to, order, count;
    };
    std::vector<Side> sides;
    std::vector<Box> boxes(made.size());
    for (int t = 0; t < T; ++t) {
        const int f = flat_of[t];
        if (f < 0) continue;
        for (int j = 0; j < 3; ++j) {
            const int a = triangles[3 * t + j], b = triangles[3 * t + (j + 1) % 3];
            boxes[f].add(vertices[a]);
            sides.push_back({f, a, b, static_cast<int>(sides.size()), 1});
        }
    }
    std::sort(sides.begin(), sides.end(), [](const Side& p, const Side& q) {
        return std::make_tuple(p.flat, std::min(p.from, p.to), std::max(p.from, p.to), p.order) <
               std::make_tuple(q.flat, std::min(q.from, q.to), std::max(q.from, q.to), q.order);
    });
    std::vector<Side> outline;  // each direction once: a side cancels one of the opposite direction
    for (size_t k = 0; k < sides.size();) {
        const Side& one = sides[k];
        int counts[2] = {0, 0};
        bool occurs[2] = {false, false};
        for (; k < sides.size() && sides[k].flat == one.flat && std::min(sides[k].from, sides[k].to) == std::min(one.from, one.to) &&
               std::max(sides[k].from, sides[k].to) == std::max(one.from, one.to); ++k) {
            const bool turned = sides[k].from != one.from;
            if (counts[!turned] > 0)
                --counts[!turned];
            else
                ++counts[turned], occurs[turned] = true;
        }
        for (int turned = 0; turned < 2; ++turned)
            if (occurs[turned])
                outline.push_back({one.flat, turned ? one.to : one.from, turned ? one.from : one.to, 0, counts[turned]});
    }
    std::vector<Side>().swap(sides);
    std::sort(outline.begin(), outline.end(), [](const Side& p, const Side& q) {
        return std::tie(p.flat, p.from, p.to) < std::tie(q.flat, q.from, q.to);
    });
    for (size_t f = 0; f < made.size(); ++f) {
        const double s = made[f].sagitta;
        boxes[f].lo = boxes[f].lo - Vec3{s, s, s};
        boxes[f].hi = boxes[f].hi + Vec3{s, s, s};
    }
    std::vector<OutlineEdge> lines;
    for (const Side& side : outline) {  // flat by flat
        Flat& flat = made[side.flat];
        const Vec3 a = vertices[side.from] - flat.origin, b = vertices[side.to] - flat.origin;
        OutlineEdge e{dot(a, flat.u), dot(a, flat.v), 0, 0, 0, 0};
        const double dx = dot(b, flat.u) - e.x, dy = dot(b, flat.v) - e.y;
        e.length = std::hypot(dx, dy);
        if (!(e.length > 0)) continue;
        e.dx = dx / e.length;
        e.dy = dy / e.length;
        if (!flat.edges) flat.first_edge = static_cast<int>(lines.size());
        flat.edges += side.count;
        lines.insert(lines.end(), side.count, e);
        for (const double x : {e.x, e.x + dx}) flat.lo[0] = std::min(flat.lo[0], x), flat.hi[0] = std::max(flat.hi[0], x);
        for (const double y : {e.y, e.y + dy}) flat.lo[1] = std::min(flat.lo[1], y), flat.hi[1] = std::max(flat.hi[1], y);
    }
    make_bins(made, lines);
    outlines = std::move(lines);
    flat_tree.build(boxes);
}

void Shape::make_bins(std::vector<Flat>& made, std::vector<OutlineEdge>& lines) {
    std::vector<int> start, entries;
    for (Flat& flat : made) {
        const int n = std::max(1, flat.edges / 8);
        std::vector<std::vector<int>> bins(n);
        flat.bin_lo = flat.lo[1];
        flat.bin_step = std::max((flat.hi[1] - flat.lo[1]) / n, 1e-300);
        for (int k = 0; k < flat.edges; ++k) {
            OutlineEdge& e = lines[flat.first_edge + k];
            const double y1 = e.y + e.dy * e.length;
            const auto bin = [&](double y) {
                return static_cast<int>(std::clamp((y - flat.bin_lo) / flat.bin_step, 0.0, n - 1.0));
            };
            e.first_bin = bin(std::min(e.y, y1));
            for (int b = e.first_bin; b <= bin(std::max(e.y, y1)); ++b) bins[b].push_back(k);
        }
        flat.first_bin = static_cast<int>(start.size());
        flat.bins = n;
        for (const std::vector<int>& bin : bins) {
            start.push_back(static_cast<int>(entries.size()));
            entries.insert(entries.end(), bin.begin(), bin.end());
        }
        start.push_back(static_cast<int>(entries.size()));
    }
    bin_start = std::move(start);
    bin_edges = std::move(entries);
}

// Moments by area about the centre: those of flats from their triangles, those of nodes from their children.
void Shape::make_places() {
    const size_t F = flats.size();
    std::vector<Place> made(F + flat_tree.nodes.size());
    const auto add = [](Place& to, double area, const Vec3& sum, const Vec3& normals, const Mat3& squares) {
        to.area += area;
        to.middle += sum;
        to.normal += normals;
        for (int i = 0; i < 9; ++i) to.spread.m[i] += squares.m[i];
    };
    for (size_t t = 0; t < faces.size(); ++t) {
        if (flat_of[t] < 0) continue;
        const Vec3 a = vertices[triangles[3 * t]] - centre, b = vertices[triangles[3 * t + 1]] - centre,
                   c = vertices[triangles[3 * t + 2]] - centre, sum = a + b + c;
        const double area = 0.5 * norm(cross(b - a, c - a));
        Mat3 squares;
        for (const Vec3* x : {&a, &b, &c, &sum}) add_outer(squares, area / 12, *x, *x);
        add(made[flat_of[t]], area, (area / 3) * sum, area * normals[t], squares);
    }
    for (size_t f = 0; f < F; ++f) {
        made[f].face = flats[f].face;
        made[f].size = std::max(flats[f].hi[0] - flats[f].lo[0], flats[f].hi[1] - flats[f].lo[1]);
    }
    for (size_t k = flat_tree.nodes.size(); k-- > 0;) {  // nodes precede their children
        const Bvh::Node& node = flat_tree.nodes[k];
        Place& place = made[F + k];
        const Vec3 size = node.box.hi - node.box.lo;
        place.size = std::max({size.x, size.y, size.z});
        for (int i = 0; i < (node.count ? node.count : 2); ++i) {
            const Place& part = made[node.count ? flat_tree.items[node.first + i] : F + node.first + i];
            add(place, part.area, part.middle, part.normal, part.spread);
            place.face = i && place.face != part.face ? -1 : part.face;
        }
    }
    for (Place& place : made) {
        const double per_area = 1 / place.area;
        place.middle = per_area * place.middle;
        place.normal = per_area * place.normal;
        for (double& x : place.spread.m) x *= per_area;
        add_outer(place.spread, -1, place.middle, place.middle);
        place.middle += centre;
    }
    places = std::move(made);
}

void Shape::make_convex_edges() {
    using Side = std::tuple<int, int, int>;  // from, to, triangle
    std::vector<Side> sides;
    const int T = static_cast<int>(faces.size());
    for (int t = 0; t < T; ++t)
        for (int j = 0; j < 3; ++j) sides.emplace_back(triangles[3 * t + j], triangles[3 * t + (j + 1) % 3], t);
    std::sort(sides.begin(), sides.end());
    const auto owner_of = [&](int from, int to) {  // the last triangle with this side; -1 if none has it
        const auto after = std::upper_bound(sides.begin(), sides.end(), Side{from, to, T});
        const bool found = after != sides.begin() && std::get<0>(after[-1]) == from && std::get<1>(after[-1]) == to;
        return found ? std::get<2>(after[-1]) : -1;
    };
    std::vector<Box> boxes;
    std::vector<ConvexEdge> found;
    std::vector<int> convex(vertices.size(), 0);  // number of convex edges at each vertex; -1 if another edge ends there
    for (size_t k = 0; k < sides.size(); ++k) {
        const auto [from, to, t] = sides[k];
        if (k + 1 < sides.size() && std::get<0>(sides[k + 1]) == from && std::get<1>(sides[k + 1]) == to) continue;
        const int s = owner_of(to, from);
        if (s < 0) convex[from] = convex[to] = -1;  // open mesh
        if (from > to || s < 0) continue;
        if (flat_of[t] < 0 || flat_of[s] < 0 || flat_of[t] == flat_of[s]) continue;
        const Vec3 a = vertices[from], b = vertices[to], d = unit(b - a);
        // with the first triangle on the left of the edge, a convex one turns down to the second
        const double turn = dot(cross(normals[t], normals[s]), d);
        for (const int end : {from, to})
            if (turn < -1e-3 || convex[end] < 0)
                convex[end] = -1;
            else
                convex[end] += turn > 1e-3;
        if (turn <= 1e-3) continue;
        ConvexEdge e{a, d, {normals[t], normals[s]}, {cross(normals[t], d), cross(d, normals[s])}, norm(b - a), faces[t]};
        e.tip[0] = from;
        e.tip[1] = to;
        Box box;
        box.add(a);
        box.add(b);
        boxes.push_back(box);
        found.push_back(e);
    }
    for (ConvexEdge& e : found)
        for (int& tip : e.tip)
            if (convex[tip] < 3) tip = -1;
    convex_edges = std::move(found);
    edge_tree.build(boxes);
}

void Shape::make_grid(int cells) {
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
    std::vector<float> far(count);
    std::vector<int> nearest(count);
    size_t at = 0;
    int guess = 0;
    for (int i = 0; i < grid_shape[0]; ++i)
        for (int j = 0; j < grid_shape[1]; ++j)
            for (int k = 0; k < grid_shape[2]; ++k, ++at) {
                const Closest c = closest(grid_origin + grid_step * Vec3{double(i), double(j), double(k)}, guess);
                far[at] = static_cast<float>(std::sqrt(c.squared));
                guess = nearest[at] = c.triangle;
            }
    grid = std::move(far);
    grid_triangle = std::move(nearest);
}

}  // namespace tanteo
