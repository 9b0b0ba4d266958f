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

// One robust step of a pose to the nearest surface at a scale; the cost before it. Without move: the cost alone.
double settle_step(const Shape& shape, const Problem& problem, const std::vector<int>& rows, double scale, bool move,
                   Pose& pose) {
    const double per = 1 / scale;
    double A[36] = {0}, b[6] = {0}, total = 0;
    for (const int j : rows) {
        const Factor& factor = *problem.factors[j];
        const Vec3 p = into_part(pose, factor.at);
        const NearestElement near = factor.nearest(shape, pose, p, scale > COARSE * shape.grid_step);
        if (!near.possible || near.contradicted) {
            total += 4;
            continue;
        }
        const Vec3& g = near.direction;
        const double r = near.distance * per;
        const Vec3 y = p - shape.centre, turn = cross(g, y);
        // the point moves by -v + y x w
        double row[6] = {-g.x * per, -g.y * per, -g.z * per, turn.x * per, turn.y * per, turn.z * per};
        double w = 1 / (1 + 0.25 * r * r);
        total += w * r * r;
        w *= w;
        for (int i = 0; i < 6; ++i) {
            b[i] -= w * row[i] * r;
            for (int l = 0; l <= i; ++l) A[6 * i + l] += w * row[i] * row[l];
        }
        const Vec3& n = near.normal;
        if (!(squared(n) > 0)) continue;
        const Vec3 m = transposed_times(pose.R, factor.direction), tilt = cross(m, n);
        const double sd = std::max(factor.direction_sd, scale / (0.25 * shape.diagonal)), info = 1 / (sd * sd);
        const double q = 2 * (1 - dot(m, n)) * info;
        double v = 1 / (1 + q / 8);
        total += v * q;
        v *= v * info;
        for (int i = 0; i < 3; ++i) {  // m turns by m x w: the tilt against n shrinks along n x m
            b[3 + i] -= v * tilt[i];
            for (int l = 0; l <= i; ++l) A[6 * (3 + i) + 3 + l] += v * ((i == l) - n[i] * n[l]);
        }
    }
    if (!move) return total;
    for (int i = 0; i < 6; ++i) {
        const double soft = i < 3 ? 10 / shape.diagonal : 0.5;
        A[7 * i] += 1e-3 * A[7 * i] + soft * soft;
    }
    if (!cholesky(A, 6)) return total;
    solve_cholesky(A, 6, b);
    shorten(b, 6, 2 * LARGEST_TURN, 0.5 * shape.diagonal);
    pose = moved(pose, load(b), load(b + 3), shape.centre);
    return total;
}

}  // namespace

std::vector<Settled> settle(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                            const std::vector<double>& scales, const std::vector<Pose>& starts) {
    std::vector<Settled> all;
    for (size_t k = 0; k < starts.size(); ++k) all.push_back({starts[k], 0, static_cast<int>(k)});
    for (size_t k = 0; k <= scales.size(); ++k) {
        const bool last = k == scales.size();
        for_all(all.size(), [&] {
            return [&](size_t i) {
                all[i].cost = settle_step(shape, problem, rows, scales[last ? k - 1 : k], !last, all[i].pose);
            };
        });
        double best = 1e300;
        for (const Settled& one : all) best = std::min(best, one.cost);
        if (k % 3 != 2 && !last) continue;
        all.erase(std::remove_if(all.begin(), all.end(), [&](const Settled& one) { return one.cost > best + HOPELESS; }),
                  all.end());
    }
    return all;
}

// The information of a weak prior on state i: a shift of a quarter of the diagonal and a turn of half a radian. It limits
// steps along motions of the pose that no measurement constrains.
static double weak_prior(int i, const Shape& shape) {
    const double root = i < 3 ? 4 / shape.diagonal : (i < 6 ? 2.0 : 0.0);
    return root * root;
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
    double prior(int i, double, double) const { return weak_prior(i, shape); }
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
    maximize(density, maximum.state, at, {1e-3, 0.1, 1e-6, 20, 0, 5}, steps, enough);
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

double marginal(Likelihood& likelihood, const Problem& problem, State& state) {
    const int K = problem.size(), D = K - 6;
    if (!D) return likelihood.at(state, false);
    std::vector<double> L(static_cast<size_t>(D) * D), step(D);
    double log = likelihood.at(state, true), log_det = 0;
    for (int k = 0; k < 4; ++k) {
        for (int i = 0; i < D; ++i) {
            step[i] = likelihood.gradient[6 + i];
            for (int l = 0; l <= i; ++l) L[i * D + l] = likelihood.information[(6 + i) * K + 6 + l];
        }
        if (!cholesky(L.data(), D)) break;
        log_det = 0;
        for (int i = 0; i < D; ++i) log_det += 2 * std::log(L[i * D + i]);
        solve_cholesky(L.data(), D, step.data());
        double size = 0;
        for (int i = 0; i < D; ++i) size += step[i] * likelihood.gradient[6 + i];
        if (size < 1e-2) break;  // twice what is left to gain
        State next = state;
        double gain = -1, there = log, share = 1;
        for (int tries = 0; tries < 4 && gain < 0; ++tries, share *= 0.3) {
            for (int i = 0; i < D; ++i) next.z[i] = state.z[i] + share * step[i];
            there = likelihood.at(next, true);
            gain = there - log;
        }
        if (gain < 0) break;
        state = next;
        log = there;
    }
    return log - 0.5 * log_det;
}

}  // namespace tanteo
