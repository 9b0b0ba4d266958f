// Two points of the walls of cylinders along a line: with their normals they tell where two axes are.
#include <cmath>

#include "plane_search.hpp"

namespace tanteo {

namespace {

constexpr double ALONG = 0.01;  // sine up to which a cylinder is along a line

Vec3 across(const Vec3& x, const Vec3& way) { return x - dot(x, way) * way; }

}  // namespace

void PlaneSearch::on_walls() {
    for (size_t i = 0; i < 2 * model.size(); ++i) {
        if (ways(base->first, i).empty()) continue;
        for (const ModelRound& one : faces->rounds)
            for (const ModelRound& other : faces->rounds)
                if (&one != &other && norm(across(one.axis, way(i))) < ALONG && norm(across(other.axis, way(i))) < ALONG)
                    on_two_walls(i, one, other);
    }
}

void PlaneSearch::on_two_walls(size_t i, const ModelRound& one, const ModelRound& other) {
    const SensedPlane &a = sensed[base->second], &b = sensed[base->third];
    const Vec3 &normal = lines[base->first].normal, v = way(i);
    const Vec3 first = a.at - one.sign * one.radius * unit(across(a.normal, normal));
    const Vec3 second = b.at - other.sign * other.radius * unit(across(b.normal, normal));
    const Vec3 sensed_way = across(second - first, normal), model_way = across(other.middle - one.middle, v);
    const double apart = norm(model_way), sd = std::hypot(std::hypot(a.sd, b.sd), std::hypot(one.radius * a.tilt, other.radius * b.tilt));
    if (apart < SDS * sd || std::fabs(norm(sensed_way) - apart) > SDS * sd) return;
    into = axes(v, unit(model_way)) * transposed(axes(normal, unit(sensed_way)));
    towards.assign(lines.size(), Vec3{});
    double others = 0;
    for (int j = 0; j < static_cast<int>(lines.size()) && ways(base->first, i)[0].cost + others < limit; ++j)
        if (j != base->first) others += this->other(j, nullptr);
    if (ways(base->first, i)[0].cost + others >= limit) return;
    prepare();
    const Vec3 direction[3] = {v, unit(model_way), cross(v, unit(model_way))};
    along[0] = ways(base->first, i);
    place(0, base->first, v);
    for (int m = 1; m < 3; ++m) {
        const double from = dot(direction[m], into * first - one.middle), to = dot(direction[m], into * second - other.middle);
        along[m].assign(1, {0.5 * (from + to), 0});
    }
    placed(direction, others);
}

}  // namespace tanteo
