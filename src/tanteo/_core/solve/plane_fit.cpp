#include "solve/plane_fit.hpp"

#include <algorithm>
#include <cmath>

namespace tanteo {

namespace {

constexpr int STEPS = 4;        // Gauss-Newton steps
constexpr double FAR = 1e3;     // weak prior on a shift [m] and on a turn [rad]: it only keeps the equations solvable
constexpr double ROUND = 2e-4;  // typical distance of a cylinder from its mesh [m]

}  // namespace

WallMatch on_wall(const ModelRound& round, const Vec3& normal, const Vec3& point, double variance, double tilt2, double most) {
    WallMatch out{most, false, {}, 0};
    const Vec3 off = point - round.middle;
    const double t = dot(off, round.axis), v = variance + ROUND * ROUND, beyond = std::fabs(t) - round.half;
    if (beyond > 0 && beyond * beyond > SDS * SDS * v) return out;
    const Vec3 across = off - t * round.axis;
    const double d2 = squared(across), c = round.sign * dot(normal, across);
    if (c <= 0) return out;
    // the normal of the wall turns with the position of the point about the axis
    const double turn2 = tilt2 + v / (round.radius * round.radius);
    const double d = std::sqrt(d2), h = d - round.radius, turned = 1 - c / d, cost = 0.5 * h * h / v + turned / turn2;
    if (!(cost < most) || turned > 0.5 * SDS * SDS * turn2) return out;
    return {cost, true, round.sign / d * across, round.sign * h};
}

PlaneMatch match_plane(const ModelFaces& faces, const SensedPlane& plane, double most, const Pose& pose, double turned,
                       const Vec3& about) {
    const Vec3 n = transposed_times(pose.R, plane.normal), p = into_part(pose, plane.at);
    const double tilt2 = plane.tilt * plane.tilt + turned * turned + MADE * MADE;
    const double lever = norm(plane.at - about), sd2 = plane.sd * plane.sd + turned * turned * lever * lever;
    const double near = std::cos(std::min(SDS * std::sqrt(tilt2), 1.5));
    PlaneMatch best{most, false, {}, 0, {}, 0};
    for (const ModelPlane& face : faces.planes) {
        double c = dot(n, face.normal);
        if (!plane.sided) c = std::fabs(c);
        if (c < near) continue;
        const Vec3 off = p - face.centre;
        const double h = dot(off, face.normal), h2 = h * h, cost = 0.5 * h2 / sd2 + (1 - c) / tilt2;
        if (!(cost < best.cost)) continue;
        const double reach = face.reach + 0.5 * plane.span + SDS * std::sqrt(sd2);
        if (squared(off) - h2 > reach * reach) continue;
        best = {cost, true, face.normal, h, {}, 0};
    }
    for (size_t r = 0; plane.alone && r < faces.rounds.size(); ++r) {
        const ModelRound& round = faces.rounds[r];
        const WallMatch wall = on_wall(round, n, p, sd2, tilt2, best.cost);
        if (wall.found)
            best = {wall.cost, true, wall.normal, wall.height, round.axis, round.sign / (round.radius + round.sign * wall.height)};
    }
    return best;
}

NormalEquations<6> PlaneFit::equations(const Pose& pose, double turned, const Vec3& about) const {
    NormalEquations<6> at;
    at.add_weak_prior(FAR, FAR);
    for (size_t k = 0; k < sensed.size(); ++k) {
        const SensedPlane& plane = sensed[k];
        const PlaneMatch to = match_plane(faces, plane, most[k], pose, turned, about);
        if (!to.found) continue;
        const Vec3 p = into_part(pose, plane.at), &n = to.normal;
        const Vec3 own = transposed_times(pose.R, plane.normal), turn = cross(p, n);
        const double J[6] = {-n.x, -n.y, -n.z, -turn.x, -turn.y, -turn.z};
        at.add(J, to.height, 1 / (plane.sd * plane.sd + 1e-14));
        add_tilt(to, dot(own, n) < 0 ? -own : own, p, 1 / (plane.tilt * plane.tilt + MADE * MADE), at);
    }
    return at;
}

// The sensed normal turns by -w x n in the part frame. The normal of a wall turns as the point moves about its axis.
void PlaneFit::add_tilt(const PlaneMatch& to, const Vec3& own, const Vec3& at, double weight,
                        NormalEquations<6>& equations) const {
    const Vec3 first = to.bend != 0 ? to.axis : any_across(to.normal), second = cross(to.normal, first);
    for (int k = 0; k < 2; ++k) {
        const Vec3& e = k ? second : first;
        const double bend = k ? to.bend : 0;
        const Vec3 turn = cross(own, e), moved = cross(at, e);
        const double K[6] = {bend * e.x,           bend * e.y,           bend * e.z,
                             bend * moved.x - turn.x, bend * moved.y - turn.y, bend * moved.z - turn.z};
        equations.add(K, dot(own, e), weight);
    }
}

PlanePose PlaneFit::refined(Pose pose, double turned, const Vec3& about) const {
    gauss_newton(STEPS, [&](int) { return equations(pose, turned, about); }, [&](const double* step, const double*) {
        pose = moved(pose, load(step), load(step + 3), Vec3{});
        turned *= 0.25;
    });
    double sum = 0;
    for (size_t k = 0; k < sensed.size(); ++k) sum += match_plane(faces, sensed[k], most[k], pose, 0, about).cost;
    return {pose, sum};
}

}  // namespace tanteo
