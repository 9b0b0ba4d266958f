#include "factors/round_centre.hpp"

#include <algorithm>
#include <cmath>

#include "factors/gaussian.hpp"

namespace tanteo {

namespace {

constexpr size_t HEIGHTS = 10;      // sites of a line: five places along it, each with both directions of the axis
constexpr double SIZE_REACH = 4;    // standard deviations of a size within which a landmark is proposed

}  // namespace

namespace {

// Density of a sensed size whose true value is in a range.
double size_density(double size, double least, double most, double sd) {
    const double r = (size - std::clamp(size, least, most)) / sd;
    return fast_exp(-0.5 * r * r - HALF_LOG_TWO_PI) / sd;
}

}  // namespace

// Whether a landmark may have been measured: by kind, side, and sizes within a number of standard deviations.
bool RoundCentre::may_measure(const RoundAxis& axis, double sds, double blur) const {
    if (axis.kind != landmark() || side * axis.hole < 0) return false;
    const double within = sds * std::hypot(size_sd, blur), other_within = sds * std::hypot(other_sd, blur);
    if (size > 0 && !(size > axis.least - within && size < axis.most + within)) return false;
    return !(other > 0) || (other > axis.least_other - other_within && other < axis.most_other + other_within);
}

void RoundCentre::evaluate(const Placement& at, Components& out) const {
    const bool line = is_line();
    const double blur = size_is_angle() ? at.blur_turn : at.blur, width = std::hypot(size_sd, blur);
    const double tilt_variance = direction_sd * direction_sd + at.blur_turn * at.blur_turn;
    const PointDensity density(at.C);
    for (const RoundAxis& axis : at.shape.axes) {
        if (!may_measure(axis, REACH, blur)) continue;
        Component c;
        c.weight = axis.weight * fast_exp(-log_outlier) *
                   (line ? line_density(axis.a, axis.direction, at.p, at.C, c)
                         : density.at(start(axis), at.p, c));
        if (size > 0) c.weight *= size_density(size, axis.least, axis.most, width);
        if (other > 0) c.weight *= size_density(other, axis.least_other, axis.most_other, std::hypot(other_sd, blur));
        if (side) c.weight *= 2;  // the side was sensed: the other side has half of the prior
        if (oriented && c.weight >= at.negligible) {
            const bool either = !axis_is_signed();
            const Vec3 n = either && dot(axis.direction, at.m) < 0 ? -axis.direction : axis.direction, u = any_across(n);
            const Vec3 across[2] = {u, cross(n, u)};
            const double bend[2] = {0, 0};
            c.weight *= (either ? 0.5 : 1) * tilt_density(across, bend, n, at.C, at.m, tilt_variance, c);
        }
        if (!(c.weight >= at.negligible)) continue;
        c.element = at.shape.number_of(axis);
        out.all.push_back(c);
    }
}

Sites RoundCentre::sites(const Shape& shape) const {
    std::vector<Site> out;
    for (const RoundAxis& axis : shape.axes) {
        if (!may_measure(axis, SIZE_REACH, 0)) continue;
        if (!is_line()) out.push_back({start(axis), axis.direction});
        for (size_t k = 0; k < HEIGHTS && is_line(); ++k) {
            const double t = static_cast<double>(k / 2) / (HEIGHTS / 2 - 1);
            out.push_back({axis.a + (t * axis.length) * axis.direction, k % 2 ? -axis.direction : axis.direction});
        }
    }
    return Sites(out);
}

// The landmark nearest to a point of the part frame, and the vector from it to the point; -1 if there is none.
int RoundCentre::nearest_landmark(const Shape& shape, const Vec3& p, Vec3& off) const {
    int best = -1;
    double least = 1e300;
    for (size_t k = 0; k < shape.axes.size(); ++k) {
        const RoundAxis& axis = shape.axes[k];
        if (!may_measure(axis, SIZE_REACH, 0)) continue;
        const Vec3 away = p - start(axis);
        const Vec3 from = is_line() ? away - dot(away, axis.direction) * axis.direction : away;
        if (squared(from) >= least) continue;
        least = squared(from);
        off = from;
        best = static_cast<int>(k);
    }
    return best;
}

double RoundCentre::rough_cost(const Shape& shape, const Pose& pose, double blur, double tilt) const {
    Vec3 off;
    const int k = nearest_landmark(shape, into_part(pose, at), off);
    if (k < 0) return ROUGH_CAP;
    double cost = squared(off) * (1 / (blur * blur));
    if (oriented) {
        const double cosine = dot(pose.R * shape.axes[k].direction, direction);
        cost += 2 * (1 - (axis_is_signed() ? cosine : std::fabs(cosine))) * (1 / (tilt * tilt));
    }
    return std::min(cost, ROUGH_CAP);
}

NearestElement RoundCentre::nearest(const Shape& shape, const Pose&, const Vec3& p, bool) const {
    NearestElement out;
    Vec3 off;
    if (nearest_landmark(shape, p, off) < 0) return out;
    out.possible = true;
    out.distance = norm(off);
    out.direction =
        out.distance > 1e-9 * shape.diagonal ? (1 / out.distance) * off : any_across(shape.axes[0].direction);
    return out;
}

NearestPlace RoundCentre::beside(const Shape& shape, const Pose& pose, const Vec3& p) const {
    Vec3 off;
    const int k = nearest_landmark(shape, p, off);
    if (k < 0) return nearest_on_surface(*this, shape, pose, p, offset, {}, false);  // the part has no such landmark
    NearestPlace out{};
    out.per_sd = std::sqrt(3 / (cov(0, 0) + cov(1, 1) + cov(2, 2) + 3 * extra));
    out.distance = norm(off);
    out.element = shape.number_of(shape.axes[k]);
    return out;
}

void RoundCentre::fill(const Columns& columns, size_t row) {
    columns.fill(*this, row);
    columns.set_direction(*this, row, columns.vector("normals", row));
    size = columns.number("sizes", row, 0, 1e300);
    size_sd = columns.number("size_sds", row, size > 0 ? 1e-12 : 0, 1e300);
    other = columns.number("others", row, 0, 1e300);
    other_sd = columns.number("other_sds", row, other > 0 ? 1e-12 : 0, 1e300);
    side = static_cast<int>(columns.number("material_sides", row, -1, 1));
    offset = columns.number("offsets", row, 0, 1e300);
}

}  // namespace tanteo
