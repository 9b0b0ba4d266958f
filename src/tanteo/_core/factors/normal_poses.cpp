#include "factors/normal_poses.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace tanteo {

namespace {

// log of a rigid motion: xi with exp(xi) = (R, t), and its derivatives J by a small motion from the right.
void log_motion(const Mat3& R, const Vec3& t, double xi[6], double J[36]) {
    const Vec3 w = rotation_vector(R);
    const double t2 = squared(w), angle = std::sqrt(t2);
    // V^-1 = I - W / 2 + c W^2
    const double c = angle < 1e-3 ? 1.0 / 12 + t2 / 720
                                  : (1 - 0.5 * angle * std::cos(0.5 * angle) / std::max(std::sin(0.5 * angle), 1e-300)) / t2;
    const Vec3 wt = cross(w, t), v = t - 0.5 * wt + c * cross(w, wt);
    store(v, xi);
    store(w, xi + 3);
    double ad[36] = {0}, power[36], next[36];
    const double hat_w[9] = {0, -w.z, w.y, w.z, 0, -w.x, -w.y, w.x, 0};
    const double hat_v[9] = {0, -v.z, v.y, v.z, 0, -v.x, -v.y, v.x, 0};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            ad[6 * i + j] = ad[6 * (3 + i) + 3 + j] = hat_w[3 * i + j];
            ad[6 * i + 3 + j] = hat_v[3 * i + j];
        }
    const double series[9] = {1, 0.5, 1.0 / 12, 0, -1.0 / 720, 0, 1.0 / 30240, 0, -1.0 / 1209600};  // Bernoulli
    for (int i = 0; i < 36; ++i) power[i] = J[i] = i % 7 == 0 ? 1 : 0;
    for (int k = 1; k < 9; ++k) {
        for (int i = 0; i < 6; ++i)
            for (int j = 0; j < 6; ++j) {
                next[6 * i + j] = 0;
                for (int l = 0; l < 6; ++l) next[6 * i + j] += power[6 * i + l] * ad[6 * l + j];
            }
        std::memcpy(power, next, sizeof power);
        for (int i = 0; i < 36; ++i) J[i] += series[k] * power[i];
    }
}

// Derivatives of root * xi by a small motion about the centre c: (v, w) there is (v + c x w, w) about the origin.
void root_by_motion(const PosePrior& prior, const double* J, const Vec3& c, double* rows) {
    const double hat[9] = {0, -c.z, c.y, c.z, 0, -c.x, -c.y, c.x, 0};
    for (int i = 0; i < 6; ++i) {
        double LJ[6] = {0}, *row = rows + 6 * i;
        for (int a = 0; a < 6; ++a)
            for (int b = 0; b < 6; ++b) LJ[b] += prior.root[6 * i + a] * J[6 * a + b];
        for (int b = 0; b < 3; ++b) {
            row[b] = LJ[b];
            row[3 + b] = LJ[3 + b];
            for (int a = 0; a < 3; ++a) row[3 + b] += LJ[a] * hat[3 * a + b];
        }
    }
}

}  // namespace

// The whitened residuals of a pose, and the derivatives of the tangent vector by a small motion from the right.
static double residuals(const PosePrior& normal, const Pose& pose, double r[6], double J[36]) {
    double xi[6], q = 0;
    log_motion(transposed(normal.mean.R) * pose.R, transposed_times(normal.mean.R, pose.t - normal.mean.t), xi, J);
    for (int i = 0; i < 6; ++i) {
        r[i] = 0;
        for (int a = 0; a < 6; ++a) r[i] += normal.root[6 * i + a] * xi[a];
        q += r[i] * r[i];
    }
    return q;
}

void nearest_normal_pose(const std::vector<PosePrior>& normals, const Pose& pose, const Vec3& centre, double r[6],
                         double rows[36]) {
    double best = -1e300, own[6], J[36];
    for (const PosePrior& normal : normals) {
        const double log = normal.log_weight - 0.5 * residuals(normal, pose, own, J);
        if (log <= best) continue;
        best = log;
        std::copy_n(own, 6, r);
        root_by_motion(normal, J, centre, rows);
    }
}

double add_normal_poses(const std::vector<PosePrior>& normals, const Pose& pose, const Slope* slope) {
    const size_t count = normals.size();
    std::vector<double> logs(count), r(6 * count), rows(slope ? 36 * count : 0);
    double top = -1e300, sum = 0;
    for (size_t k = 0; k < count; ++k) {
        const PosePrior& normal = normals[k];
        double J[36];
        const double q = residuals(normal, pose, &r[6 * k], J);
        logs[k] = normal.log_weight - 0.5 * q;
        top = std::max(top, logs[k]);
        if (slope) root_by_motion(normal, J, slope->centre, &rows[36 * k]);
    }
    for (const double l : logs) sum += std::exp(l - top);
    const int pose_columns[6] = {0, 1, 2, 3, 4, 5};
    for (size_t k = 0; slope && k < count; ++k) {
        const double share = std::exp(logs[k] - top) / sum;
        if (share < 1e-9) continue;
        for (int i = 0; i < 6; ++i)
            slope->add(-share * r[6 * k + i], share, &rows[36 * k + 6 * i], pose_columns, 6);
    }
    return top + std::log(sum);
}

}  // namespace tanteo
