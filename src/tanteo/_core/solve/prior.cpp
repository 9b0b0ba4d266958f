// Terms that do not depend on single points: free-space rays, shared errors, the pose, a table.
#include "factors/normal_poses.hpp"
#include "solve/likelihood.hpp"

namespace tanteo {

namespace {

// The noise scale is known to a factor f: its log l has the density exp(-(l / 2 log f)^4), flat within f in both directions
// and negligible beyond f^4; z = l / log f. Larger residuals have another cause than noise.
constexpr double SCALE_NORM = 0.36908399149;  // log of its integral over z, over that of exp(-z^2 / 2)
constexpr double LEAST_INFORMATION = 0.74;  // one over its variance

}  // namespace

// Free-space rays; without a gradient, because a pose blocks them or not.
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
            for (const Vec3& across : {u, v, -u, -v})
                if (passes(unit(along + 2 * ray.slope * across))) passed += 0.125;
        }
        log += std::log(problem.mean_rate + (1 - 2 * problem.mean_rate) * passed);
    }
    return log;
}

// Priors: shared errors are unit normal, the noise scale is flat within a factor, the pose has a mixture of normal
// densities, and the part may touch planes.
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
            information.back() += std::max(0.75 * z * z, LEAST_INFORMATION);
        }
    }
    log_pose = problem.priors.empty() ? 0 : add_pose_prior(state.pose, with_slope);
    for (const Table& table : problem.tables) log_pose += add_table(table, state.pose, with_slope);
    return log + log_pose;
}

// Adds residuals r with a weight, and their derivatives by small motions of the part: rows by v and w at the centre.
void Likelihood::add_residuals(double share, const double* r, const double* rows, int count) {
    const int K = problem.size();
    for (int i = 0; i < count; ++i)
        for (int a = 0; a < 6; ++a) {
            gradient[a] -= share * r[i] * rows[6 * i + a];
            for (int b = 0; b <= a; ++b) information[a * K + b] += share * rows[6 * i + a] * rows[6 * i + b];
        }
}

// The pose has a mixture of normal densities.
double Likelihood::add_pose_prior(const Pose& pose, bool with_slope) {
    const Slope slope{shape.centre, problem.size(), gradient.data(), information.data()};
    return add_normal_poses(problem.priors, pose, with_slope ? &slope : nullptr);
}

// Height of the lowest point over the table, in standard deviations.
double Likelihood::add_table(const Table& table, const Pose& pose, bool with_slope) {
    double row[6];
    const double r = height_over_table(shape, table, pose, row) / table.sd;
    if (with_slope) {
        for (double& x : row) x /= table.sd;
        add_residuals(1, &r, row, 1);
    }
    return -0.5 * r * r;
}

double height_over_table(const Shape& shape, const Table& table, const Pose& pose, double row[6]) {
    const Vec3 n = transposed_times(pose.R, table.normal);
    double least = 1e300;
    Vec3 lowest;
    for (const Vec3& v : shape.hull) {
        const double height = dot(n, v);
        if (height < least) {
            least = height;
            lowest = v;
        }
    }
    store(n, row);
    store(cross(lowest - shape.centre, n), row + 3);
    return least + dot(pose.t - table.point, table.normal);
}

}  // namespace tanteo
