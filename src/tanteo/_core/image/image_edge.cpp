#include "image/image_edge.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "normal.hpp"

namespace tanteo {

namespace {

struct Distorted {  // image of a ray with z = 1 by a lens, with the terms of its derivative
    double x, y, r2, radial, u, v;
};

Distorted distorted(const Lens& lens, double x, double y) {
    const double *k = lens.k, r2 = x * x + y * y;
    const double up = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4])), down = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    const double radial = up / down;
    return {x, y, r2, radial, x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x),
            y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y};
}

struct Projected {  // pixel of a point in the camera frame, and its derivative by the point
    double x, y;
    Vec3 dx, dy;
};

Projected projected(const Lens& lens, const Vec3& p) {
    const double per = 1 / p.z, *k = lens.k, p1 = k[2], p2 = k[3];
    const auto [x, y, r2, radial, u, v] = distorted(lens, p.x / p.z, p.y / p.z);
    const double down = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])), d_down = k[5] + r2 * (2 * k[6] + 3 * r2 * k[7]);
    const double d_up = k[0] + r2 * (2 * k[1] + 3 * r2 * k[4]), slope = (d_up - radial * d_down) / down;
    const double across = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y;
    const double ux = radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x;
    const double vy = radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x;
    const double a = lens.fx * per, b = lens.fy * per;
    return {lens.fx * u + lens.cx, lens.fy * v + lens.cy, a * Vec3{ux, across, -ux * x - across * y},
            b * Vec3{across, vy, -across * x - vy * y}};
}

int64_t nearest_whole(double above) { return static_cast<int64_t>(above + 0.5); }  // for values above -0.5

}  // namespace

Pixel project(const Lens& lens, const Vec3& p) {
    const double none = std::numeric_limits<double>::quiet_NaN();
    if (!(p.z > 0)) return {none, none};
    const Distorted b = distorted(lens, p.x / p.z, p.y / p.z);
    return {lens.fx * b.u + lens.cx, lens.fy * b.v + lens.cy};
}

Channels::Channels(int64_t count) {
    for (int64_t k = 0; k < count; ++k) {
        const double angle = (k + 0.5) * PI / count;
        borders.push_back({std::cos(angle), std::sin(angle)});
    }
}

int64_t Channels::of(double nx, double ny) const {
    const double sign = ny < 0 || (ny == 0 && nx < 0) ? -1 : 1;
    size_t passed = 0;
    for (const Pixel& border : borders) passed += sign * (border.x * ny - border.y * nx) > 0;
    return static_cast<int64_t>(passed == borders.size() ? 0 : passed);
}

EdgeMatch match_edge(const Lens& lens, const EdgePoints& points, const EdgeSample& sample, const Pose& pose, bool shown,
                     double diagonal, double reach) {
    EdgeMatch match;
    const Vec3 p = pose.R * sample.at + pose.t;
    if (!(p.z > 0)) {
        match.x = match.y = std::numeric_limits<double>::quiet_NaN();
        return match;
    }
    const Projected at = projected(lens, p);
    const Vec3 jx = transposed_times(pose.R, at.dx), jy = transposed_times(pose.R, at.dy);  // derivatives by the point in the part frame
    const double tx = dot(jx, sample.along), ty = dot(jy, sample.along), scale = std::sqrt(tx * tx + ty * ty);
    const double safe = scale > 0 ? scale : 1;
    match.x = at.x;
    match.y = at.y;
    match.nx = -ty / safe;
    match.ny = tx / safe;
    const Vec3 by = match.nx * jx + match.ny * jy, turn = cross(sample.at, by);
    store(by, match.slope);
    store(turn, match.slope + 3);
    match.inside = shown && scale * diagonal > 1 && at.x > -0.5 && at.y > -0.5 && at.x < points.columns - 0.5 &&
                 at.y < points.rows - 0.5;
    if (!match.inside) return match;
    match.span = scale * sample.length;
    const int64_t channel = points.channels.of(match.nx, match.ny);
    const int32_t which =
        points.nearest[(channel * points.rows + nearest_whole(at.y)) * points.columns + nearest_whole(at.x)];
    if (which < 0 || which >= points.count) return match;
    const double gx = points.pixels[2 * which] - at.x, gy = points.pixels[2 * which + 1] - at.y;
    const double off = gx * match.nx + gy * match.ny, along = std::fabs(gx * match.ny - gy * match.nx);
    if (!(std::fabs(off) < reach) || !(along < std::max(2.0, 0.5 * reach))) return match;
    match.offset = off;
    match.sd = points.sds[which];
    match.point = which;
    return match;
}

namespace {

// Places by cells of a grid, to compare each with those nearby only.
class PlaceGrid {
  public:
    // reach: distance along each axis up to which two places are compared [px]
    PlaceGrid(const std::vector<EdgePlace>& all, double reach) : all(all) {
        double right = -1e300, bottom = -1e300;
        for (const EdgePlace& p : all) {
            left = std::min(left, p.x), right = std::max(right, p.x);
            top = std::min(top, p.y), bottom = std::max(bottom, p.y);
        }
        cell = std::max({reach, (right - left) / MOST, (bottom - top) / MOST, 1e-9});
        for (const EdgePlace& p : all) {
            ++starts[cell_of(p.x, left) + WIDE * cell_of(p.y, top) + 1];
            columns = std::max(columns, cell_of(p.x, left)), rows = std::max(rows, cell_of(p.y, top));
        }
        for (int k = 0; k < WIDE * WIDE; ++k) starts[k + 1] += starts[k];
        std::array<int, WIDE * WIDE + 1> next = starts;
        order.resize(all.size());
        for (size_t k = 0; k < all.size(); ++k) order[next[cell_of(all[k].x, left) + WIDE * cell_of(all[k].y, top)]++] = k;
    }

    template <class Test>
    bool any_near(const EdgePlace& a, const Test& test) const {
        const int x = cell_of(a.x, left), y = cell_of(a.y, top);
        for (int row = std::max(y - 1, 0); row <= std::min(y + 1, rows); ++row) {
            const int first = starts[std::max(x - 1, 0) + WIDE * row], last = starts[std::min(x + 1, columns) + WIDE * row + 1];
            for (int k = first; k < last; ++k)
                if (test(all[order[k]])) return true;
        }
        return false;
    }

  private:
    static constexpr int MOST = 30, WIDE = MOST + 2;
    int cell_of(double at, double from) const { return static_cast<int>((at - from) / cell); }

    const std::vector<EdgePlace>& all;
    std::array<int, WIDE * WIDE + 1> starts{};
    std::vector<size_t> order;
    double left = 1e300, top = 1e300, cell = 1;
    int columns = 0, rows = 0;
};

double widest(const std::vector<EdgePlace>& all) {
    double width = 0;
    for (const EdgePlace& p : all) width = std::max(width, p.width);
    return width;
}

}  // namespace

std::vector<char> foremost(const std::vector<EdgePlace>& all, double cosine) {
    const PlaceGrid grid(all, widest(all));
    std::vector<char> out(all.size(), 1);
    for (size_t i = 0; i < all.size(); ++i) {
        const EdgePlace& a = all[i];
        out[i] = !grid.any_near(a, [&](const EdgePlace& b) {
            if (a.group == b.group || !(a.off > b.off)) return false;
            const double x = a.x - b.x, y = a.y - b.y, width = std::max(a.width, b.width);
            return x * x + y * y < width * width && std::fabs(a.nx * b.nx + a.ny * b.ny) > cosine;
        });
    }
    return out;
}

std::vector<char> ambiguous_places(const std::vector<EdgePlace>& all, double gap, double cosine) {
    const PlaceGrid grid(all, gap + 0.5 * widest(all));
    std::vector<char> out(all.size());
    for (size_t i = 0; i < all.size(); ++i) {
        const EdgePlace& a = all[i];
        out[i] = grid.any_near(a, [&](const EdgePlace& b) {
            if (a.group == b.group && std::fabs(a.nx * b.nx + a.ny * b.ny) >= cosine) return false;
            const double x = a.x - b.x, y = a.y - b.y, across = x * b.nx + y * b.ny;
            const double beyond = std::sqrt(std::max(x * x + y * y - across * across, 0.0)) - 0.5 * b.width;
            return across * across + (beyond > 0 ? beyond * beyond : 0.0) < gap * gap;
        });
    }
    return out;
}

}  // namespace tanteo
