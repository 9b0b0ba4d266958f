#include "factors/stable_poses.hpp"

#include <algorithm>
#include <cmath>

#include "normal.hpp"

namespace tanteo {

namespace {

constexpr double POLE = 0.05;  // sine of the angle to the axis of revolution below which a normal is at its pole

struct Residuals {
    double r[3];
    Vec3 by_turn[3];  // derivatives by w
    int count = 0;
    double log_norm = 0;  // log normalization of the density of directions

    void add(double value, double sd, const Vec3& turn) {
        r[count] = value / sd;
        by_turn[count++] = (1 / sd) * turn;
    }
};

}  // namespace

StablePoses::StablePoses(std::vector<StablePose> poses_, const Vec3& centroid_, Freedom freedom_, const Vec3& axis_,
                         const Pose& T_world_table, double height_sd_, double tilt_sd_, double area)
    : poses(std::move(poses_)),
      centroid(centroid_),
      freedom(freedom_),
      axis(unit(axis_)),
      point(T_world_table.t),
      normal(T_world_table.R * Vec3{0, 0, 1}),
      height_sd(height_sd_),
      tilt_sd(tilt_sd_),
      log_place(-std::log(2 * PI * area)) {}

double StablePoses::add(const State& state, const Slope* slope) const {
    const Mat3& R = state.pose.R;
    const Vec3 u = transposed_times(R, normal);
    const double height = dot(R * centroid + state.pose.t - point, normal);
    std::vector<double> logs;
    std::vector<Residuals> all;
    double top = -1e300, sum = 0;
    for (const StablePose& pose : poses) {
        Residuals tilt;
        // u moves by u x w with a turn w of the part
        const auto along = [&](const Vec3& e) { tilt.add(dot(u, e), tilt_sd, cross(e, u)); };
        const double c = dot(pose.up, axis), s = std::sqrt(std::max(1 - c * c, 0.0));
        if (freedom == Freedom::AXIS && s > POLE) {
            tilt.add((c - dot(u, axis)) / s, tilt_sd, (-1 / s) * cross(axis, u));
            tilt.log_norm = -std::log(2 * PI * s) - std::log(std::sqrt(2 * PI) * tilt_sd);
        } else if (freedom == Freedom::ALL) {
            tilt.log_norm = -std::log(4 * PI);
        } else {
            const Vec3 e = any_across(pose.up);
            // opposite normals have equal residuals: the opposite one gets the largest residual
            if (dot(u, pose.up) < 0) tilt.log_norm = -0.5 / (tilt_sd * tilt_sd);
            along(e);
            along(cross(pose.up, e));
            tilt.log_norm -= std::log(2 * PI * tilt_sd * tilt_sd);
        }
        const double h = (height - pose.height) / height_sd;
        double q = h * h;
        for (int i = 0; i < tilt.count; ++i) q += tilt.r[i] * tilt.r[i];
        logs.push_back(pose.log_weight + tilt.log_norm - 0.5 * q);
        top = std::max(top, logs.back());
        all.push_back(tilt);
    }
    for (const double log : logs) sum += std::exp(log - top);
    if (slope) {
        const int columns[6] = {0, 1, 2, 3, 4, 5};
        const Vec3 lever = cross(centroid - slope->centre, u);
        for (size_t k = 0; k < poses.size(); ++k) {
            const double share = std::exp(logs[k] - top) / sum;
            if (share < 1e-9) continue;
            double row[6];
            store((1 / height_sd) * u, row);
            store((1 / height_sd) * lever, row + 3);
            slope->add(-share * (height - poses[k].height) / height_sd, share, row, columns, 6);
            for (int i = 0; i < all[k].count; ++i) {
                store({}, row);
                store(all[k].by_turn[i], row + 3);
                slope->add(-share * all[k].r[i], share, row, columns, 6);
            }
        }
    }
    return log_place - std::log(std::sqrt(2 * PI) * height_sd) + top + std::log(sum);
}

}  // namespace tanteo
