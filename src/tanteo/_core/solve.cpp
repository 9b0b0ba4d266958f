#include "solve.hpp"

#include "maximize.hpp"
#include "parallel.hpp"

#include <cmath>

namespace tanteo {

namespace {

constexpr double LARGEST_TURN = 0.2;  // of one step [rad]
constexpr size_t ROUGH_POINTS = 24;   // in blurred noise: more of them tell no more about which maximum is near
constexpr int FIRST_STEPS = 6;        // until maxima are compared
constexpr double HOPELESS = 16;       // cost of a pose over the best one, four outliers more, at which it is given up
constexpr double COARSE = 1;          // cells of the grid: at a larger scale the triangle next to a cell will do
constexpr int MARGINAL_STEPS = 4;     // from the values at the maximum, near which most poses are
constexpr double ROUGHLY = 0.1;       // a gain that ends a maximum that is not the last

State stepped(const State& state, const double* step, const Vec3& centre) {
    State next = state;
    next.pose = moved(state.pose, load(step), load(step + 3), centre);
    for (size_t k = 0; k < next.z.size(); ++k) next.z[k] += step[6 + k];
    return next;
}

// A step no larger than a turn and a shift of the same size at the rim of the part.
void shorten(double* step, int K, double turn, double shift) {
    const double a = norm(load(step + 3)) / turn, b = norm(load(step)) / shift;
    const double over = std::max(a, b);
    if (over > 1)
        for (int k = 0; k < K; ++k) step[k] /= over;
}

}  // namespace

namespace {

// The distances of points to the nearest surface under a robust kernel that shrinks, as a problem of `gauss_newton`: Geman
// and McClure's (1987), at one scale [m] after the other from `first` on.
struct SurfaceDistances {
    using State = Pose;

    const Shape& shape;
    const Problem& problem;
    const std::vector<int>& rows;
    const std::vector<double>& scales;
    size_t first;
    double cost = 0;  // before the last step: 4 for a point that is far off

    NormalEquations<6> linearize(const Pose& pose, int k) {
        const double scale = scales[first + k], per = 1 / scale;
        NormalEquations<6> at;
        cost = 0;
        for (const int j : rows) {
            const Factor& factor = *problem.factors[j];
            const Vec3 p = into_part(pose, factor.at);
            const NearestElement near = factor.nearest(shape, pose, p, scale > COARSE * shape.grid_step);
            if (!near.possible || near.contradicted) {
                cost += 4;
                continue;
            }
            const Vec3& g = near.direction;
            const double r = near.distance * per;
            const Vec3 y = p - shape.centre, turn = cross(g, y);
            // the point moves by -v + y x w
            const double J[6] = {-g.x * per, -g.y * per, -g.z * per, turn.x * per, turn.y * per, turn.z * per};
            const double w = 1 / (1 + 0.25 * r * r);
            cost += w * r * r;
            at.add(J, r, w * w);
            if (squared(near.normal) > 0) add_normal(at, near.normal, transposed_times(pose.R, factor.direction),
                                                     std::max(factor.direction_sd, scale / (0.25 * shape.diagonal)));
        }
        at.add_weak_prior(0.1 * shape.diagonal, 2, 1e-3);
        return at;
    }
    void add_normal(NormalEquations<6>& at, const Vec3& n, const Vec3& m, double sd) {
        const double info = 1 / (sd * sd), q = 2 * (1 - dot(m, n)) * info;
        const Vec3 tilt = cross(m, n);
        double v = 1 / (1 + q / 8);
        cost += v * q;
        v *= v * info;
        for (int i = 0; i < 3; ++i) {  // m turns by m x w: the tilt against n shrinks along n x m
            at.gradient[3 + i] -= v * tilt[i];
            for (int l = 0; l <= i; ++l) at.information(3 + i, 3 + l) += v * ((i == l) - n[i] * n[l]);
        }
    }
    void take(Pose& pose, Matrix<6, 1>& step, const Matrix<6, 6>&) const {
        shorten(step.data(), 6, 2 * LARGEST_TURN, 0.5 * shape.diagonal);
        pose = moved(pose, load(step.m), load(step.m + 3), shape.centre);
    }
};

}  // namespace

std::vector<Settled> settle(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                            const std::vector<double>& scales, const std::vector<Pose>& starts) {
    std::vector<Settled> all;
    for (size_t k = 0; k < starts.size(); ++k) all.push_back({starts[k], 0, static_cast<int>(k)});
    // three steps, and those that are far behind are given up
    for (size_t first = 0; first <= scales.size(); first += 3) {
        const int steps = static_cast<int>(std::min<size_t>(3, scales.size() - first));
        for_all(all.size(), [&] {
            return [&](size_t i) {
                SurfaceDistances distances{shape, problem, rows, scales, first};
                gauss_newton(distances, all[i].pose, steps);
                if (steps < 3) distances.linearize(all[i].pose, steps - 1);  // the cost where it ends
                all[i].cost = distances.cost;
            };
        });
        double best = 1e300;
        for (const Settled& one : all) best = std::min(best, one.cost);
        all.erase(std::remove_if(all.begin(), all.end(), [&](const Settled& one) { return one.cost > best + HOPELESS; }),
                  all.end());
    }
    return all;
}

// How many of the other states the points tell, of those that the noise scale scales: the integral over them is in
// proportion to so many powers of the scale. Their joint maximum has it too small, and of few points at nothing.
static double told_by_points(const Likelihood& likelihood, const std::vector<double>& information, const Shape& shape,
                             const Problem& problem) {
    if (!(problem.scale_sd > 0) || likelihood.blur > 0) return 0;
    const int K = problem.size(), P = K - 1;
    std::vector<double> L(static_cast<size_t>(P) * P), column(P);
    for (int i = 0; i < P; ++i) {
        for (int j = 0; j <= i; ++j) L[i * P + j] = information[i * K + j];
        L[i * P + i] += weak_prior(i, 0.25 * shape.diagonal, 0.5) + 1e-12 * L[i * P + i];
    }
    if (!cholesky(L.data(), P)) return 0;
    double told = 0;
    for (int j = 0; j < P; ++j) {
        for (int i = 0; i < P; ++i) column[i] = likelihood.of_points[i >= j ? i * K + j : j * K + i];
        solve_cholesky(L.data(), P, column.data());
        told += column[j];
    }
    return likelihood.scaled_share * std::min(std::max(told, 0.0), static_cast<double>(P));
}

namespace {

// The log density as a problem of `maximize`. The integral over the states that the points constrain is in proportion to
// a power of the noise scale, so its log is added: a multiple of the scale that is held during a step.
struct LogDensity {
    using State = tanteo::State;
    struct Linear {
        double value = 0;
        std::vector<double> gradient, information;
    };

    Likelihood& likelihood;
    const Shape& shape;
    const Problem& problem;
    double enough;

    void linearize(const State& state, Linear& out) {
        out.value = likelihood.at(state, true);
        std::swap(out.gradient, likelihood.gradient);
        std::swap(out.information, likelihood.information);
    }
    void slope(const Linear& at, double* g) const {
        std::copy(at.gradient.begin(), at.gradient.end(), g);
        if (problem.scale_sd > 0) g[at.gradient.size() - 1] += told;
    }
    double damped(int i, double diagonal, double damping) const {
        return damping * diagonal + weak_prior(i, 0.25 * shape.diagonal, 0.5);
    }
    bool ends(const Linear&, const double*, double predicted) const { return predicted < enough; }
    State retract(const State& state, double* step) const {
        shorten(step, problem.size(), LARGEST_TURN, 0.25 * shape.diagonal);
        return stepped(state, step, shape.centre);
    }
    double gain(const State& from, const Linear& at, const State& to, const Linear& there) const {
        const double by_scale = problem.scale_sd > 0 ? told * (to.z.back() - from.z.back()) : 0;
        return there.value - at.value + by_scale;
    }
    bool accepts(const Linear&, double gain, double) const { return gain > 0; }
    bool converged(double gain, double) const { return gain < enough; }
    void accepted(const State&, const Linear& at) {
        if (problem.scale_sd > 0) told = problem.scale_sd * told_by_points(likelihood, at.information, shape, problem);
    }

    double told = 0;
};

}  // namespace

void ascend(Likelihood& likelihood, const Shape& shape, const Problem& problem, double blur, int steps, double enough,
            Maximum& maximum) {
    likelihood.blur = blur;
    likelihood.blur_turn = blur / (0.25 * shape.diagonal);
    LogDensity density{likelihood, shape, problem, enough};
    LogDensity::Linear at;
    density.linearize(maximum.state, at);
    density.accepted(maximum.state, at);
    maximize(density, maximum.state, at, {1e-3, 0.1, 1e-6, 20, 0, 5}, steps);
    maximum.log = at.value;
    std::swap(maximum.gradient, at.gradient);
    std::swap(maximum.information, at.information);
}

// Whether a point is one of so many that lie far apart; empty if there are no more. They are of twice as many that come
// at even steps: of all points, outliers would be the farthest.
static std::vector<char> far_apart(const Problem& problem, size_t count) {
    std::vector<size_t> rows;  // those that furniture does not explain
    const auto& factors = problem.factors;
    for (size_t j = 0; j < factors.size(); ++j)
        if (problem.furniture[j] < 1) rows.push_back(j);
    if (factors.size() <= count) return {};
    std::vector<char> chosen(factors.size(), 0);
    const size_t some = std::min(2 * count, rows.size());
    std::vector<double> nearest(some, 1e300);
    for (size_t next = 0, k = 0; k < std::min(count, some); ++k) {
        const size_t row = rows[next * rows.size() / some];
        chosen[row] = 1;
        for (size_t j = 0; j < some; ++j)
            nearest[j] = std::min(nearest[j], norm(factors[rows[j * rows.size() / some]]->at - factors[row]->at));
        next = std::max_element(nearest.begin(), nearest.end()) - nearest.begin();
    }
    return chosen;
}

std::vector<Maximum> maximize_all(const Shape& shape, const Problem& problem, const std::vector<State>& starts,
                             const std::vector<double>& blurs, int steps, double enough, double margin) {
    const std::vector<char> coarse = far_apart(problem, ROUGH_POINTS);
    std::vector<Maximum> maxima(starts.size());
    for (size_t k = 0; k < starts.size(); ++k) {
        maxima[k].state = starts[k];
        maxima[k].from = static_cast<int>(k);
    }
    const int few = std::min(steps, FIRST_STEPS);
    const auto level = [&](double blur, int most, double gain, double behind) {
        for_all(maxima.size(), [&] {
            Likelihood own(shape, problem);
            own.coarse = coarse;
            return [&, likelihood = std::move(own)](size_t k) mutable {
                ascend(likelihood, shape, problem, blur, most, gain, maxima[k]);
            };
        });
        double best = -1e300;
        for (const Maximum& maximum : maxima) best = std::max(best, maximum.log);
        maxima.erase(std::remove_if(maxima.begin(), maxima.end(),
                                    [&](const Maximum& maximum) { return !(maximum.log >= best - behind); }),
                     maxima.end());
    };
    if (maxima.size() > 2) level(blurs.empty() ? 0 : blurs[0], 0, 0, 2 * margin);  // as they stand
    for (const double blur : blurs) level(blur, few, ROUGHLY, margin);
    level(0, few, ROUGHLY, margin);
    if (steps > few) level(0, steps - few, enough, margin);
    return maxima;
}

namespace {

// The log density over shared errors and noise scale at a pose, as a problem of `maximize`.
struct SharedErrors {
    using State = tanteo::State;
    struct Linear {
        double value = 0;
        std::vector<double> gradient, information;
    };

    Likelihood& likelihood;

    void linearize(const State& state, Linear& out) {
        out.value = likelihood.at(state, true);
        const int D = static_cast<int>(state.z.size()), K = 6 + D;
        out.gradient.assign(likelihood.gradient.begin() + 6, likelihood.gradient.end());
        out.information.resize(static_cast<size_t>(D) * D);
        for (int i = 0; i < D; ++i)
            for (int l = 0; l <= i; ++l) out.information[i * D + l] = likelihood.information[(6 + i) * K + 6 + l];
    }
    void slope(const Linear&, double*) const {}
    double damped(int, double diagonal, double damping) const { return damping * diagonal; }
    bool ends(const Linear&, const double*, double predicted) const { return predicted < 1e-2; }
    State retract(const State& state, const double* step) const {
        State next = state;
        for (double& z : next.z) z += *step++;
        return next;
    }
    double gain(const State&, const Linear& at, const State&, const Linear& there) const { return there.value - at.value; }
    bool accepts(const Linear&, double gain, double) const { return gain >= 0; }
    bool converged(double, double) const { return false; }
    void accepted(const State&, const Linear&) const {}
};

}  // namespace

double marginal(Likelihood& likelihood, const Problem& problem, State& state) {
    const int D = problem.size() - 6;
    if (!D) return likelihood.at(state, false);
    SharedErrors errors{likelihood};
    SharedErrors::Linear at;
    errors.linearize(state, at);
    maximize(errors, state, at, {0, 0.1, 0, 10, 2, 1e3}, MARGINAL_STEPS);
    if (!cholesky(at.information.data(), D)) return at.value;
    double log_det = 0;
    for (int i = 0; i < D; ++i) log_det += 2 * std::log(at.information[i * D + i]);
    return at.value - 0.5 * log_det;
}

}  // namespace tanteo
