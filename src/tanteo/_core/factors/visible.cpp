#include "factors/visible.hpp"

#include <algorithm>
#include <cmath>

#include "normal.hpp"

namespace tanteo {

namespace {

// Scan lines are turned by 20 degrees where there are edges: on an edge along scan lines there would be no place.
constexpr double TURN_COSINE = 0.93969262078590838, TURN_SINE = 0.34202014332566873;
// The most heights at which surfaces change; of more, as of fine meshes, heights that are near each other are one. Then the
// error of a mean is 0.01 of the spread (flange of 1,376 triangles), where unknown weights are 0.03.
constexpr int MOST_HEIGHTS = 48;
// Lengths in half widths of the section, and ratios of the depths at the ends from which two, and three places of a
// quadrature are used: the error of a mean is 0.002 of the spread (tests/factors/test_cone_range.py). A surface that is
// nearly along the beam has very different depths on a short length (test_the_mean_over_a_surface_along_the_beam_is_right).
constexpr double TWO = 0.25, THREE = 0.8, TWO_DEPTHS = 1.05, THREE_DEPTHS = 1.5;
// Depths of two facets of one face that differ by less are one smooth surface, as fraction.
constexpr double SMOOTH = 1e-3;
constexpr double LEAST_COSINE = 1e-3;  // of the incidence, beyond which nothing is returned
constexpr double CLOSE = 1e-9;         // difference of places that are one
constexpr double LEAST_LENGTH = 1e-12; // of a part of a scan line

struct Gauss {
    int count;
    double at[3], weight[3];  // on (0, 1)
};

const Gauss& gauss(double length, double depths = 1) {
    static const Gauss one{1, {0.5}, {1}}, two{2, {0.21132486540518712, 0.78867513459481288}, {0.5, 0.5}},
        three{3, {0.11270166537925831, 0.5, 0.88729833462074169}, {5. / 18, 8. / 18, 5. / 18}};
    if (length >= THREE || depths >= THREE_DEPTHS) return three;
    return length >= TWO || depths >= TWO_DEPTHS ? two : one;
}

}  // namespace

void Visible::see(const Shape& shape, const std::vector<int>& triangles, const Vec3& origin, const Section& section,
                  bool with_slope, std::vector<RayHit>& places, std::vector<Outline>& outlines) {
    thread_local Visible own;
    places.clear();
    outlines.clear();
    own.shape = &shape;
    own.section = section;
    own.cosine = 1;
    own.sine = 0;
    own.add_facets(triangles, origin);
    if (own.facets.empty()) return;
    own.add_edges();
    if (!own.edges.empty()) own.turn();
    own.find_sides();
    own.find_heights();
    for (size_t k = 0; k + 1 < own.heights.size(); ++k) {
        const double from = own.heights[k], to = own.heights[k + 1];
        if (to - from < CLOSE) continue;
        // the ends of the lines in a disc are smooth in the angle
        const double start = section.round ? std::asin(from) : from, end = section.round ? std::asin(to) : to;
        const Gauss& lines = gauss(own.dense ? to - from : std::max(end - start, TWO), own.depths_between(from, to));
        for (int i = 0; i < lines.count; ++i) {
            const double at = start + lines.at[i] * (end - start), width = lines.weight[i] * (end - start);
            if (section.round) own.add_line(std::sin(at), width * std::cos(at), with_slope, places, outlines);
            else own.add_line(at, width, with_slope, places, outlines);
        }
    }
}

void Visible::add_facets(const std::vector<int>& triangles, const Vec3& origin) {
    facets.clear();
    const auto [across, up] = section.duals();
    for (const int t : triangles) {
        const int* corner = &shape->triangles[3 * static_cast<size_t>(t)];
        Facet one;
        double least[2] = {1e300, 1e300}, most[2] = {-1e300, -1e300};
        bool beyond = false;
        for (int k = 0; k < 3; ++k) {
            const Vec3 w = shape->vertices[corner[k]] - origin;
            Vec3& at = one.corners[k];
            at = {dot(w, across), dot(w, up), dot(w, section.axis)};
            beyond |= at.z <= 0;
            for (int i = 0; i < 2; ++i) {
                least[i] = std::min(least[i], at[i] / at.z);
                most[i] = std::max(most[i], at[i] / at.z);
            }
        }
        if (!beyond && (least[0] > 1 || most[0] < -1 || least[1] > 1 || most[1] < -1)) continue;
        one.normal = shape->normals[t];
        one.height = dot(one.normal, origin - shape->vertices[corner[0]]);
        one.triangle = t;
        one.farthest = std::max({one.corners[0].z, one.corners[1].z, one.corners[2].z});
        facets.push_back(one);
    }
}

// Finds the edges in the section that are not between facets of one face.
void Visible::add_edges() {
    edges.clear();
    rows.resize(std::max(rows.size(), shape->faces.size()), -1);
    for (size_t k = 0; k < facets.size(); ++k) rows[facets[k].triangle] = static_cast<int>(k);
    const std::vector<int>& neighbours = shape->neighbours();
    for (const Facet& one : facets)
        for (int k = 0; k < 3; ++k) {
            const int beyond = neighbours[3 * static_cast<size_t>(one.triangle) + k];
            const bool ends = beyond < 0 || rows[beyond] < 0;
            if (!ends && (shape->faces[beyond] == shape->faces[one.triangle] || beyond < one.triangle)) continue;
            Vec3 a = one.corners[k], b = one.corners[(k + 1) % 3];
            if (a.z <= 0 && b.z <= 0) continue;
            // an end beside the origin or beyond it is out of the section
            if (a.z <= 0) a = b + ((1 - 1e-3) * b.z / (b.z - a.z)) * (a - b);
            if (b.z <= 0) b = a + ((1 - 1e-3) * a.z / (a.z - b.z)) * (b - a);
            const Edge edge{{a.x / a.z, b.x / b.z}, {a.y / a.z, b.y / b.z}, ends};
            if (std::max(edge.x[0], edge.x[1]) < -1 || std::min(edge.x[0], edge.x[1]) > 1) continue;
            if (std::max(edge.y[0], edge.y[1]) < -1 || std::min(edge.y[0], edge.y[1]) > 1) continue;
            edges.push_back(edge);
        }
    for (const Facet& one : facets) rows[one.triangle] = -1;
}

// Turns the scan lines: x and y of the section and of all in it.
void Visible::turn() {
    cosine = TURN_COSINE;
    sine = TURN_SINE;
    const Vec3 u = section.u, v = section.v;
    section.u = cosine * u + sine * v;
    section.v = cosine * v - sine * u;
    const auto turned = [&](double& x, double& y) {
        const double before = x;
        x = cosine * x + sine * y;
        y = cosine * y - sine * before;
    };
    for (Facet& one : facets)
        for (Vec3& at : one.corners) turned(at.x, at.y);
    for (Edge& edge : edges)
        for (int k = 0; k < 2; ++k) turned(edge.x[k], edge.y[k]);
}

bool Visible::is_inside(double x, double y, double slack) const {
    if (section.round) return x * x + y * y <= 1 + slack;
    return std::max(std::fabs(cosine * x - sine * y), std::fabs(sine * x + cosine * y)) <= 1 + slack;
}

void Visible::add_height(double x, double y) {
    if (is_inside(x, y, CLOSE)) heights.push_back(y);
}

// Finds what scan lines need of each facet, and their order from the first line to the last.
void Visible::find_sides() {
    for (Facet& one : facets) {
        const double per = -1 / one.height;
        one.inverse_depth = {per * dot(one.normal, section.u), per * dot(one.normal, section.v), per * dot(one.normal, section.axis)};
        one.least = 1e300;
        one.most = -1e300;
        for (int k = 0; k < 3; ++k) {
            const Vec3 &at = one.corners[k], s = cross(one.corners[(k + 1) % 3], at);  // corners are clockwise
            one.sides[k] = {s.x, s.y, s.z, 0, 0, 0};
            if (std::fabs(s.x) > 1e-12 * std::fabs(s.y)) {
                one.sides[k].slope = -s.y / s.x;
                one.sides[k].offset = -s.z / s.x;
                one.sides[k].bounds = s.x > 0 ? 1 : -1;
            }
            one.least = std::min(one.least, at.z > 0 ? at.y / at.z : -1e300);
            one.most = std::max(one.most, at.z > 0 ? at.y / at.z : 1e300);
        }
        if (one.most == 1e300) one.least = -1e300;  // a facet that passes the origin has no bounds
    }
    by_least.resize(facets.size());
    for (size_t k = 0; k < facets.size(); ++k) by_least[k] = static_cast<int>(k);
    std::sort(by_least.begin(), by_least.end(), [&](int a, int b) { return facets[a].least < facets[b].least; });
    crossed.clear();
    begun = 0;
}

// Finds the heights between which all scan lines cross the same surfaces.
void Visible::find_heights() {
    heights.clear();
    const double top = section.round ? 1 : cosine + sine;
    heights.insert(heights.end(), {-top, top});
    if (section.round) heights.push_back(0);  // three lines would be too few for a disc
    if (!section.round && sine > 0) heights.insert(heights.end(), {sine - cosine, cosine - sine});
    for (const Edge& e : edges) {
        for (int i = 0; i < 2; ++i) add_height(e.x[i], e.y[i]);
        add_heights_at_border(e);
    }
    if (heights.size() <= MOST_HEIGHTS) add_heights_of_crossings();
    std::sort(heights.begin(), heights.end());
    dense = heights.size() > MOST_HEIGHTS;
    if (!dense) return;
    // the part may cover a small piece of the section
    const double gap = (heights[heights.size() - 2] - heights[1]) / MOST_HEIGHTS;
    size_t kept = 1;
    for (size_t k = 1; k + 1 < heights.size(); ++k)
        if (heights[k] - heights[kept - 1] > gap) heights[kept++] = heights[k];
    heights[kept++] = top;
    heights.resize(kept);
}

void Visible::add_heights_at_border(const Edge& e) {
    const double dx = e.x[1] - e.x[0], dy = e.y[1] - e.y[0];
    const auto add_at = [&](double t) {
        if (t > 0 && t < 1) add_height(e.x[0] + t * dx, e.y[0] + t * dy);
    };
    if (section.round) {
        const double A = dx * dx + dy * dy, B = e.x[0] * dx + e.y[0] * dy, C = e.x[0] * e.x[0] + e.y[0] * e.y[0] - 1, D = B * B - A * C;
        if (D > 0 && A > 0) add_at((-B - std::sqrt(D)) / A), add_at((-B + std::sqrt(D)) / A);
        return;
    }
    const double along[2] = {cosine * e.x[0] - sine * e.y[0], sine * e.x[0] + cosine * e.y[0]};
    const double rate[2] = {cosine * dx - sine * dy, sine * dx + cosine * dy};
    for (int i = 0; i < 2; ++i)
        if (rate[i] != 0) add_at((1 - along[i]) / rate[i]), add_at((-1 - along[i]) / rate[i]);
}

// Edges between visible faces meet at their ends only; where a surface ends, it may hide others.
void Visible::add_heights_of_crossings() {
    for (size_t k = 0; k < edges.size(); ++k)
        for (size_t j = 0; j < k; ++j) {
            const Edge &e = edges[k], &f = edges[j];
            if (!e.ends && !f.ends) continue;
            const double dx = e.x[1] - e.x[0], dy = e.y[1] - e.y[0], fx = f.x[1] - f.x[0], fy = f.y[1] - f.y[0];
            const double gx = f.x[0] - e.x[0], gy = f.y[0] - e.y[0], det = dx * fy - dy * fx;
            const double s = (gx * dy - gy * dx) / det, t = (gx * fy - gy * fx) / det;
            if (s > 0 && s < 1 && t > 0 && t < 1) add_height(e.x[0] + t * dx, e.y[0] + t * dy);
        }
}

// The ratio of the depths of one surface at two heights, at most.
double Visible::depths_between(double from, double to) const {
    double most = 1;
    for (const int k : by_least) {
        const Facet& one = facets[k];
        if (one.least >= to) break;
        if (one.most > from) most = std::max(most, 1 + std::fabs(one.inverse_depth.y) * (std::min(to, one.most) - std::max(from, one.least)) * one.farthest);
    }
    return most;
}

double Visible::inverse_depth(int span, double x, double y) const {
    const Vec3& of = facets[spans[span].facet].inverse_depth;
    return of.x * x + of.y * y + of.z;
}

bool Visible::is_one_plane(const Facet& one, const Facet& two) const {
    return shape->faces[one.triangle] == shape->faces[two.triangle] && dot(one.normal, two.normal) > 1 - 1e-12 &&
           std::fabs(one.height - two.height) <= 1e-9 * one.height;
}

// Finds the spans of a scan line between two places, in the order of their beginnings.
void Visible::find_spans(double y, double start, double end) {
    for (; begun < facets.size() && facets[by_least[begun]].least < y; ++begun) crossed.push_back(by_least[begun]);
    crossed.erase(std::remove_if(crossed.begin(), crossed.end(), [&](int k) { return facets[k].most <= y; }), crossed.end());
    spans.clear();
    for (const int k : crossed) {
        const Facet& one = facets[k];
        Span span{start, end, k, nullptr, nullptr};
        for (const Side& side : one.sides) {
            const double x = side.slope * y + side.offset;
            if (side.bounds > 0 && x > span.from) span.from = x, span.first = &side;
            if (side.bounds < 0 && x < span.to) span.to = x, span.last = &side;
            if (side.bounds == 0 && side.b * y + side.c < 0) span.to = start;
        }
        if (span.to - span.from > LEAST_LENGTH) spans.push_back(span);
    }
    std::sort(spans.begin(), spans.end(), [](const Span& a, const Span& b) { return a.from < b.from; });
}

// The span of those at a place that hides the others there; -1 for none.
int Visible::nearest_at(double x, double y) const {
    if (open.empty()) return -1;
    int which = open[0];
    for (size_t k = 1; k < open.size(); ++k)
        if (inverse_depth(open[k], x, y) > inverse_depth(which, x, y)) which = open[k];
    return which;
}

// Divides a scan line into the segments on which one plane, or nothing is visible.
void Visible::find_segments(double y) {
    double start, end;
    if (section.round) end = std::sqrt(std::max(1 - y * y, 0.0)), start = -end;
    else {
        start = (sine * y - 1) / cosine, end = (sine * y + 1) / cosine;
        if (sine > 0) start = std::max(start, (-1 - cosine * y) / sine), end = std::min(end, (1 - cosine * y) / sine);
    }
    find_spans(y, start, end);
    segments.clear();
    by_end.resize(spans.size());
    for (size_t k = 0; k < spans.size(); ++k) by_end[k] = static_cast<int>(k);
    std::sort(by_end.begin(), by_end.end(), [&](int a, int b) { return spans[a].to < spans[b].to; });
    open.clear();
    double at = start;
    for (size_t first = 0, ended = 0; ended < spans.size();) {
        const double next = std::min(first < spans.size() ? spans[first].from : end, spans[by_end[ended]].to);
        if (next - at > LEAST_LENGTH) {
            const int which = nearest_at(0.5 * (at + next), y);
            Segment* const last = segments.empty() ? nullptr : &segments.back();
            if (last && (which == last->last || (which >= 0 && last->last >= 0 &&
                                                 is_one_plane(facets[spans[which].facet], facets[spans[last->last].facet])))) {
                last->to = next;
                if (which >= 0 && spans[which].to > spans[last->last].to) last->last = which;
            } else
                segments.push_back({at, next, which, which});
            at = next;
        }
        for (; first < spans.size() && spans[first].from <= next; ++first) open.push_back(static_cast<int>(first));
        for (; ended < spans.size() && spans[by_end[ended]].to <= next; ++ended)
            open.erase(std::find(open.begin(), open.end(), by_end[ended]));
    }
    if (!segments.empty() && end - at > LEAST_LENGTH) segments.push_back({at, end, -1, -1});
}

RayHit Visible::place(const Facet& facet, double x, double y, double share) const {
    const Vec3 along = section.axis + x * section.u + y * section.v, &of = facet.inverse_depth;
    const double length = norm(along), inverse = of.x * x + of.y * y + of.z;
    return {length / inverse, inverse * facet.height / length, along, facet.normal, facet.triangle, share};
}

void Visible::add_line(double y, double width, bool with_slope, std::vector<RayHit>& places, std::vector<Outline>& outlines) {
    find_segments(y);
    const double per_area = width / section.area();
    for (size_t k = 0; k < segments.size(); ++k) {
        const Segment& own = segments[k];
        if (with_slope && k > 0) add_outline(segments[k - 1], own, y, per_area, places, outlines);
        if (own.first < 0) continue;
        const double length = own.to - own.from;
        const double inverse[2] = {inverse_depth(own.first, own.from, y), inverse_depth(own.first, own.to, y)};
        const Gauss& along = gauss(length, std::max(inverse[0], inverse[1]) / std::min(inverse[0], inverse[1]));
        for (int i = 0; i < along.count; ++i) {
            const RayHit hit = place(facets[spans[own.first].facet], own.from + along.at[i] * length, y, along.weight[i] * length * per_area);
            if (hit.cosine > LEAST_COSINE) places.push_back(hit);
        }
    }
}

// Adds the outline between two segments. It moves with the nearer surface, and sweeps n dx ds, with the normal n in the
// section, for the width of the scan line: ds is the width over n_x.
void Visible::add_outline(const Segment& left, const Segment& right, double y, double width, std::vector<RayHit>& places,
                          std::vector<Outline>& outlines) const {
    const double x = right.from;
    const int rows[2] = {left.last, right.first};
    double depths[2] = {0, 0};
    for (int k = 0; k < 2; ++k)
        if (rows[k] >= 0) depths[k] = inverse_depth(rows[k], x, y);
    const auto face = [&](int k) { return shape->faces[facets[spans[rows[k]].facet].triangle]; };
    const bool level = std::fabs(depths[0] - depths[1]) < SMOOTH * depths[0];
    if (level && face(0) == face(1)) return;
    const Side* side = nullptr;
    if (rows[0] >= 0 && (depths[0] > depths[1] || level) && std::fabs(spans[rows[0]].to - x) < CLOSE) side = spans[rows[0]].last;
    if (!side && rows[1] >= 0 && (depths[1] > depths[0] || level) && std::fabs(spans[rows[1]].from - x) < CLOSE) side = spans[rows[1]].first;
    if (!side) return;
    Outline outline;
    double nearest = 1e300;
    for (int k = 0; k < 2; ++k) {
        if (rows[k] < 0) continue;
        const RayHit hit = place(facets[spans[rows[k]].facet], x, y, 0);
        if (!(hit.cosine > LEAST_COSINE)) continue;
        nearest = std::min(nearest, hit.range);
        outline.sides[k] = static_cast<int>(places.size());
        places.push_back(hit);
    }
    if (!(nearest < 1e300)) return;
    const double per = (side->a > 0 ? 1 : -1) / std::hypot(side->a, side->b), nx = per * side->a, ny = per * side->b;
    const double strip = width / nx, inward = nx * x + ny * y;
    const auto [across, up] = section.duals();
    const Vec3 normal = nx * across + ny * up, off = x * section.u + y * section.v;
    outline.by_origin = (-strip * norm(section.axis + off) / nearest) * (normal - inward * section.axis);
    outline.by_axis = -strip * (normal + inward * off);
    outlines.push_back(outline);
}

}  // namespace tanteo
