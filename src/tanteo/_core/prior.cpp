// What does not depend on where single points were met: free-space rays, shared errors, the pose, a table.
#include "likelihood.hpp"

namespace tanteo {

namespace {

// The noise scale is known to a factor f: its log l has the density exp(-(l / 2 log f)^4), flat within f either way and
// next to nothing beyond f^4; z = l / log f. What is farther off is no noise, and has another cause.
constexpr double SCALE_NORM = 0.36908399149;  // log of its integral over z, over that of exp(-z^2 / 2)
constexpr double LEAST_TOLD = 0.74;     // one over its variance

// log of a rigid motion: xi with exp(xi) = (R, t), and how it follows a small motion from the right.
void log_motion(const Mat3& R, const Vec3& t, Matrix<6, 1>& xi, Matrix<6, 6>& J) {
    const Vec3 w = rotation_vector(R);
    const double t2 = squared(w), angle = std::sqrt(t2);
    // V^-1 = I - W / 2 + c W^2
    const double c = angle < 1e-3 ? 1.0 / 12 + t2 / 720
                                  : (1 - 0.5 * angle * std::cos(0.5 * angle) / std::max(std::sin(0.5 * angle), 1e-300)) / t2;
    const Vec3 wt = cross(w, t), v = t - 0.5 * wt + c * cross(w, wt);
    store(v, xi.m);
    store(w, xi.m + 3);
    const Mat3 W = hat(w);
    Matrix<6, 6> ad;
    ad.set(0, 0, W);
    ad.set(0, 3, hat(v));
    ad.set(3, 3, W);
    // J = sum_k B_k / k! ad^k, with the numbers of Bernoulli: but for k = 1, the odd ones are zero
    const double even[4] = {1.0 / 12, -1.0 / 720, 1.0 / 30240, -1.0 / 1209600};
    const Matrix<6, 6> ad2 = ad * ad;
    Matrix<6, 6> power = ad2;
    J = identity_of<6>();
    J += 0.5 * ad;
    for (int k = 0; k < 4; ++k) {
        J += even[k] * power;
        if (k < 3) power = power * ad2;
    }
}

// How a small motion about the origin follows one about the centre c: (v, w) there is (v + c x w, w).
Matrix<6, 6> about_centre(const Vec3& c) {
    Matrix<6, 6> out = identity_of<6>();
    out.set(0, 3, hat(c));
    return out;
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

// Residuals that count by a share: their J' r and J' J by v and w of the part at its centre.
void Likelihood::add_residuals(double share, const Matrix<6, 1>& Jr, const Matrix<6, 6>& JJ) {
    const int K = problem.size();
    for (int a = 0; a < 6; ++a) {
        gradient[a] -= share * Jr[a];
        for (int b = 0; b <= a; ++b) information[a * K + b] += share * JJ(a, b);
    }
}

// log sum_k exp(w_k - |L_k log(T_k^-1 T)|^2 / 2)
double Likelihood::add_pose_prior(const Pose& pose, bool with_slope) {
    struct Component {
        Matrix<6, 1> r;
        Matrix<6, 6> J;
        double log;
    };
    const Matrix<6, 6> to_centre = about_centre(shape.centre);
    std::vector<Component> all(problem.priors.size());
    double top = -1e300, sum = 0;
    for (size_t k = 0; k < all.size(); ++k) {
        const PosePrior& prior = problem.priors[k];
        Matrix<6, 1> xi;
        Matrix<6, 6> J;
        log_motion(transposed(prior.mean.R) * pose.R, transposed_times(prior.mean.R, pose.t - prior.mean.t), xi, J);
        all[k].r = prior.root * xi;
        if (with_slope) all[k].J = prior.root * J * to_centre;
        all[k].log = prior.log_weight - 0.5 * squared(all[k].r);
        top = std::max(top, all[k].log);
    }
    for (const Component& one : all) sum += std::exp(one.log - top);
    for (size_t k = 0; with_slope && k < all.size(); ++k) {
        const double share = std::exp(all[k].log - top) / sum;
        const Matrix<6, 6> Jt = transposed(all[k].J);
        if (share > 1e-9) add_residuals(share, Jt * all[k].r, Jt * all[k].J);
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
        Matrix<6, 1> Jt;
        store((1 / problem.table.sd) * n, Jt.m);
        store((1 / problem.table.sd) * cross(lowest - shape.centre, n), Jt.m + 3);
        add_residuals(1, r * Jt, Jt * transposed(Jt));
    }
    return -0.5 * r * r;
}

}  // namespace tanteo
