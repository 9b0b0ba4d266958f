// Starts of the fit of a round feature: algebraic circles and spheres, axes among uniform directions or from normals.
#include <algorithm>
#include <array>
#include <numeric>

#include "solve/rounds.hpp"
#include "solve/symmetric.hpp"

namespace tanteo {

namespace {

constexpr int DIRECTIONS = 100;
constexpr int CYLINDERS = 5, CONES = 8;  // number of starts
constexpr double LARGE = 25;             // radius over the spread of the points beyond which they are on a plane
constexpr double LEAST_SLOPE = 0.02;     // least slope of the radius of a cone along its axis at the start
constexpr double APART = 0.96592582628906831;  // cosine of 15 degrees, the least angle between axes of two starts
constexpr double NOWHERE = 1e100;

struct Spread {
    Vec3 mean;
    Vec3 along[3];  // principal directions, that of the least spread first
};

Spread spread_of(const std::vector<Vec3>& points) {
    Spread out;
    for (const Vec3& p : points) out.mean += (1.0 / points.size()) * p;
    std::vector<double> C(9, 0.0);
    for (const Vec3& p : points) {
        const Vec3 off = p - out.mean;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) C[3 * i + j] += off[i] * off[j];
    }
    const Eigen found = eigen(std::move(C), 3);
    for (int k = 0; k < 3; ++k) out.along[k] = {found.vectors[k], found.vectors[3 + k], found.vectors[6 + k]};
    return out;
}

Mat3 frame_along(const Vec3& z) {
    const Vec3 x = any_across(z), y = cross(z, x);
    return {{x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z}};
}

// Least squares of rows of A x = b for a few unknowns, by normal equations with a ridge.
template <size_t D>
struct LeastSquares {
    std::array<double, D * D> A{};
    std::array<double, D> x{};
    void add(const std::array<double, D>& row, double b) {
        for (size_t i = 0; i < D; ++i) {
            x[i] += row[i] * b;
            for (size_t j = 0; j <= i; ++j) A[D * i + j] += row[i] * row[j];
        }
    }
    const std::array<double, D>& solve(double ridge) {
        for (size_t i = 0; i < D; ++i) A[D * i + i] += ridge;
        if (cholesky(A.data(), D)) {
            solve_cholesky(A.data(), D, x.data());
        } else {
            x.fill(0);
        }
        return x;
    }
};

// Centre and radius from |p|^2 = 2 c p + r^2 - |c|^2, of the first D coordinates of points about their mean.
template <size_t D>
double algebraic(const std::vector<Vec3>& points, Vec3& centre) {
    double scale = 0;
    for (const Vec3& p : points)
        for (size_t i = 0; i < D; ++i) scale += p[i] * p[i];
    scale = std::max(std::sqrt(scale / points.size()), 1e-300);
    LeastSquares<D + 1> sums;
    for (const Vec3& p : points) {
        std::array<double, D + 1> row;
        double square = 0;
        for (size_t i = 0; i < D; ++i) {
            row[i] = 2 * p[i] / scale;
            square += p[i] * p[i] / (scale * scale);
        }
        row[D] = 1;
        sums.add(row, square);
    }
    const auto& x = sums.solve(1e-12);
    double square = x[D];
    centre = {};
    for (size_t i = 0; i < D; ++i) {
        square += x[i] * x[i];
        centre[i] = x[i] * scale;
    }
    return std::sqrt(std::max(square, 1e-12)) * scale;
}

std::vector<Vec3> in_frame(const std::vector<Vec3>& points, const Vec3& mean, const Mat3& R) {
    std::vector<Vec3> out;
    out.reserve(points.size());
    for (const Vec3& p : points) out.push_back(transposed_times(R, p - mean));
    return out;
}

RoundState circle_across(const std::vector<Vec3>& points, const Vec3& mean, const Mat3& R) {
    RoundState out;
    Vec3 centre;
    out.s = algebraic<2>(in_frame(points, mean, R), centre);
    out.R = R;
    out.c = mean + R * centre;
    return out;
}

// Starts of a known radius on both sides of the points: a short arc fits from either.
std::vector<RoundState> on_either_side(const RoundTask& task, const std::vector<RoundState>& starts, const Vec3& mean) {
    const int d = task.kind == RoundKind::SPHERE ? 3 : 2;
    std::vector<RoundState> out;
    for (const int sign : {1, -1})
        for (const RoundState& start : starts) {
            const std::vector<Vec3> local = in_frame(task.points, mean, start.R);
            std::vector<double> C(d * d, 0.0);
            for (const Vec3& p : local)
                for (int i = 0; i < d; ++i)
                    for (int j = 0; j < d; ++j) C[d * i + j] += p[i] * p[j] / local.size();
            double total = 0;
            for (int i = 0; i < d; ++i) total += C[(d + 1) * i];
            const Eigen found = eigen(std::move(C), d);
            const double arm = std::sqrt(std::max(task.size * task.size - total, 0.0));
            Vec3 shift;
            for (int i = 0; i < d; ++i) shift[i] = sign * arm * found.vectors[d * i];
            if (d == 2) shift.z = transposed_times(start.R, start.c - mean).z;
            out.push_back(start);
            out.back().c = mean + start.R * shift;
        }
    return out;
}

// A start on an axis, and the root mean square distance of the points from it.
struct Trial {
    RoundState state;
    double misfit = 0;
};

double root_mean_square(double sum, size_t n) { return std::sqrt(sum / static_cast<double>(n)); }

Trial cylinder_on(const std::vector<Vec3>& points, const Vec3& mean, const Mat3& R) {
    const std::vector<Vec3> local = in_frame(points, mean, R);
    Vec3 centre;
    const double r = algebraic<2>(local, centre);
    double off = 0, size = 0;
    for (const Vec3& p : local) {
        const double e = std::hypot(p.x - centre.x, p.y - centre.y) - r;
        off += e * e;
        size += squared(p);
    }
    size = root_mean_square(size, local.size());
    Trial out;
    out.state.R = R;
    out.state.c = mean + R * centre;
    out.state.s = std::min(r, LARGE * size);
    out.misfit = r > LARGE * size ? INFINITY : root_mean_square(off, local.size());
    return out;
}

// The cone on an axis: its position from x^2 + y^2 = 2 a x + 2 b y + m z + n, then rho = k z + l. Two rings of points, which
// do not determine a term in z^2, determine both.
Trial cone_on(const std::vector<Vec3>& points, const Vec3& mean, const Mat3& R) {
    std::vector<Vec3> local = in_frame(points, mean, R);
    double scale = 0;
    for (const Vec3& p : local) scale += squared(p);
    scale = root_mean_square(scale, local.size());
    LeastSquares<4> place;
    for (Vec3& p : local) {
        p = (1 / scale) * p;
        place.add({2 * p.x, 2 * p.y, p.z, 1}, p.x * p.x + p.y * p.y);
    }
    const auto f = place.solve(1e-10);
    LeastSquares<2> line;
    for (const Vec3& p : local) line.add({p.z, 1}, std::hypot(p.x - f[0], p.y - f[1]));
    const auto l = line.solve(1e-10);
    const double into = l[0] < 0 ? -1 : 1, k = std::clamp(std::fabs(l[0]), LEAST_SLOPE, 1 / LEAST_SLOPE);
    const double apex = std::clamp(-into * l[1] / k, -LARGE, LARGE);
    Trial out;
    out.state.s = std::atan(k);
    double off = 0;
    for (const Vec3& p : local) {
        const double rho = std::hypot(p.x - f[0], p.y - f[1]);
        const double e = rho * std::cos(out.state.s) - (p.z - apex) * into * std::sin(out.state.s);
        off += e * e;
    }
    out.misfit = std::max(std::fabs(f[0]), std::fabs(f[1])) > LARGE ? INFINITY : root_mean_square(off, local.size()) * scale;
    out.state.c = mean + R * (scale * Vec3{f[0], f[1], apex});
    out.state.R = into < 0 ? R * Mat3{{1, 0, 0, 0, -1, 0, 0, 0, -1}} : R;
    return out;
}

// The direction that has the same angle to all sensed normals, 90 degrees for cylinders; false if there are too few.
bool axis_of_normals(const RoundTask& task, Vec3& axis) {
    std::vector<Vec3> known;
    for (const Vec3& n : task.normals)
        if (squared(n) > 0) known.push_back(n);
    if (known.size() < (task.kind == RoundKind::CYLINDER ? 2u : 3u)) return false;
    Vec3 mean;
    if (task.kind == RoundKind::CONE)
        for (const Vec3& n : known) mean += (1.0 / known.size()) * n;
    std::vector<double> C(9, 0.0);
    for (const Vec3& n : known)
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) C[3 * i + j] += (n[i] - mean[i]) * (n[j] - mean[j]);
    const Eigen found = eigen(std::move(C), 3);
    axis = {found.vectors[0], found.vectors[3], found.vectors[6]};
    return true;
}

// Uniform directions on a half sphere (a Fibonacci lattice), the principal ones of the points, and that of the normals.
std::vector<Vec3> axes_to_try(const RoundTask& task, const Spread& spread) {
    std::vector<Vec3> axes;
    for (int k = 0; k < DIRECTIONS; ++k) {
        const double z = (k + 0.5) / DIRECTIONS, turn = k * 3.14159265358979323846 * (3 - std::sqrt(5.0));
        const double rho = std::sqrt(1 - z * z);
        axes.push_back({rho * std::cos(turn), rho * std::sin(turn), z});
    }
    axes.insert(axes.end(), spread.along, spread.along + 3);
    Vec3 axis;
    if (axis_of_normals(task, axis)) axes.push_back(axis);
    return axes;
}

// The starts on the best axes that differ by at least the angle of APART.
std::vector<RoundState> on_axes(const RoundTask& task, const Spread& spread) {
    const std::vector<Vec3> axes = axes_to_try(task, spread);
    const auto on = task.kind == RoundKind::CYLINDER ? cylinder_on : cone_on;
    std::vector<Trial> trials;
    for (const Vec3& axis : axes) trials.push_back(on(task.points, spread.mean, frame_along(axis)));
    std::vector<RoundState> chosen;
    const size_t count = task.kind == RoundKind::CYLINDER ? CYLINDERS : CONES;
    while (chosen.size() < count) {
        size_t best = 0;
        for (size_t k = 1; k < trials.size(); ++k)
            if (trials[k].misfit < trials[best].misfit) best = k;
        if (!chosen.empty() && !(trials[best].misfit < NOWHERE)) break;
        chosen.push_back(trials[best].state);
        for (size_t k = 0; k < trials.size(); ++k)
            if (k == best || std::fabs(dot(axes[k], axes[best])) > APART) trials[k].misfit = INFINITY;
    }
    return chosen;
}

}  // namespace

Vec3 circle_centre(const std::vector<Vec3>& points, const Mat3& R) {
    return circle_across(points, spread_of(points).mean, R).c;
}

std::vector<RoundState> round_starts(const RoundTask& task) {
    const Spread spread = spread_of(task.points);
    std::vector<RoundState> starts;
    if (task.kind == RoundKind::CYLINDER || task.kind == RoundKind::CONE) {
        starts = on_axes(task, spread);
    } else if (task.kind == RoundKind::SPHERE) {
        RoundState start;
        Vec3 centre;
        start.s = algebraic<3>(in_frame(task.points, spread.mean, identity()), centre);
        start.c = spread.mean + centre;
        starts = {start};
    } else {
        starts = {circle_across(task.points, spread.mean, task.framed ? task.frame_turn : frame_along(spread.along[0]))};
        if (task.framed) {
            const Vec3 u{task.frame_turn(0, 2), task.frame_turn(1, 2), task.frame_turn(2, 2)};
            starts[0].c += dot(task.frame_origin - starts[0].c, u) * u;
        }
    }
    if (task.sized && task.kind != RoundKind::CONE) starts = on_either_side(task, starts, spread.mean);
    for (RoundState& start : starts) {
        start.s = std::min(task.sized ? task.size : start.s, task.largest());
        start.z.assign(task.shared, 0.0);
    }
    return starts;
}

}  // namespace tanteo
