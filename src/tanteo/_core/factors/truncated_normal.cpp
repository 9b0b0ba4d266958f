#include "factors/truncated_normal.hpp"

#include <algorithm>
#include <cmath>

namespace tanteo {

void MassQueue::clear(bool slope) {
    with_slope = slope;
    edges.clear();
    masses.clear();
    exponents.clear();
    exponents_done = 0;
    for (Integrals& own : integrals) own.count = own.done = 0;
}

void MassQueue::Integrals::grow() {
    const size_t size = std::max<size_t>(2 * h.size(), 8 * WIDEST_LANES);
    for (std::vector<double>* column : {&h, &first, &last, &wedge, &along, &ends}) column->resize(size);
}

int MassQueue::add(const Shape& shape, const Flat& flat, double x, double y, const Whitening& W, double exponent) {
    const double reach = OUTLINE_REACH * W.widest;
    const bool near_x = x >= flat.lo[0] - reach && x <= flat.hi[0] + reach;
    const bool near_y = y >= flat.lo[1] - reach && y <= flat.hi[1] + reach;
    if (!near_x || !near_y) return -1;  // also if nan
    const size_t first_edge = edges.size();
    int winding = 0;
    const int* starts = shape.bin_start.data() + flat.first_bin;
    const OutlineEdge* outline = shape.outlines.data() + flat.first_edge;
    const auto bin = [&](double v) {
        return static_cast<int>(std::clamp((v - flat.bin_lo) / flat.bin_step, 0.0, flat.bins - 1.0));
    };
    const int begin = bin(y - reach), end = bin(y + reach);
    for (int k = begin; k <= end; ++k)
        for (int i = starts[k]; i < starts[k + 1]; ++i) {
            const OutlineEdge& e = outline[shape.bin_edges[i]];
            if (k != std::max(e.first_bin, begin)) continue;  // done in an earlier bin
            const double rx = e.x - x, ry = e.y - y, y1 = ry + e.dy * e.length;
            const double left = rx * e.dy - ry * e.dx;  // signed distance of the edge, positive if the point is inside
            // a point exactly on an edge counts as slightly right of it and above: inside one of two adjacent flats
            const bool inside = left != 0 ? left > 0 : e.dy < 0 || (e.dy == 0 && e.dx > 0);
            const int crosses = (ry <= 0) != (y1 <= 0);  // the line through the point, to the right of it
            winding += crosses * (inside - (y1 <= 0));
            const double ax = W.a * rx, ay = W.b * rx + W.c * ry;
            double dx = e.dx, dy = e.dy, stretch = W.a;
            if (!W.even) {
                dx = W.a * e.dx;
                dy = W.b * e.dx + W.c * e.dy;
                stretch = std::sqrt(dx * dx + dy * dy);
                dx /= stretch;
                dy /= stretch;
            }
            const double h = ax * dy - ay * dx;
            const double t1 = ax * dx + ay * dy, t2 = t1 + e.length * stretch;
            if ((std::fabs(h) > OUTLINE_REACH) | (t1 > OUTLINE_REACH) | (t2 < -OUTLINE_REACH)) continue;
            add_edge(dx, dy, h, t1, t2, inside);
        }
    if (edges.size() == first_edge && winding <= 0) return -1;
    masses.push_back({static_cast<int>(first_edge), static_cast<int>(edges.size() - first_edge), winding});
    exponents.push_back(exponent);
    return static_cast<int>(masses.size()) - 1;
}

void MassQueue::add_edge(double dx, double dy, double h, double t1, double t2, bool inside) {
    const double ah = std::fabs(h), length = t2 - t1;
    const int endless = t1 < -ENDLESS, endless_after = t2 > ENDLESS;
    int kind = static_cast<int>(EdgeKind::TWO_ENDS) - endless - endless_after;
    if (length < ah) kind = static_cast<int>((length < 0.5) & (length < 0.3 * ah) ? EdgeKind::TINY : EdgeKind::SHORT);
    const bool mirrored = (kind == static_cast<int>(EdgeKind::ONE_END)) & endless;
    Integrals& own = integrals[kind];
    if (own.count == own.h.size()) own.grow();
    own.h[own.count] = ah;
    own.first[own.count] = mirrored ? -t2 : t1;
    own.last[own.count] = t2;
    edges.push_back({dx, dy, h, kind, static_cast<int>(own.count++), inside, mirrored});
}

void MassQueue::run() {
    const LaneKernels& kernels = lane_kernels();
    const auto whole = [](size_t count) { return (count + WIDEST_LANES - 1) / WIDEST_LANES * WIDEST_LANES; };
    for (int kind = 0; kind < EDGE_KINDS; ++kind) {
        Integrals& own = integrals[kind];
        const size_t at = own.done, size = at + whole(own.count - at);
        if (own.count == at) continue;
        while (own.h.size() < size) own.grow();
        for (size_t k = own.count; k < size; ++k) {  // lanes without an edge have a harmless one
            own.h[k] = 1;
            own.first[k] = 0;
            own.last[k] = 0.25;
        }
        kernels.edges[kind]({&own.h[at], &own.first[at], &own.last[at], &own.wedge[at], &own.along[at], &own.ends[at]},
                            size - at, with_slope);
        own.done = own.count;
    }
    const size_t count = exponents.size();
    if (count == exponents_done) return;
    exponents.resize(exponents_done + whole(count - exponents_done), 0.0);
    kernels.exponentials(&exponents[exponents_done], exponents.size() - exponents_done);
    exponents.resize(count);
    exponents_done = count;
}

TruncatedMass MassQueue::mass(int number) const {
    const Pending& own = masses[number];
    TruncatedMass mass;
    double beyond = 0;
    for (int k = own.first_edge; k < own.first_edge + own.edges; ++k) {
        const Edge& e = edges[k];
        const EdgeIntegrals over = of_edge(static_cast<size_t>(k));
        beyond += e.inside ? over.wedge : -over.wedge;
        if (!with_slope) continue;
        const double m = over.along, hm = e.h * m, ends = over.ends;
        mass.gx -= e.dy * m;  // the inside is to the left: (-dy, dx)
        mass.gy += e.dx * m;
        const double cross = e.dx * e.dy * ends;
        mass.xx += e.dy * e.dy * hm - cross;
        mass.xy += 0.5 * (e.dx * e.dx - e.dy * e.dy) * ends - e.dx * e.dy * hm;
        mass.yy += e.dx * e.dx * hm + cross;
    }
    mass.value = std::clamp(own.winding - beyond, 0.0, 1.0);
    return mass;
}

}  // namespace tanteo
