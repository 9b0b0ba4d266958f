#include "shape/simplify.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "shape/shape.hpp"

namespace tanteo {

constexpr double WORTHWHILE = 0.01;  // least fraction of the vertices that a further pass has to remove
constexpr double NEEDLE = 0.01;      // least ratio of height to longest side of a new triangle
constexpr double SHORT = 0.01;       // cost of the length of a collapsed edge, over that of its height: it chooses on planes
constexpr int TRIED = 3;             // number of adjacent vertices that are tried
constexpr int OCTAVES = 60;          // costs are sorted by powers of two up to this one [m]

Simplifier::Simplifier(const std::vector<Vec3>& points, const int* corners, const int* face_of, size_t count)
    : triangles(corners, corners + 3 * count), rows(count), vertices(points), faces(face_of), normals(points.size()),
      face_at(points.size(), -1), border_at(points.size(), -1), fixed(points.size(), 0), first(count, -1),
      after(points.size(), -1), stamp(points.size(), 0) {
    for (size_t t = 0; t < count; ++t) {
        rows[t] = static_cast<int>(t);
        const int* c = &triangles[3 * t];
        const Vec3 across = cross(points[c[1]] - points[c[0]], points[c[2]] - points[c[0]]);
        for (int j = 0; j < 3; ++j) {
            const int v = c[j];
            if (face_at[v] < 0) face_at[v] = faces[t];
            if (face_at[v] == faces[t]) {
                normals[v] += across;
                continue;
            }
            if (border_at[v] < 0) {
                border_at[v] = static_cast<int>(borders.size());
                borders.emplace_back();
                borders.back().face = faces[t];
            }
            Border& border = borders[border_at[v]];
            if (border.face != faces[t]) fixed[v] = 1;
            else border.normal += across;
        }
    }
    for (Vec3& n : normals) n = unit(n);
    for (Border& border : borders) border.normal = unit(border.normal);
    connect();
    for (int v = 0; v < static_cast<int>(points.size()); ++v)
        if (!fixed[v] && !(find_ring(v) && (border_at[v] < 0 || find_ends(v)))) fixed[v] = 1;
}

const Vec3* Simplifier::normal_of(int vertex, int face) const {
    if (face_at[vertex] == face) return &normals[vertex];
    const int row = border_at[vertex];
    return row >= 0 && borders[row].face == face ? &borders[row].normal : nullptr;
}

// Finds the two neighbours of a vertex along the border between its faces, in its ring; returns whether it has just two.
bool Simplifier::find_ends(int u) {
    int count = 0;
    const int at = border_at[u];
    for (size_t k = 0; k < ring.size(); ++k) {
        const Side& before = ring[k ? k - 1 : ring.size() - 1];
        if (faces[rows[before.triangle]] == faces[rows[ring[k].triangle]]) continue;
        if (count == 2) return false;
        borders[at].ends[count++] = ring[k].from;
    }
    return count == 2;
}

// Whether the border stays near, if u moves to its end k, and separates the same faces.
bool Simplifier::keeps_border(int u, int k, double limit) const {
    const Border& border = borders[border_at[u]];
    const int from = border.ends[!k], to = border.ends[k];
    for (const Side& side : ring) {  // a triangle with both ends vanishes: another one of its face has to follow
        if (!((side.from == from && side.to == to) || (side.from == to && side.to == from))) continue;
        for (int i = start[to]; i < start[to + 1]; ++i) {
            const int* c = &triangles[3 * at_vertex[i]];
            const bool beyond = at_vertex[i] != side.triangle && (c[0] == from || c[1] == from || c[2] == from);
            if (beyond && faces[rows[at_vertex[i]]] != faces[rows[side.triangle]]) return false;
        }
    }
    const Vec3 &a = vertices[from], &b = vertices[to];
    const auto is_near = [&](const Vec3& p) {
        Vec3 q;
        return point_triangle(p, a, b, b, q) <= limit;
    };
    if (!is_near(vertices[u])) return false;
    for (const auto& removed : border.removed)
        for (const int p : removed)
            if (!is_near(vertices[p])) return false;
    return true;
}

// Joins the two pieces of the border at u, which is removed.
void Simplifier::move_border(int u) {
    Border& own = borders[border_at[u]];
    std::vector<int> between = std::move(own.removed[0]);
    between.insert(between.end(), own.removed[1].begin(), own.removed[1].end());
    between.push_back(u);
    for (int side = 0; side < 2; ++side) {
        const int end = own.ends[side], other = own.ends[!side];
        if (border_at[end] < 0) continue;
        Border& next = borders[border_at[end]];
        for (int j = 0; j < 2; ++j)
            if (next.ends[j] == u) {
                next.ends[j] = other;
                next.removed[j] = between;
            }
    }
    own.removed[1].clear();
}

void Simplifier::connect() {
    start.assign(vertices.size() + 1, 0);
    for (const int v : triangles) ++start[v + 1];
    for (size_t v = 0; v < vertices.size(); ++v) start[v + 1] += start[v];
    at_vertex.resize(triangles.size());
    std::vector<int> at(start.begin(), start.end() - 1);
    for (size_t k = 0; k < triangles.size(); ++k) at_vertex[at[triangles[k]]++] = static_cast<int>(k / 3);
}

// Fills the ring of a vertex, side after side; returns whether it is one closed chain.
bool Simplifier::find_ring(int u) {
    ring.clear();
    for (int k = start[u]; k < start[u + 1]; ++k) {
        const int* c = &triangles[3 * at_vertex[k]];
        const int j = c[0] == u ? 0 : (c[1] == u ? 1 : 2);
        ring.push_back({c[(j + 1) % 3], c[(j + 2) % 3], at_vertex[k]});
    }
    const size_t n = ring.size();
    if (n < 3) return false;
    for (size_t k = 0; k + 1 < n; ++k) {
        size_t next = k + 1;
        while (next < n && ring[next].from != ring[k].to) ++next;
        if (next == n) return false;
        std::swap(ring[k + 1], ring[next]);
        if (k && ring[k].to == ring[0].from) return false;
    }
    return ring[n - 1].to == ring[0].from;
}

// Whether the connections of the surface stay: two vertices are adjacent to both, and no triangle occurs twice.
bool Simplifier::is_linked(int u, int v) {
    ++stamped;
    int opposite = 0;
    for (int k = start[v]; k < start[v + 1]; ++k)
        for (int j = 0; j < 3; ++j) stamp[triangles[3 * at_vertex[k] + j]] = stamped;
    for (const Side& side : ring) opposite += side.from != v && stamp[side.from] == stamped;
    if (opposite != 2) return false;
    if (ring.size() > 3) return true;
    for (int k = start[v]; k < start[v + 1]; ++k) {
        const int* c = &triangles[3 * at_vertex[k]];
        if (c[0] == u || c[1] == u || c[2] == u) continue;
        int common = 0;
        for (int j = 0; j < 3; ++j)
            for (const Side& side : ring) common += c[j] != v && side.from == c[j];
        if (common == 2) return false;
    }
    return true;
}

// Whether the triangles at u can have v in its place; the new triangle of each removed vertex is kept in `owner`.
bool Simplifier::can_move(int u, int v, double limit, double cosine) {
    chain.assign(1, u);
    for (const Side& side : ring)
        for (int p = first[side.triangle]; p >= 0; p = after[p]) chain.push_back(p);
    const Vec3& at = vertices[v];
    for (const Side& side : ring) {
        if (side.from == v || side.to == v) continue;
        const Vec3 &a = vertices[side.from], &b = vertices[side.to];
        const Vec3 across = cross(a - at, b - at), before = cross(a - vertices[u], b - vertices[u]);
        const double doubled = norm(across);
        const double longest = std::sqrt(std::max({squared(a - at), squared(b - at), squared(b - a)}));
        const double earlier = std::max(squared(a - vertices[u]), squared(b - vertices[u]));
        // long strips stay so
        const double thin = std::clamp(0.5 * norm(before) / std::max(earlier, squared(b - a)), NEEDLE * NEEDLE, NEEDLE);
        if (!(doubled > thin * longest * longest)) return false;
        const double least = cosine * doubled;
        if (dot(across, before) < cosine * doubled * norm(before)) return false;
        for (const int corner : {side.from, side.to, v}) {
            const Vec3* normal = fixed[corner] ? nullptr : normal_of(corner, faces[rows[side.triangle]]);
            if (normal && dot(across, *normal) < least) return false;
        }
    }
    const auto is_near = [&](const Vec3& p, int tip) {  // to the triangles of the ring with this tip
        Vec3 q;
        for (const Side& side : ring)
            if (side.from != tip && side.to != tip &&
                point_triangle(p, vertices[tip], vertices[side.from], vertices[side.to], q) <= limit)
                return true;
        return false;
    };
    for (const Side& side : ring) {  // edges may leave the other surface although no vertex does
        const Vec3& end = vertices[side.from];
        if (side.from != v && !(is_near(0.5 * (at + end), u) && is_near(0.5 * (vertices[u] + end), v))) return false;
    }
    owner.resize(chain.size());
    for (size_t k = 0; k < chain.size(); ++k) {
        const Vec3& p = vertices[chain[k]];
        double best = 1e300;
        Vec3 q;
        for (const Side& side : ring) {
            if (side.from == v || side.to == v || !normal_of(chain[k], faces[rows[side.triangle]])) continue;
            const double d2 = point_triangle(p, at, vertices[side.from], vertices[side.to], q);
            if (d2 < best) {
                best = d2;
                owner[k] = static_cast<int>(&side - ring.data());
            }
        }
        if (best > limit) return false;
        const Side& side = ring[owner[k]];
        const Vec3 across = cross(vertices[side.from] - at, vertices[side.to] - at);
        if (dot(across, *normal_of(chain[k], faces[rows[side.triangle]])) < cosine * norm(across)) return false;
    }
    return true;
}

void Simplifier::move(int u, int v) {
    for (const Side& side : ring) {
        int* c = &triangles[3 * side.triangle];
        first[side.triangle] = -1;
        if (side.from == v || side.to == v)
            c[0] = -1;  // it vanishes
        else
            *std::find(c, c + 3, u) = v;
        touched[side.from] = 1;
        failed[side.from] = 0;
    }
    for (size_t k = 0; k < chain.size(); ++k) {
        int& head = first[ring[owner[k]].triangle];
        after[chain[k]] = head;
        head = chain[k];
    }
}

size_t Simplifier::pass(double tolerance, double cosine) {
    connect();
    touched.assign(vertices.size(), 0);
    std::vector<int> all, octaves;  // vertices that may be removed, and the octave of their cost
    const auto cost_of = [&](int u, int v) {
        const Vec3 way = vertices[v] - vertices[u];
        double height = std::fabs(dot(normals[u], way));
        if (border_at[u] >= 0) {
            const int* ends = borders[border_at[u]].ends;
            Vec3 q;
            height = std::sqrt(point_triangle(vertices[u], vertices[ends[0]], vertices[ends[1]], vertices[ends[1]], q));
        }
        return height + SHORT * norm(way);
    };
    for (int u = 0; u < static_cast<int>(vertices.size()); ++u) {
        if (fixed[u] || failed[u] || start[u] == start[u + 1]) continue;
        double least = 1e300;
        if (border_at[u] >= 0) {
            for (const int v : borders[border_at[u]].ends) least = std::min(least, cost_of(u, v));
        } else {
            for (int k = start[u]; k < start[u + 1]; ++k)
                for (int j = 0; j < 3; ++j)
                    if (const int v = triangles[3 * at_vertex[k] + j]; v != u) least = std::min(least, cost_of(u, v));
        }
        all.push_back(u);
        octaves.push_back(std::clamp(std::ilogb(least), -OCTAVES, OCTAVES) + OCTAVES);
    }
    // Cheap vertices first; those of one octave stay in the order of the mesh, where adjacent ones share memory.
    std::vector<size_t> starts(2 * OCTAVES + 2, 0);
    for (const int octave : octaves) ++starts[octave + 1];
    std::partial_sum(starts.begin(), starts.end(), starts.begin());
    std::vector<int> choices(all.size());
    for (size_t k = 0; k < all.size(); ++k) choices[starts[octaves[k]]++] = all[k];
    size_t removed = 0;
    std::vector<std::pair<double, int>> targets;
    for (const int u : choices) {
        if (touched[u]) continue;
        if (!find_ring(u)) {
            fixed[u] = 1;
            continue;
        }
        targets.clear();
        bool waits = false;
        const Border* border = border_at[u] >= 0 ? &borders[border_at[u]] : nullptr;
        for (const Side& side : ring) {
            if (border && side.from != border->ends[0] && side.from != border->ends[1]) continue;
            if (touched[side.from])
                waits = true;
            else
                targets.emplace_back(cost_of(u, side.from), side.from);
        }
        const size_t most = std::min<size_t>(TRIED, targets.size());
        std::partial_sort(targets.begin(), targets.begin() + most, targets.end());
        bool moved = false;
        for (size_t k = 0; k < most && !moved; ++k) {
            const int v = targets[k].second;
            if (border && !keeps_border(u, v == border->ends[1], tolerance * tolerance)) continue;
            if (!is_linked(u, v) || !can_move(u, v, tolerance * tolerance, cosine)) continue;
            if (border) move_border(u);
            move(u, v);
            ++removed;
            moved = true;
        }
        failed[u] = !moved && !waits;
    }
    size_t kept = 0;
    for (size_t t = 0; t < rows.size(); ++t) {
        if (triangles[3 * t] < 0) continue;
        std::copy_n(&triangles[3 * t], 3, &triangles[3 * kept]);
        rows[kept] = rows[t];
        first[kept++] = first[t];
    }
    triangles.resize(3 * kept);
    rows.resize(kept);
    first.resize(kept);
    return removed;
}

void Simplifier::simplify(double tolerance, double tilt) {
    failed.assign(vertices.size(), 0);
    const double cosine = std::cos(tilt);
    while (static_cast<double>(pass(tolerance, cosine)) > WORTHWHILE * static_cast<double>(rows.size()) / 2) {
    }
}

}  // namespace tanteo
