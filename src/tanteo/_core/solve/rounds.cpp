// The likelihood of a round feature at a state, and its maximization.
#include "solve/rounds.hpp"

#include <algorithm>

#include "solve/maximize.hpp"

namespace tanteo {

namespace {

constexpr int FEET = 4;           // iterations to the true positions of points with anisotropic noise
constexpr double NEAR = 1e-2;     // predicted gain below which a step is always taken
constexpr double UPHILL = 1e-6;   // relative growth of the sum of squares that is accepted: weights are fixed during a step
constexpr double ROUNDING = 1e-13;  // fraction of an information that keeps a singular one positive definite
constexpr double TINY = 1e-300;
constexpr double LARGEST_TURN = 0.5;

// Distance from the z axis, unit vector away from it, and curvature of a cylinder about it.
struct Radial {
    double rho;
    Vec3 e;
    Mat3 curvature;
    explicit Radial(const Vec3& p) : rho(std::hypot(p.x, p.y)) {
        e = {p.x / std::max(rho, TINY), p.y / std::max(rho, TINY), 0};
        const Vec3 t{-e.y, e.x, 0};
        add_outer(curvature, 1 / std::max(rho, TINY), t, t);
    }
};

RoundDistance of_cone(const Vec3& p, double s) {
    const Radial r(p);
    const double c = std::cos(s), t = std::sin(s);
    RoundDistance d;
    d.F[0] = r.rho * c - p.z * t;
    d.G[0] = {c * r.e.x, c * r.e.y, -t};
    d.by_size[0] = -r.rho * t - p.z * c;
    for (int i = 0; i < 9; ++i) d.H.m[i] = c * r.curvature.m[i];
    d.turned = {-t * r.e.x, -t * r.e.y, -c};
    return d;
}

RoundDistance of_sphere(const Vec3& p, double s) {
    const double far = norm(p), per = 1 / std::max(far, TINY);
    RoundDistance d;
    d.F[0] = far - s;
    d.G[0] = per * p;
    d.by_size[0] = -1;
    d.H = diagonal(per);
    add_outer(d.H, -per, d.G[0], d.G[0]);
    return d;
}

}  // namespace

RoundDistance round_distance(RoundKind surface, const Vec3& p, double s) {
    if (surface == RoundKind::CONE) return of_cone(p, s);
    if (surface == RoundKind::SPHERE) return of_sphere(p, s);
    const Radial r(p);
    RoundDistance d;
    d.rows = surface == RoundKind::CIRCLE ? 2 : 1;
    const int last = d.rows - 1;
    d.F[last] = r.rho - s;
    d.G[last] = r.e;
    d.by_size[last] = -1;
    d.H = r.curvature;
    if (last) {
        d.F[0] = p.z;
        d.G[0] = {0, 0, 1};
    }
    return d;
}

namespace {

Mat3 inverse_of_two(const double C[2][2], int k) {  // 1 x 1 or 2 x 2, in a corner
    Mat3 W;
    if (k == 1) {
        W(0, 0) = 1 / C[0][0];
        return W;
    }
    const double det = C[0][0] * C[1][1] - C[0][1] * C[1][0];
    W(0, 0) = C[1][1] / det;
    W(1, 1) = C[0][0] / det;
    W(0, 1) = W(1, 0) = -C[0][1] / det;
    return W;
}

bool isotropic(const Mat3& S) {
    const double s2 = S.m[0];
    for (int i = 0; i < 9; ++i)
        if (!(std::fabs(S.m[i] - (i % 4 ? 0 : s2)) <= 1e-12 * s2)) return false;
    return true;
}

// A measured point with its most likely true position on the feature, in the feature's frame.
struct Foot {
    RoundDistance d;
    Vec3 p;
    double e[2];
    Mat3 W, along;  // along: covariance of the position given the distance
};

Foot foot_of(RoundKind surface, const Vec3& q, const Mat3& S, double s, int passes) {
    Foot foot;
    foot.p = q;
    Vec3 SG[2];
    for (int pass = 0; pass < passes; ++pass) {
        foot.d = round_distance(surface, foot.p, s);
        const int k = foot.d.rows;
        double C[2][2];
        for (int a = 0; a < k; ++a) SG[a] = S * foot.d.G[a];
        for (int a = 0; a < k; ++a)
            for (int b = 0; b < k; ++b) C[a][b] = dot(foot.d.G[a], SG[b]);
        foot.W = inverse_of_two(C, k);
        for (int a = 0; a < k; ++a) foot.e[a] = foot.d.F[a] + dot(foot.d.G[a], q - foot.p);
        foot.p = q;
        for (int a = 0; a < k; ++a)
            for (int b = 0; b < k; ++b) foot.p += (-foot.W(a, b) * foot.e[b]) * SG[a];
    }
    foot.along = S;
    const int k = foot.d.rows;
    for (int a = 0; a < k; ++a)
        for (int b = 0; b < k; ++b) add_outer(foot.along, -foot.W(a, b), SG[a], SG[b]);
    double bent = 0;
    for (int i = 0; i < 9; ++i) bent += foot.d.H.m[i] * foot.along.m[i];
    foot.e[k - 1] -= 0.5 * bent;
    return foot;
}

// A row of derivatives by a motion of the frame (shift, turn), the size, and the shared errors of the point.
void fill_row(const RoundTask& task, const Vec3& shift, const Vec3& turn, double by_size, const Vec3& by_point,
              const double* J, double* row) {
    for (const int r : task.rows) *row++ = r < 3 ? shift[r] : turn[r - 3];
    if (task.free_size()) *row++ = by_size;
    for (int d = 0; d < task.shared; ++d)
        *row++ = by_point.x * J[d] + by_point.y * J[task.shared + d] + by_point.z * J[2 * task.shared + d];
}

// Adds the residuals r of one point, with inverse covariance W.
void add_rows(RoundLinear& at, size_t i, int first, int count, const double* r, const Mat3& W) {
    const int M = at.M;
    for (int a = 0; a < count; ++a)
        for (int b = 0; b < count; ++b) {
            const double w = W(a, b);
            at.W[16 * i + 4 * (first + a) + first + b] = w;
            at.each[i] += w * r[a] * r[b];
            if (w == 0) continue;
            const double *ha = &at.h[(4 * i + first + a) * M], *hb = &at.h[(4 * i + first + b) * M];
            for (int u = 0; u < M; ++u) {
                const double x = w * ha[u];
                at.gradient[u] -= x * r[b];
                for (int v = 0; v <= u; ++v) at.information[u * M + v] += x * hb[v];
            }
        }
}

void add_normal(const RoundTask& task, RoundLinear& at, size_t i, const Mat3& R, const Foot& foot, const double* J) {
    const double sd = task.normal_sds[i];
    if (!std::isfinite(sd)) return;
    const Vec3 N = foot.d.G[foot.d.rows - 1], n = transposed_times(R, task.normals[i]);
    const Vec3 u = any_across(N), E[2] = {u, cross(N, u)};
    double C[2][2], r[2];
    Vec3 bent[2];
    for (int a = 0; a < 2; ++a) {
        bent[a] = foot.d.H * E[a];
        r[a] = dot(E[a], n - N);
    }
    for (int a = 0; a < 2; ++a)
        for (int b = 0; b < 2; ++b) C[a][b] = (a == b ? sd * sd : 0) + dot(bent[a], foot.along * bent[b]);
    for (int a = 0; a < 2; ++a) {
        at.G[4 * i + 2 + a] = -(R * bent[a]);
        fill_row(task, bent[a], cross(E[a], n) - cross(bent[a], foot.p), -dot(E[a], foot.d.turned), at.G[4 * i + 2 + a], J,
                 &at.h[(4 * i + 2 + a) * at.M]);
    }
    add_rows(at, i, 2, 2, r, inverse_of_two(C, 2));
}

// Adds the priors of the size, the frame and the shared errors.
void add_known(const RoundTask& task, const RoundState& state, RoundLinear& at) {
    const int M = at.M, m = static_cast<int>(task.rows.size()), first = m + task.free_size();
    if (task.sized && task.size_sd > 0) {
        const double off = (state.s - task.size) / task.size_sd;
        at.information[m * M + m] += 1 / (task.size_sd * task.size_sd);
        at.gradient[m] -= off / task.size_sd;
        at.chi2 += off * off;
    }
    for (int d = 0; d < task.shared; ++d) {
        at.information[(first + d) * M + first + d] += 1;
        at.gradient[first + d] -= state.z[d];
        at.chi2 += state.z[d] * state.z[d];
    }
    if (!task.framed) return;
    const Vec3 shift = transposed_times(task.frame_turn, state.c - task.frame_origin);
    const Vec3 turn = rotation_vector(transposed(task.frame_turn) * state.R);
    std::vector<double> off(m), h(static_cast<size_t>(m) * M, 0.0);
    for (int a = 0; a < m; ++a) {
        off[a] = task.rows[a] < 3 ? shift[task.rows[a]] : turn[task.rows[a] - 3];
        h[a * M + a] = 1;
        for (int d = 0; d < task.shared; ++d) {
            off[a] -= task.frame_jacobian[a * task.shared + d] * state.z[d];
            h[a * M + first + d] = -task.frame_jacobian[a * task.shared + d];
        }
    }
    for (int a = 0; a < m; ++a)
        for (int b = 0; b < m; ++b) {
            const double w = task.frame_information[a * m + b];
            if (w == 0) continue;
            at.chi2 += w * off[a] * off[b];
            for (int u = 0; u < M; ++u) {
                at.gradient[u] -= h[a * M + u] * w * off[b];
                for (int v = 0; v <= u; ++v) at.information[u * M + v] += h[a * M + u] * w * h[b * M + v];
            }
        }
}

}  // namespace

RoundLinear linearize(const RoundTask& task, const RoundState& state) {
    const size_t n = task.points.size();
    const int M = task.unknowns(), k = task.surface == RoundKind::CIRCLE ? 2 : 1;
    RoundLinear at;
    at.k = k;
    at.M = M;
    at.e.resize(n * k);
    at.G.resize(4 * n);
    at.W.assign(16 * n, 0.0);
    at.h.assign(4 * n * M, 0.0);
    at.each.assign(n, 0.0);
    at.information.assign(static_cast<size_t>(M) * M, 0.0);
    at.gradient.assign(M, 0.0);
    const bool even = std::all_of(task.covs.begin(), task.covs.end(), isotropic);
    for (size_t i = 0; i < n; ++i) {
        const double* J = task.shared ? &task.shared_jacobian[3 * i * task.shared] : nullptr;
        Vec3 true_point = task.points[i];
        for (int a = 0; a < 3; ++a)
            for (int d = 0; d < task.shared; ++d) true_point[a] += J[a * task.shared + d] * state.z[d];
        const Vec3 q = transposed_times(state.R, true_point - state.c);
        const Mat3 S = even ? task.covs[i] : turned_into(state.R, task.covs[i]);
        const Foot foot = foot_of(task.surface, q, S, state.s, even ? 1 : FEET);
        for (int a = 0; a < k; ++a) {
            const Vec3& G = foot.d.G[a];
            at.e[i * k + a] = foot.e[a];
            at.G[4 * i + a] = state.R * G;
            fill_row(task, -G, -cross(foot.p, G), foot.d.by_size[a], at.G[4 * i + a], J, &at.h[(4 * i + a) * M]);
        }
        add_rows(at, i, 0, k, foot.e, foot.W);
        if (!task.normals.empty()) add_normal(task, at, i, state.R, foot, J);
    }
    for (const double x : at.each) at.chi2 += x;
    add_known(task, state, at);
    for (int u = 0; u < M; ++u)
        for (int v = u + 1; v < M; ++v) at.information[u * M + v] = at.information[v * M + u];
    return at;
}

namespace {

RoundState moved(const RoundTask& task, const RoundState& state, const double* step) {
    Vec3 v, w;
    size_t k = 0;
    for (const int r : task.rows) (r < 3 ? v[r] : w[r - 3]) = step[k++];
    const double turn = norm(w);
    RoundState next = state;
    next.R = state.R * rotation(turn > LARGEST_TURN ? (LARGEST_TURN / turn) * w : w);
    next.c = state.c + state.R * v;
    if (task.slides()) {
        const Vec3 u{next.R(0, 2), next.R(1, 2), next.R(2, 2)};
        double along = 0;
        for (const Vec3& p : task.points) along += dot(p - next.c, u);
        next.c += (along / static_cast<double>(task.points.size())) * u;
    }
    if (task.free_size()) {
        const double s = state.s + std::max(step[k++], -0.5 * state.s);
        next.s = std::min(s, std::min(task.largest(), 3 * state.s + TINY));
    }
    for (double& z : next.z) z += step[k++];
    return next;
}

}  // namespace

bool refine_round(const RoundTask& task, RoundState& state, RoundLinear& at, int passes, double tolerance) {
    const auto damped = [](int, double diagonal, double damping) {
        return diagonal > 0 ? (damping + ROUNDING) * diagonal : damping + ROUNDING;
    };
    const Damping rule{1e-4, 0.1, 0, 10, 1e-6, 1e8};
    return maximize(at, passes, rule, damped, [&](const double* step, double predicted, const double*) {
        if (predicted < 0) return Attempt::LAST;
        RoundState next = moved(task, state, step);
        RoundLinear there = linearize(task, next);
        // the weights are fixed during a step, so that chi2 may grow a little as they change
        if (!(there.chi2 - at.chi2 <= UPHILL * (1 + at.chi2) || predicted < NEAR)) return Attempt::REJECTED;
        std::swap(state, next);
        std::swap(at, there);
        return predicted < tolerance ? Attempt::LAST : Attempt::TAKEN;
    });
}

}  // namespace tanteo
