#include "solve/solve.hpp"

#include "solve/maximize.hpp"
#include "parallel.hpp"

#include <cmath>

namespace tanteo {

namespace {

constexpr double LARGEST_TURN = 0.2;  // of one step [rad]
constexpr size_t ROUGH_POINTS = 24;   // in blurred noise: more points do not improve the choice of a maximum
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

template <int K>
void add_normal(NormalEquations<K>& at, const Vec3& n, const Vec3& m, double sd) {
    const double info = 1 / (sd * sd), q = 2 * (1 - dot(m, n)) * info, kernel = 1 / (1 + q / 8), v = kernel * kernel * info;
    const Vec3 tilt = cross(m, n);
    at.cost += kernel * q;
    for (int i = 0; i < 3; ++i) {  // m turns by m x w: the tilt against n shrinks along n x m
        at.gradient[3 + i] -= v * tilt[i];
        for (int l = 0; l <= i; ++l) at.information[K * (3 + i) + 3 + l] += v * ((i == l) - n[i] * n[l]);
    }
}

// The distances of points to the nearest surface at a scale [m], under Geman and McClure's robust kernel (1987). The cost is
// that of the kernel: 4 for a point that is far off. K = 7: with the common offset of all points as a state.
template <int K>
NormalEquations<K> surface_distances(const Shape& shape, const Problem& problem, const std::vector<int>& rows, double scale,
                                     const Pose& pose, double offset, double offset_sd) {
    const double per = 1 / scale;
    NormalEquations<K> at;
    for (const int j : rows) {
        const Factor& factor = *problem.factors[j];
        const Vec3 p = into_part(pose, factor.at);
        const NearestElement near = factor.nearest(shape, pose, p, scale > COARSE * shape.grid_step);
        if (!near.possible || near.contradicted) {
            at.cost += 4;
            continue;
        }
        const Vec3& g = near.direction;
        const double r = (near.distance + near.along * offset) * per, w = 1 / (1 + 0.25 * r * r);
        const Vec3 turn = cross(g, p - shape.centre);
        // the point moves by -v + y x w
        double J[K] = {-g.x * per, -g.y * per, -g.z * per, turn.x * per, turn.y * per, turn.z * per};
        if constexpr (K > 6) J[6] = near.along * per;
        const double before = at.cost;
        at.add(J, r, w * w);
        at.cost = before + w * r * r;
        const Vec3 m = transposed_times(pose.R, factor.direction);
        if (squared(near.normal) > 0)
            add_normal(at, near.normal, m, std::max(factor.direction_sd, scale / (0.25 * shape.diagonal)));
    }
    at.add_weak_prior(0.1 * shape.diagonal, 2, 1e-3);
    if constexpr (K > 6) {
        double J[K] = {};
        J[6] = 1 / offset_sd;
        at.add(J, offset / offset_sd, 1);
    }
    return at;
}

}  // namespace

template <int K>
static std::vector<Settled> settle_states(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                                          const std::vector<double>& scales, const std::vector<Pose>& starts,
                                          double offset_sd) {
    std::vector<Settled> all;
    for (size_t k = 0; k < starts.size(); ++k) all.push_back({starts[k], 0, static_cast<int>(k)});
    // three steps, and those that are far behind are given up
    for (size_t first = 0; first <= scales.size(); first += 3) {
        const int steps = static_cast<int>(std::min<size_t>(3, scales.size() - first));
        for_all(all.size(), [&] {
            return [&](size_t i) {
                Settled& one = all[i];
                const auto equations = [&](int k) {
                    const auto at =
                        surface_distances<K>(shape, problem, rows, scales[first + k], one.pose, one.offset, offset_sd);
                    one.cost = at.cost;
                    return at;
                };
                gauss_newton(steps, equations, [&](double* step, const double*) {
                    shorten(step, K, 2 * LARGEST_TURN, 0.5 * shape.diagonal);
                    one.pose = moved(one.pose, load(step), load(step + 3), shape.centre);
                    if constexpr (K > 6) one.offset += step[6];
                });
                if (steps < 3) equations(steps - 1);  // the cost where it ends
            };
        });
        double best = 1e300;
        for (const Settled& one : all) best = std::min(best, one.cost);
        all.erase(std::remove_if(all.begin(), all.end(), [&](const Settled& one) { return one.cost > best + HOPELESS; }),
                  all.end());
    }
    return all;
}

std::vector<Settled> settle(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                            const std::vector<double>& scales, const std::vector<Pose>& starts, double offset_sd) {
    return (offset_sd > 0 ? settle_states<7> : settle_states<6>)(shape, problem, rows, scales, starts, offset_sd);
}

std::vector<double> distances_at(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                                 const Settled& at) {
    std::vector<double> out;
    for (const int j : rows) {
        const Factor& factor = *problem.factors[j];
        const NearestElement near = factor.nearest(shape, at.pose, into_part(at.pose, factor.at), false);
        const bool usable = near.possible && !near.contradicted;
        out.push_back(usable ? near.distance + near.along * at.offset : INFINITY);
    }
    return out;
}

// Limits steps along motions of the pose that no measurement constrains: a shift of a quarter of the diagonal, and a turn of
// half a radian.
static double weak_prior(int i, const Shape& shape) { return weak_prior(i, 0.25 * shape.diagonal, 0.5); }

// Number of other states that the points determine, among those that the noise scale affects: the integral over them is in
// proportion to so many powers of the scale. Their joint maximum has it too small, and of few points at nothing.
static double told_by_points(const Likelihood& likelihood, const std::vector<double>& information, const Shape& shape,
                             const Problem& problem) {
    if (!(problem.scale_sd > 0) || likelihood.blur > 0) return 0;
    const int K = problem.size(), P = K - 1;
    std::vector<double> L(static_cast<size_t>(P) * P), column(P);
    for (int i = 0; i < P; ++i) {
        for (int j = 0; j <= i; ++j) L[i * P + j] = information[i * K + j];
        L[i * P + i] += weak_prior(i, shape) + 1e-12 * L[i * P + i];
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

// The log density at a state, its gradient and information over the states from the first on.
struct Linear {
    double value = 0, told = 0;
    std::vector<double> gradient, information;
};

void linearize(Likelihood& likelihood, const State& state, int first, Linear& out) {
    out.value = likelihood.at(state, true);
    const int K = static_cast<int>(likelihood.gradient.size()), D = K - first;
    out.gradient.assign(likelihood.gradient.begin() + first, likelihood.gradient.end());
    out.information.resize(static_cast<size_t>(D) * D);
    for (int i = 0; i < D; ++i) std::copy_n(&likelihood.information[(first + i) * K + first], i + 1, &out.information[i * D]);
}

}  // namespace

void ascend(Likelihood& likelihood, const Shape& shape, const Problem& problem, double blur, int steps, double enough,
            Maximum& maximum) {
    likelihood.blur = blur;
    likelihood.blur_turn = blur / (0.25 * shape.diagonal);
    Linear at, there;
    const bool scaled = problem.scale_sd > 0;
    // the integral over the states that the points constrain is in proportion to a power of the noise scale, so its log is
    // added: a multiple of the scale that is held during a step
    const auto hold = [&](Linear& at) {
        if (!scaled) return;
        at.told = problem.scale_sd * told_by_points(likelihood, at.information, shape, problem);
        at.gradient.back() += at.told;
    };
    const auto damped = [&](int i, double diagonal, double damping) { return damping * diagonal + weak_prior(i, shape); };
    linearize(likelihood, maximum.state, 0, at);
    hold(at);
    const Damping rule{1e-3, 0.1, 1e-6, 20, 0, 5};
    maximize(at, steps, rule, damped, [&](double* step, double predicted, const double*) {
        if (predicted < enough) return Attempt::LAST;
        shorten(step, problem.size(), LARGEST_TURN, 0.25 * shape.diagonal);
        State next = stepped(maximum.state, step, shape.centre);
        linearize(likelihood, next, 0, there);
        const double gain = there.value - at.value + (scaled ? at.told * (next.z.back() - maximum.state.z.back()) : 0);
        if (!(gain > 0)) return Attempt::REJECTED;
        std::swap(maximum.state, next);
        std::swap(at, there);
        hold(at);
        return gain < enough ? Attempt::LAST : Attempt::TAKEN;
    });
    maximum.log = at.value;
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

// Newton's method with a line search. The determinant is that of the last step's factor: at the maximum itself the statistics
// are the same, but other poses are drawn.
double marginal(Likelihood& likelihood, const Problem& problem, State& state) {
    const int D = problem.size() - 6;
    if (!D) return likelihood.at(state, false);
    Linear at, there;
    linearize(likelihood, state, 6, at);
    double log_det = 0;
    const auto undamped = [](int, double, double) { return 0.0; };
    maximize(at, MARGINAL_STEPS, {}, undamped, [&](const double* step, double predicted, const double* L) {
        log_det = 0;
        for (int i = 0; i < D; ++i) log_det += 2 * std::log(L[i * D + i]);
        if (predicted < 1e-2) return Attempt::LAST;
        double share = 1;
        for (int tries = 0; tries < 4; ++tries, share *= 0.3) {
            State next = state;
            for (int i = 0; i < D; ++i) next.z[i] += share * step[i];
            linearize(likelihood, next, 6, there);
            if (there.value < at.value) continue;
            std::swap(state, next);
            std::swap(at, there);
            return Attempt::TAKEN;
        }
        return Attempt::LAST;
    });
    return at.value - 0.5 * log_det;
}

}  // namespace tanteo
