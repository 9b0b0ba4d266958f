// What does not depend on where single points were met: free-space rays, shared errors, the pose, a table.
#include <cstring>

#include "likelihood.hpp"

namespace tanteo {

namespace {

// The noise scale is known to a factor f: its log l has the density exp(-(l / 2 log f)^4), flat within f either way and
// next to nothing beyond f^4; z = l / log f. What is farther off is no noise, and has another cause.
constexpr double SCALE_NORM = 0.36908399149;  // log of its integral over z, over that of exp(-z^2 / 2)
constexpr double LEAST_TOLD = 0.74;     // one over its variance

// log of a rigid motion: xi with exp(xi) = (R, t), and how it follows a small motion from the right.
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

// How root * xi follows a small motion at the centre c: (v, w) there is (v + c x w, w) about the origin.
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

// Paths on which nothing was met; no gradient: a pose is in their way or it is not.
double Likelihood::add_rays(const State& state) {
    double log = 0;
    const int D = problem.shared;
    for (size_t k = 0; k < problem.rays.size(); ++k) {
        const FreeRay& ray = problem.rays[k];
        Vec3 origin = ray.origin, direction = ray.direction;
        for (int d = 0; d < D; ++d)
            for (int i = 0; i < 3; ++i) {
                origin[i] += problem.ray_shifts[(k * 3 + i) * D + d] * state.z[d];
                direction[i] += problem.ray_turns[(k * 3 + i) * D + d] * state.z[d];
            }
        const Vec3 start = into_part(state.pose, origin), along = transposed_times(state.pose.R, unit(direction));
        const double end = ray.length - 0.01 * shape.diagonal;
        const auto passes = [&](const Vec3& d) {
            int triangle = -1;
            if (shape.cast(start, d, end, &triangle) >= end) return true;
            return std::fabs(dot(shape.normals[triangle], d)) < ray.least_cosine - 1e-12;
        };
        double passed = passes(along) ? 1 : 0;
        if (passed == 0 && ray.slope > 0) {  // a cone: rays of equal moments with the disc, the middle one counts half
            const Vec3 u = any_across(along), v = cross(along, u);
            for (const Vec3& aside : {u, v, -u, -v})
                if (passes(unit(along + 2 * ray.slope * aside))) passed += 0.125;
        }
        log += std::log(problem.mean_rate + (1 - 2 * problem.mean_rate) * passed);
    }
    return log;
}

// Shared errors and noise scale are unit normal; the pose has a mixture of normal densities; the part stands on a table.
double Likelihood::add_priors(const State& state, bool with_slope) {
    const int K = problem.size();
    double log = 0;
    for (int k = 6; k < 6 + problem.shared; ++k) {
        log -= 0.5 * state.z[k - 6] * state.z[k - 6];
        if (!with_slope) continue;
        gradient[k] -= state.z[k - 6];
        information[k * K + k] += 1;
    }
    if (problem.scale_sd > 0) {
        const double z = state.z[problem.shared];
        log -= z * z * z * z / 16 + SCALE_NORM;
        if (with_slope) {
            gradient.back() -= z * z * z / 4;
            information.back() += std::max(0.75 * z * z, LEAST_TOLD);
        }
    }
    if (!problem.priors.empty()) log += add_pose_prior(state.pose, with_slope);
    if (problem.has_table) log += add_table(state.pose, with_slope);
    return log;
}

// Residuals r that count by a share, and how they follow small motions of the part: rows by v and w at the centre.
void Likelihood::add_residuals(double share, const double* r, const double* rows, int count) {
    const int K = problem.size();
    for (int i = 0; i < count; ++i)
        for (int a = 0; a < 6; ++a) {
            gradient[a] -= share * r[i] * rows[6 * i + a];
            for (int b = 0; b <= a; ++b) information[a * K + b] += share * rows[6 * i + a] * rows[6 * i + b];
        }
}

// log sum_k exp(w_k - |L_k log(T_k^-1 T)|^2 / 2)
double Likelihood::add_pose_prior(const Pose& pose, bool with_slope) {
    const size_t count = problem.priors.size();
    std::vector<double> logs(count), r(6 * count), rows(with_slope ? 36 * count : 0);
    double top = -1e300, sum = 0;
    for (size_t k = 0; k < count; ++k) {
        const PosePrior& prior = problem.priors[k];
        double xi[6], J[36];
        log_motion(transposed(prior.mean.R) * pose.R, transposed_times(prior.mean.R, pose.t - prior.mean.t), xi, J);
        double q = 0;
        for (int i = 0; i < 6; ++i) {
            double& ri = r[6 * k + i];
            for (int a = 0; a < 6; ++a) ri += prior.root[6 * i + a] * xi[a];
            q += ri * ri;
        }
        logs[k] = prior.log_weight - 0.5 * q;
        top = std::max(top, logs[k]);
        if (with_slope) root_by_motion(prior, J, shape.centre, &rows[36 * k]);
    }
    for (const double l : logs) sum += std::exp(l - top);
    for (size_t k = 0; with_slope && k < count; ++k) {
        const double share = std::exp(logs[k] - top) / sum;
        if (share > 1e-9) add_residuals(share, &r[6 * k], &rows[36 * k], 6);
    }
    return top + std::log(sum);
}

// Height of the lowest point over the table, in standard deviations.
double Likelihood::add_table(const Pose& pose, bool with_slope) {
    const Vec3 n = transposed_times(pose.R, problem.table.normal);
    double least = 1e300;
    Vec3 lowest;
    for (const Vec3& v : shape.hull) {
        const double height = dot(n, v);
        if (height < least) {
            least = height;
            lowest = v;
        }
    }
    const double r = (least + dot(pose.t - problem.table.point, problem.table.normal)) / problem.table.sd;
    if (with_slope) {
        double row[6];
        store((1 / problem.table.sd) * n, row);
        store((1 / problem.table.sd) * cross(lowest - shape.centre, n), row + 3);
        add_residuals(1, &r, row, 1);
    }
    return -0.5 * r * r;
}

}  // namespace tanteo
