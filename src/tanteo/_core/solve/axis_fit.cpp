#include "solve/axis_fit.hpp"

#include <algorithm>

namespace tanteo {

namespace {

constexpr int STEPS = 4;          // Gauss-Newton steps to the nearest axes and faces
constexpr double ALMOST = 1e-14;  // variance that keeps weights finite [m^2]
constexpr double NEVER = 1e300;

// Cost of a position beside an axis, or beside its point, with a covariance [nats].
double off_axis(const Vec3& off, const ModelAxis& axis, const Mat3& S) {
    if (axis.point) {
        double L[9], x[3] = {off.x, off.y, off.z};
        std::copy(S.m, S.m + 9, L);
        if (!cholesky(L, 3)) return NEVER;
        solve_cholesky(L, 3, x);
        return 0.5 * dot(off, load(x));
    }
    const Vec3 u = any_across(axis.along), v = cross(axis.along, u), Su = S * u;
    const double uu = dot(u, Su), uv = dot(v, Su), vv = dot(v, S * v), x = dot(off, u), y = dot(off, v);
    return 0.5 * (vv * x * x - 2 * uv * x * y + uu * y * y) / std::max(uu * vv - uv * uv, 1e-60);
}

}  // namespace

void AxisComparison::add_centre(PoseEquations& at, const SensedCentre& c, const ModelAxis& axis, const Pose& pose) {
    const Vec3 q = into_part(pose, c.at), off = q - axis.middle, u = any_across(axis.along), v = cross(axis.along, u);
    const double weight = 1 / (c.sd * c.sd + ALMOST);
    at.place(u, q, dot(off, u), weight);
    at.place(v, q, dot(off, v), weight);
    if (axis.point) at.place(axis.along, q, dot(off, axis.along), weight);
    if (!c.oriented()) return;
    const Vec3 m = transposed_times(pose.R, c.axis);
    const bool back = !axis.point && dot(m, axis.along) < 0;
    at.direction(back ? -m : m, axis.along, 1 / (c.tilt * c.tilt + AXIS_TURNED * AXIS_TURNED));
}

void AxisComparison::add_plane(PoseEquations& at, const SensedPlane& plane, const Pose& pose, const Spread& known) const {
    const PlaneMatch to = of_planes(plane, pose, known, known);
    if (!to.found) return;
    const Vec3 own = transposed_times(pose.R, plane.normal);
    at.place(to.normal, into_part(pose, plane.at), to.height, 1 / (plane.sd * plane.sd + ALMOST));
    at.direction(dot(own, to.normal) < 0 ? -own : own, to.normal, 1 / (plane.tilt * plane.tilt + AXIS_TURNED * AXIS_TURNED));
}

PlaneMatch AxisComparison::of_planes(SensedPlane plane, const Pose& pose, const Spread& known, const Spread& slack) const {
    const Vec3 n = transposed_times(pose.R, plane.normal), q = into_part(pose, plane.at);
    const Mat3 beside = slack.at(q);
    plane.span += 2 * SDS * std::sqrt(std::max(beside(0, 0) + beside(1, 1) + beside(2, 2), 0.0));
    plane.sd = std::sqrt(plane.sd * plane.sd + dot(n, known.at(q) * n));
    plane.tilt = std::sqrt(plane.tilt * plane.tilt + known.turned());
    return match_plane(faces, plane, plane.most, pose, 0, plane.at);
}

// The cheapest axis for a centre at an uncertain pose; slack: uncertainty of the pose along axes.
AxisComparison::Match AxisComparison::of_axes(int i, const Pose& pose, const Spread& known, const Spread& slack) const {
    const SensedCentre& c = scene.centres[i];
    const Vec3 q = into_part(pose, c.at), m = transposed_times(pose.R, c.axis);
    Mat3 S = known.at(q);
    for (int k = 0; k < 3; ++k) S(k, k) += c.sd * c.sd;
    const double tilt2 = c.tilt * c.tilt + AXIS_TURNED * AXIS_TURNED + known.turned();
    Match best{fits.most(i)};
    for (size_t a = 0; a < axes.size(); ++a) {
        const ModelAxis& axis = axes[a];
        double cost = fits.size(i, static_cast<int>(a));
        if (cost >= best.cost) continue;
        cost += off_axis(q - axis.middle, axis, S);
        if (cost < best.cost && c.oriented()) {
            const double cosine = dot(m, axis.along);
            cost += (1 - (axis.point ? cosine : std::fabs(cosine))) / tilt2;
        }
        if (cost < best.cost) best = {cost, static_cast<int>(a)};
    }
    return best;
}

double AxisComparison::cost(const Pose& pose, const Spread& known, const Spread& slack, double limit) const {
    double sum = 0;
    for (size_t i = 0; i < scene.centres.size() && sum < limit; ++i) sum += of_axes(static_cast<int>(i), pose, known, slack).cost;
    for (size_t k = 0; k < scene.planes.size() && sum < limit; ++k)
        sum += of_planes(scene.planes[k], pose, known, slack).cost;
    return sum;
}

PlanePose AxisComparison::refined(Pose pose, Spread known, double limit) const {
    PlanePose best{pose, cost(pose, Spread{}, known, limit)};
    const auto equations = [&](int) {
        PoseEquations at;
        for (size_t i = 0; i < scene.centres.size(); ++i) {
            const Match to = of_axes(static_cast<int>(i), pose, known, known);
            if (to.axis >= 0) add_centre(at, scene.centres[i], axes[to.axis], pose);
        }
        for (const SensedPlane& one : scene.planes) add_plane(at, one, pose, known);
        return at;
    };
    gauss_newton(STEPS, equations, [&](const double* step, const double* L) {
        known.set(L);
        pose = moved(pose, load(step), load(step + 3), Vec3{});
        const double here = cost(pose, Spread{}, known, limit);
        if (here < best.cost) best = {pose, here};
    });
    return best;
}

}  // namespace tanteo
