// Lines of sight from one station (a camera, a theodolite), each through one of the known points of the part.
#include <cmath>

#include "normal.hpp"
#include "factors/registry.hpp"

namespace tanteo {

namespace {

// A ray with unit direction d from o observes one of K points c_i of the part. In the plane across d, the point
// off = c_i - o at the depth s = off . d has the angles r = (u . off, v . off) / s, so that per steradian
//   p(d | pose) = (1 - q) sum_i 1 / K N(r; 0, sigma^2 + (sigma_o / s)^2) + q / (4 pi),
// with the rate q of outliers, which have any direction. Shared errors z of the station shift o and turn all directions by
// L z, in the world.
class SightLines final : public PoseTerm {
  public:
    Vec3 origin;
    std::vector<Vec3> directions;
    std::vector<Vec3> points;  // in the part frame; candidates of every ray, or one for each ray
    bool one_each = false;
    double angle_sd = 1, origin_sd = 0, outlier_rate = 0.01;
    std::vector<double> root;  // 6 x 6 root L of the covariance of the station's errors; empty if there are none
    int first = 0;             // index of its first shared error

    int columns() const override { return root.empty() ? 0 : first + 6; }

    double add(const State& state, const Slope* slope) const override {
        double error[6] = {};
        for (size_t i = 0; i < 6 && !root.empty(); ++i)
            for (size_t k = 0; k < 6; ++k) error[i] += root[6 * i + k] * state.z[first + k];
        const Vec3 from = origin + load(error);
        const Mat3 turn = rotation(load(error + 3));
        double log = 0;
        std::vector<Observed> observed;
        for (size_t j = 0; j < directions.size(); ++j) {
            const Vec3 d = turn * directions[j];
            double sum = outlier_rate;
            observed.clear();
            const size_t count = one_each ? 1 : points.size();
            for (size_t i = 0; i < count; ++i) {
                const Observed one = observe(state.pose, from, d, points[one_each ? j : i], count);
                sum += one.density;
                if (slope && one.density > 1e-12) observed.push_back(one);
            }
            log += std::log(std::max(sum, 1e-300));
            for (const Observed& one : observed) add_slope(one, one.density / sum, state.pose, *slope);
        }
        return log;
    }

  private:
    struct Observed {
        double density = 0;  // relative to that of an outlier, with the rate of inliers
        Vec3 point, off;     // point in the part frame; vector from the station in the world
        double r[2] = {};    // angles over their standard deviation
        Vec3 by_point[2];    // derivatives of r by the point in the world
    };

    Observed observe(const Pose& pose, const Vec3& from, const Vec3& d, const Vec3& point, size_t count) const {
        Observed one;
        one.point = point;
        one.off = pose.R * point + pose.t - from;
        const double s = dot(one.off, d);
        if (!(s > 0)) return one;  // behind the station
        const double sd = std::hypot(angle_sd, origin_sd / s);
        const Vec3 u = any_across(d), across[2] = {u, cross(d, u)};
        for (int k = 0; k < 2; ++k) {
            const double angle = dot(across[k], one.off) / s;
            one.r[k] = angle / sd;
            one.by_point[k] = (1 / (s * sd)) * (across[k] - angle * d);
        }
        const double q = one.r[0] * one.r[0] + one.r[1] * one.r[1];
        one.density = (1 - outlier_rate) * 4 * PI * fast_exp(-0.5 * q - 2 * HALF_LOG_TWO_PI) / (sd * sd) / count;
        return one;
    }

    void add_slope(const Observed& one, double weight, const Pose& pose, const Slope& slope) const {
        int columns[12];
        const int count = root.empty() ? 6 : 12;
        for (int k = 0; k < count; ++k) columns[k] = k < 6 ? k : first + k;  // z begins at the sixth state
        for (int k = 0; k < 2; ++k) {
            double row[12] = {};
            const Vec3 g = one.by_point[k], in_part = transposed_times(pose.R, g);
            store(in_part, row);
            store(cross(one.point - slope.centre, in_part), row + 3);
            const Vec3 by_turn = cross(g, one.off);  // turning the directions turns the point inversely
            for (int z = 0; z < 6 && count > 6; ++z)
                for (int i = 0; i < 3; ++i) row[6 + z] += -g[i] * root[6 * i + z] + by_turn[i] * root[6 * (3 + i) + z];
            slope.add(-weight * one.r[k], weight, row, columns, count);
        }
    }
};

}  // namespace

static const RegisteredTerm registered("sight_lines", [](const Arrays& arrays, int first) {
    auto lines = std::make_shared<SightLines>();
    lines->origin = arrays.vectors("origin").at(0);
    lines->directions = arrays.vectors("directions");
    for (Vec3& d : lines->directions) {
        if (!(squared(d) > 0)) refuse_argument("directions", "expected some length, got zero");
        d = unit(d);
    }
    lines->points = arrays.vectors("points");
    lines->one_each = arrays.number("one_each", 0, 1) > 0;
    if (lines->points.empty() || (lines->one_each && lines->points.size() != lines->directions.size()))
        refuse_argument("points", "expected one or more, or one for each direction");
    lines->angle_sd = arrays.number("angle_sd", 1e-12, 10);
    lines->origin_sd = arrays.number("origin_sd", 0, 1e6);
    if (arrays.has("root")) lines->root = arrays.numbers("root", {6, 6});
    lines->outlier_rate = arrays.number("outlier_rate", 0, 1);
    lines->first = first;
    return lines;
});

}  // namespace tanteo
