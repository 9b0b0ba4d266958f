#include "proposals/plane_base.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

namespace tanteo {

namespace {

constexpr double PI = 3.14159265358979;

Mat3 inverse(const Mat3& A) {
    const Vec3 a{A(0, 0), A(1, 0), A(2, 0)}, b{A(0, 1), A(1, 1), A(2, 1)}, c{A(0, 2), A(1, 2), A(2, 2)};
    const Vec3 bc = cross(b, c), ca = cross(c, a), ab = cross(a, b);
    const double s = 1 / dot(a, bc);
    return {{s * bc.x, s * bc.y, s * bc.z, s * ca.x, s * ca.y, s * ca.z, s * ab.x, s * ab.y, s * ab.z}};
}

void add_line(const SensedLine& line, Mat3& information) {
    for (int m = 0; m < 3; ++m) information(m, m) += line.weight();
    add_outer(information, -line.weight(), line.normal, line.normal);
}

PlaneBase of_lines(const std::vector<SensedLine>& lines, int first, int second, int third) {
    const SensedLine &a = lines[first], &b = lines[second];
    const double angle = std::acos(std::clamp(dot(a.normal, b.normal), -1.0, 1.0)), tolerance = agreement(a.tilt, b.tilt);
    PlaneBase out{};
    out.first = first;
    out.second = second;
    out.third = third;
    out.low = std::cos(std::min(angle + tolerance, PI));
    out.high = std::cos(std::max(angle - tolerance, 0.0));
    out.frame = transposed(axes(a.normal, b.normal));
    const double tilt = std::hypot(a.tilt, b.tilt / norm(cross(a.normal, b.normal)));
    Mat3 information;
    for (const SensedLine& line : lines) {
        out.near.push_back(std::cos(std::min(agreement(tilt, line.tilt), 1.5)));
        add_line(line, information);
    }
    out.covariance = inverse(information);
    return out;
}

// Cylinders that do not contain each other are farther apart than their radii, so that the turn about the line has at most
// the standard deviation of the worse of the two normals.
PlaneBase of_walls(const std::vector<SensedPlane>& sensed, const std::vector<SensedLine>& lines, int line, int one, int other) {
    const SensedLine& own = lines[line];
    PlaneBase out{};
    out.walls = true;
    out.first = line;
    out.second = one;
    out.third = other;
    const double turn = std::max(sensed[one].tilt, sensed[other].tilt) + MADE;
    for (const SensedLine& each : lines)
        out.near.push_back(std::cos(std::min(agreement(std::hypot(own.tilt, turn), each.tilt), 1.5)));
    Mat3 information;
    add_line(own, information);
    add_outer(information, 1 / (turn * turn), own.normal, own.normal);
    out.covariance = inverse(information);
    return out;
}

// Sets the remaining uncertainty of each plane at the attitude. All planes share its error of three numbers; the variance is
// inflated by a third of the number of planes, as if the error were independent, so that costs are lower bounds.
void set_uncertainties(const std::vector<SensedPlane>& sensed, PlaneBase& base) {
    const double share = std::max(sensed.size() / 3.0, 1.0);
    base.spread = share * (base.covariance(0, 0) + base.covariance(1, 1) + base.covariance(2, 2)) / 3;
    const Vec3 middle = middle_of(sensed);
    for (const SensedPlane& plane : sensed) {
        const Vec3 lever = cross(plane.at - middle, plane.normal);
        PlaneBase::Known one{};
        one.variance = plane.sd * plane.sd + share * dot(lever, base.covariance * lever);
        one.tilt2 = plane.tilt * plane.tilt + base.spread + MADE * MADE;
        one.near = std::cos(std::min(SDS * std::sqrt(one.tilt2), 1.5));
        one.reach = 0.5 * plane.span + SDS * std::sqrt(one.variance);
        base.planes.push_back(one);
    }
}

}  // namespace

Mat3 axes(const Vec3& a, const Vec3& b) {
    const Vec3 z = unit(cross(a, b)), y = cross(z, a);
    return {{a.x, y.x, z.x, a.y, y.y, z.y, a.z, y.z, z.z}};
}

Vec3 middle_of(const std::vector<SensedPlane>& sensed) {
    Vec3 out;
    for (const SensedPlane& one : sensed) out += (1.0 / sensed.size()) * one.at;
    return out;
}

std::vector<PlaneBase> plane_bases(const std::vector<SensedPlane>& sensed, const std::vector<SensedLine>& lines,
                                   const std::vector<int>& triples, const std::vector<int>& walls) {
    std::vector<int> of(sensed.size());
    for (size_t j = 0; j < lines.size(); ++j)
        for (const auto& one : lines[j].members) of[one.plane] = static_cast<int>(j);
    std::set<std::array<int, 3>> done;
    std::vector<PlaneBase> out;
    for (size_t k = 0; k + 2 < triples.size(); k += 3) {
        const int first = of[triples[k]], second = of[triples[k + 1]], third = triples[k + 2] < 0 ? -1 : of[triples[k + 2]];
        if (first == second || second == third || third == first) continue;
        if (done.insert({std::min(first, second), std::max(first, second), third}).second)
            out.push_back(of_lines(lines, first, second, third));
    }
    for (size_t k = 0; k + 2 < walls.size(); k += 3)
        if (walls[k + 1] != walls[k + 2]) out.push_back(of_walls(sensed, lines, of[walls[k]], walls[k + 1], walls[k + 2]));
    for (PlaneBase& one : out) set_uncertainties(sensed, one);
    return out;
}

}  // namespace tanteo
