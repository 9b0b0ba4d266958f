// Mass of a normal density in a plane inside an outline, and its derivatives by the mean.
#pragma once
#include "normal.hpp"
#include "shape/shape.hpp"

namespace tanteo {

constexpr double OUTLINE_REACH = 5;  // standard deviations beyond which an edge of an outline has no effect

struct Whitening {  // of the noise in a plane: W (x - mean) has unit covariance
    double a, b, c;  // lower triangle
    double widest;
    bool even;  // equal in all directions
};

inline Whitening whitening_of(double xx, double xy, double yy) {
    const double l = std::sqrt(std::max(xx, 1e-300)), m = xy / l;
    const double k = std::sqrt(std::max(yy - m * m, 1e-12 * (xx + yy) + 1e-300));
    return {1 / l, -m / (l * k), 1 / k, std::sqrt(0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy)), false};
}

struct TruncatedMass {  // with gradient and minus second derivative by the whitened mean
    double value = 0, gx = 0, gy = 0, xx = 0, xy = 0, yy = 0;
};

// The winding number about the mean (x, y), minus the mass beyond each edge within the angle that the edge subtends: for an
// edge at the distance h, with its ends at t1 and t2 along its line, T(h, t2 / h) - T(h, t1 / h) (Owen 1956). The gradient
// is the integral of the density times the inward normal along the outline.
inline TruncatedMass mass_inside(const Shape& shape, const Flat& flat, double x, double y, const Whitening& W, bool with_slope) {
    TruncatedMass mass;
    const double reach = OUTLINE_REACH * W.widest;
    const bool near_x = x >= flat.lo[0] - reach && x <= flat.hi[0] + reach;
    const bool near_y = y >= flat.lo[1] - reach && y <= flat.hi[1] + reach;
    if (!near_x || !near_y) return mass;  // also if nan
    double beyond = 0;
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
            if ((ry <= 0) != (y1 <= 0))  // crosses the line through the point to the right of it
                winding += y1 > 0 ? inside : -!inside;
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
            if (std::fabs(h) > OUTLINE_REACH) continue;
            const double t1 = ax * dx + ay * dy, t2 = t1 + e.length * stretch;
            if (t1 > OUTLINE_REACH || t2 < -OUTLINE_REACH) continue;
            const double ah = std::fabs(h);
            const bool whole = t1 < -ENDLESS && t2 > ENDLESS;
            const EdgeIntegrals over = edge_integrals(ah, t1, t2, with_slope);
            beyond += inside ? over.wedge : -over.wedge;
            if (!with_slope) continue;
            const double m = over.along;
            mass.gx -= dy * m;  // the inside is to the left: (-dy, dx)
            mass.gy += dx * m;
            mass.xx += dy * dy * h * m;
            mass.xy -= dx * dy * h * m;
            mass.yy += dx * dx * h * m;
            if (whole) continue;
            const double ends = normal_density(h) * (normal_density(t2) - normal_density(t1));
            mass.xx -= dx * dy * ends;
            mass.xy += 0.5 * (dx * dx - dy * dy) * ends;
            mass.yy += dx * dy * ends;
        }
    mass.value = std::clamp(winding - beyond, 0.0, 1.0);
    return mass;
}

// Replaces the derivatives of a mass by those of its log.
inline void as_log(TruncatedMass& s) {
    const double inverse = 1 / s.value;
    s.gx *= inverse;
    s.gy *= inverse;
    s.xx = s.xx * inverse + s.gx * s.gx;
    s.xy = s.xy * inverse + s.gx * s.gy;
    s.yy = s.yy * inverse + s.gy * s.gy;
}

}  // namespace tanteo
