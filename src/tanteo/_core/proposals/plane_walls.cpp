// Two points on walls of cylinders along a line: with their normals they determine two axes.
#include <cmath>

#include "proposals/plane_search.hpp"

namespace tanteo {

namespace {

constexpr double ALONG = 0.01;  // sine up to which a cylinder is along a line
constexpr int TURNS = 8;        // number of turns about an axis with unknown rotation
constexpr double PI = 3.14159265358979;

Vec3 across(const Vec3& x, const Vec3& direction) { return x - dot(x, direction) * direction; }

}  // namespace

void PlaneSearch::on_walls() {
    for (size_t i = 0; i < 2 * model.size(); ++i) {
        if (shifts_of(base->first, i).empty()) continue;
        for (const ModelRound& one : faces->rounds)
            for (const ModelRound& other : faces->rounds)
                if (norm(across(one.axis, direction_of(i))) < ALONG && norm(across(other.axis, direction_of(i))) < ALONG)
                    on_two_walls(i, one, other);
    }
}

// The distance of both axes in the part must agree with that of the points. If both are one axis, the rotation of the part
// about it is unknown.
void PlaneSearch::on_two_walls(size_t i, const ModelRound& one, const ModelRound& other) {
    const SensedPlane &a = sensed[base->second], &b = sensed[base->third];
    const Vec3 &normal = lines[base->first].normal, v = direction_of(i);
    const Vec3 first = a.at - one.sign * one.radius * unit(across(a.normal, normal));
    const Vec3 second = b.at - other.sign * other.radius * unit(across(b.normal, normal));
    const Vec3 sensed_gap = across(second - first, normal), model_gap = across(other.middle - one.middle, v);
    const double known = SDS * std::hypot(std::hypot(a.sd, b.sd), std::hypot(one.radius * a.tilt, other.radius * b.tilt));
    const double apart = norm(model_gap);
    if (std::fabs(norm(sensed_gap) - apart) > known) return;
    const bool determined = apart > known;
    const Vec3 towards = determined ? unit(model_gap) : any_across(v), beside = cross(v, towards);
    const Mat3 frame = transposed(axes(normal, determined ? unit(sensed_gap) : any_across(normal)));
    for (int turn = 0; turn < (determined ? 1 : TURNS); ++turn) {
        const double angle = 2 * PI * turn / TURNS;
        const Mat3 attitude = axes(v, std::cos(angle) * towards + std::sin(angle) * beside) * frame;
        turned_to(i, attitude, {first, second}, {one.middle, other.middle});
    }
}

// Tries poses with an attitude and two points of the world on two axes of the part.
void PlaneSearch::turned_to(size_t i, const Mat3& attitude, const Pair& places, const Pair& axes_at) {
    into = attitude;
    towards.assign(lines.size(), Vec3{});
    double sum = shifts_of(base->first, i)[0].cost, others = 0;
    for (int j = 0; j < static_cast<int>(lines.size()) && sum + others < limit; ++j)
        if (j != base->first) others += other(j, nullptr);
    if (sum + others >= limit) return;
    prepare();
    const Vec3 v = direction_of(i), u = any_across(v), direction[3] = {v, u, cross(v, u)};
    along[0] = shifts_of(base->first, i);
    place(0, base->first, v);
    for (int m = 1; m < 3; ++m) {
        const Vec3 off = 0.5 * (into * (places[0] + places[1]) - (axes_at[0] + axes_at[1]));
        along[m].assign(1, {dot(direction[m], off), 0});
    }
    placed(direction, others);
}

}  // namespace tanteo
