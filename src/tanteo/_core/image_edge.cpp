#include "image_edge.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "normal.hpp"

namespace tanteo {

namespace {

struct Seen {  // a point of the camera's frame as a pixel, and its derivative by the point
    double x, y;
    Vec3 dx, dy;
};

Seen seen(const Lens& lens, const Vec3& p) {
    const double x = p.x / p.z, y = p.y / p.z, r2 = x * x + y * y, per = 1 / p.z;
    const double *k = lens.k, p1 = k[2], p2 = k[3];
    const double up = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4])), down = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    const double d_up = k[0] + r2 * (2 * k[1] + 3 * r2 * k[4]), d_down = k[5] + r2 * (2 * k[6] + 3 * r2 * k[7]);
    const double radial = up / down, slope = (d_up * down - up * d_down) / (down * down);
    const double u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x);
    const double v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
    const double across = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y;
    const double ux = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x;
    const double vy = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x;
    const double a = lens.fx * per, b = lens.fy * per;
    return {lens.fx * u + lens.cx, lens.fy * v + lens.cy, a * Vec3{ux, across, -ux * x - across * y},
            b * Vec3{across, vy, -across * x - vy * y}};
}

}  // namespace

EdgeMet meet_edge(const Lens& lens, const EdgePoints& points, const EdgeSample& sample, const Pose& pose, bool shown,
                  double diagonal, double reach) {
    EdgeMet met;
    const Vec3 p = pose.R * sample.at + pose.t;
    if (!(p.z > 0)) {
        met.x = met.y = std::numeric_limits<double>::quiet_NaN();
        return met;
    }
    const Seen at = seen(lens, p);
    const Vec3 jx = transposed_times(pose.R, at.dx), jy = transposed_times(pose.R, at.dy);  // by the point of the part
    const double tx = dot(jx, sample.along), ty = dot(jy, sample.along), scale = std::hypot(tx, ty);
    const double safe = scale > 0 ? scale : 1;
    met.x = at.x;
    met.y = at.y;
    met.nx = -ty / safe;
    met.ny = tx / safe;
    const Vec3 by = met.nx * jx + met.ny * jy, turn = cross(sample.at, by);
    store(by, met.slope);
    store(turn, met.slope + 3);
    met.inside = shown && scale * diagonal > 1 && at.x > -0.5 && at.y > -0.5 && at.x < points.columns - 0.5 &&
                 at.y < points.rows - 0.5;
    if (!met.inside) return met;
    met.span = scale * sample.length;
    const auto turns = static_cast<int64_t>(std::nearbyint(std::atan2(met.ny, met.nx) * (points.channels / PI)));
    const int64_t channel = (turns % points.channels + points.channels) % points.channels;
    const auto row = static_cast<int64_t>(std::nearbyint(at.y)), column = static_cast<int64_t>(std::nearbyint(at.x));
    const int32_t which = points.nearest[(channel * points.rows + row) * points.columns + column];
    if (which < 0 || which >= points.count) return met;
    const double gx = points.pixels[2 * which] - at.x, gy = points.pixels[2 * which + 1] - at.y;
    const double off = gx * met.nx + gy * met.ny, aside = std::fabs(gx * met.ny - gy * met.nx);
    if (!(std::fabs(off) < reach) || !(aside < std::max(2.0, 0.5 * reach))) return met;
    met.offset = off;
    met.sd = points.sds[which];
    met.point = which;
    return met;
}

void slide(const float* distances, int64_t count, const float* bare, int64_t bare_count, const int32_t* drawn,
           int64_t samples, const int32_t* inner, int64_t inners, const int32_t* slides, int64_t places, double most,
           double penalty, double* costs) {
    const auto mean = [](const float* table, int64_t size, const int32_t* offsets, int64_t n, int64_t by) {
        double sum = 0;
        for (int64_t k = 0; k < n; ++k) sum += table[std::clamp<int64_t>(offsets[k] + by, 0, size - 1)];
        return sum / std::max<int64_t>(n, 1);
    };
    for (int64_t s = 0; s < places; ++s) {
        const double share = mean(bare, bare_count, inner, inners, slides[s]);
        costs[s] = share < most ? mean(distances, count, drawn, samples, slides[s]) + penalty * share
                                : std::numeric_limits<double>::infinity();
    }
}

}  // namespace tanteo
