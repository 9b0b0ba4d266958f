#include "solve/solve.hpp"

#include "factors/normal_poses.hpp"
#include "solve/likelihood.hpp"
#include "solve/maximize.hpp"
#include "solve/one_sided.hpp"
#include "parallel.hpp"

#include <cmath>

namespace tanteo {

namespace {

constexpr double LARGEST_TURN = 0.2;  // largest turn of one step [rad]
constexpr size_t ROUGH_POINTS = 24;   // number of points while noise is blurred: more do not improve the choice of a maximum
constexpr int FIRST_STEPS = 6;        // steps until maxima are compared
constexpr int UNITED_STEPS = 2;       // steps after which maxima that are near each other become one
constexpr double HOPELESS = 16;       // cost gap to the best pose, that of four outliers, beyond which a pose is dropped
constexpr double COARSE = 1;          // scale in cells of the grid beyond which the triangle nearest to a cell is accurate enough
constexpr int MARGINAL_STEPS = 4;     // number of Newton steps from the values at the maximum, near which most poses are
constexpr double QUADRATIC = 0.03;     // gain predicted by a step over which the log density is quadratic, to 0.005
constexpr double UNEVEN = 0.5;         // gain predicted by a step to which a lower value is unevenness, as of the rays of a cone
constexpr double ROUGHLY = 0.1;       // gain at which the maximization of a level other than the last ends

void move_errors(const Problem& problem, std::vector<double>& z, const double* step, double share) {
    for (size_t k = 0; k < z.size(); ++k) {
        const bool one_sided = k < problem.one_sided.size() && problem.one_sided[k];
        z[k] = one_sided ? stepped_amount(z[k], share * step[k]) : z[k] + share * step[k];
    }
}

State stepped(const Problem& problem, const State& state, const double* step, const Vec3& centre) {
    State next = state;
    next.pose = moved(state.pose, load(step), load(step + 3), centre);
    move_errors(problem, next.z, step + 6, 1);
    return next;
}

// Shortens a step to a largest turn and shift.
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

// Adds the priors of the pose: the normal density with the largest share, and the height over a table. Both are widened by
// the scale, so that a step does not jump beyond what the points show.
template <int K>
void add_pose_priors(NormalEquations<K>& at, const Shape& shape, const Problem& problem, const Pose& pose, double scale) {
    const auto add = [&](const double* row6, double r, double weight) {
        double row[K] = {};
        std::copy_n(row6, 6, row);
        at.add(row, r, weight);
    };
    if (!problem.priors.empty()) {
        double r[6], rows[36];
        nearest_normal_pose(problem.priors, pose, shape.centre, r, rows);
        for (int i = 0; i < 6; ++i) {
            double moved = 0;  // how far the centre moves for one standard deviation of this row: the larger, the firmer
            for (int a = 0; a < 3; ++a) moved += rows[6 * i + a] * rows[6 * i + a];
            for (int a = 3; a < 6; ++a) moved += rows[6 * i + a] * rows[6 * i + a] / (0.0625 * shape.diagonal * shape.diagonal);
            add(rows + 6 * i, r[i], 1 / (1 + scale * scale * moved));
        }
    }
    for (const Table& table : problem.tables) {
        double row[6];
        const double height = height_over_table(shape, table, pose, row), width = std::hypot(table.sd, scale);
        for (double& x : row) x /= width;
        add(row, height / width, 1);
    }
}

// Normal equations of the distances of points to the nearest surface, with the robust kernel of Geman and McClure (1987) at
// a scale [m]. The cost is that of the kernel: 4 for a distant point. K = 7: the common offset of all points is a state, too.
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
        const Vec3 turn = cross(g, p + near.beside - shape.centre);
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
    add_pose_priors(at, shape, problem, pose, scale);
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
static std::vector<RefinedPose> refine_states(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                                              const std::vector<double>& scales, const std::vector<Pose>& starts,
                                              double offset_sd, double known) {
    std::vector<RefinedPose> all;
    for (size_t k = 0; k < starts.size(); ++k) all.push_back({starts[k], 0, static_cast<int>(k)});
    // after every three steps, poses of high cost are dropped
    for (size_t first = 0; first <= scales.size(); first += 3) {
        const int steps = static_cast<int>(std::min<size_t>(3, scales.size() - first));
        for_all(all.size(), [&] {
            return [&](size_t i) {
                RefinedPose& one = all[i];
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
                if (steps < 3) equations(steps - 1);  // cost at the last pose
            };
        });
        double best = known;
        for (const RefinedPose& one : all) best = std::min(best, one.cost);
        all.erase(std::remove_if(all.begin(), all.end(), [&](const RefinedPose& one) { return one.cost > best + HOPELESS; }),
                  all.end());
    }
    return all;
}

std::vector<RefinedPose> refine_poses(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                                      const std::vector<double>& scales, const std::vector<Pose>& starts,
                                      double offset_sd, double known) {
    return (offset_sd > 0 ? refine_states<7> : refine_states<6>)(shape, problem, rows, scales, starts, offset_sd, known);
}

std::vector<double> distances_at(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                                 const RefinedPose& at) {
    std::vector<double> out;
    for (const int j : rows) {
        const Factor& factor = *problem.factors[j];
        const NearestElement near = factor.nearest(shape, at.pose, into_part(at.pose, factor.at), false);
        const bool usable = near.possible && !near.contradicted;
        out.push_back(usable ? near.distance + near.along * at.offset : INFINITY);
    }
    return out;
}

// Weak prior that limits steps along motions of the pose that no measurement constrains: a shift of a quarter of the
// diagonal, and a turn of half a radian.
static double weak_prior(int i, const Shape& shape) { return weak_prior(i, 0.25 * shape.diagonal, 0.5); }

// Effective number of the other states that the points determine with noise that the noise scale multiplies. The integral
// over these states is proportional to this power of the scale. Without it, the joint maximum underestimates the scale,
// which goes to zero for few points.
static double determined_by_points(const Likelihood& likelihood, const std::vector<double>& information, const Shape& shape,
                             const Problem& problem) {
    if (!(problem.scale_sd > 0) || likelihood.blur > 0) return 0;
    const int K = problem.size(), P = K - 1;
    // The pose is last: most shared errors belong to one device, so that the rows before it have few entries.
    std::vector<double> L(static_cast<size_t>(P) * P), row(P);
    std::vector<std::pair<int, int>> filled;  // entries of the information of the points, and where they are
    std::vector<double> entries;
    for (int i = 0; i < P; ++i) {
        const int a = (i + 6) % P;
        for (int j = 0; j <= i; ++j) {
            const int b = (j + 6) % P, at = std::max(a, b) * K + std::min(a, b);
            L[i * P + j] = information[at] + (i == j ? weak_prior(a, shape) + 1e-12 * information[at] : 0);
            if (likelihood.of_points[at] == 0) continue;
            filled.emplace_back(i, j);
            entries.push_back((i == j ? 1 : 2) * likelihood.of_points[at]);
        }
    }
    if (!cholesky(L.data(), P)) return 0;
    // trace of the inverse of L L' times that information: the sum of l' M l over the rows l of the inverse of L
    double determined = 0;
    for (int k = 0; k < P; ++k) {
        std::fill_n(row.begin(), k, 0.0);
        row[k] = 1;
        for (int i = 0; i < k; ++i) {
            const double* const before = &L[i * P];
            const double factor = L[k * P + i];
            for (int j = 0; j <= i && factor != 0; ++j) row[j] -= factor * before[j];
        }
        const double per = 1 / L[k * P + k];
        for (int j = 0; j <= k; ++j) L[k * P + j] = per * row[j];
        for (size_t n = 0; n < filled.size() && filled[n].first <= k; ++n)
            determined += entries[n] * L[k * P + filled[n].first] * L[k * P + filled[n].second];
    }
    return std::min(std::max(determined, 0.0), static_cast<double>(P));
}

namespace {

// The log density at a state, its gradient and information over the states from the first on.
void linearize(Likelihood& likelihood, const State& state, int first, Linear& out) {
    out.value = likelihood.at(state, true);
    out.of_pose_prior = likelihood.log_pose;
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
    Linear &at = maximum.at, there;
    const bool scaled = problem.scale_sd > 0;
    // adds the log of the integral over the states that the points determine: a multiple of the log of the noise scale,
    // with a factor that is fixed during a step
    const auto add_integral = [&](Linear& at) {
        if (!scaled) return;
        at.scale_slope = problem.scale_sd * determined_by_points(likelihood, at.information, shape, problem);
        at.gradient.back() += at.scale_slope;
    };
    const auto damped = [&](int i, double diagonal, double damping) { return damping * diagonal + weak_prior(i, shape); };
    if (maximum.blur != blur) {  // otherwise the last level ended with it
        linearize(likelihood, maximum.state, 0, at);
        add_integral(at);
        maximum.blur = blur;
    }
    const Damping rule{1e-3, 0.1, 1e-6, 20, 0, 5};
    maximize(at, steps, rule, damped, [&](double* step, double predicted, const double*) {
        if (predicted < enough) return Attempt::LAST;
        shorten(step, problem.size(), LARGEST_TURN, 0.25 * shape.diagonal);
        State next = stepped(problem, maximum.state, step, shape.centre);
        linearize(likelihood, next, 0, there);
        const double gain = there.value - at.value + (scaled ? at.scale_slope * (next.z.back() - maximum.state.z.back()) : 0);
        if (!(gain > 0)) return Attempt::REJECTED;
        std::swap(maximum.state, next);
        std::swap(at, there);
        add_integral(at);
        return gain < enough ? Attempt::LAST : Attempt::TAKEN;
    });
}

// Whether each point is one of `count` that are far apart; empty if there are no more points. They are chosen among twice
// as many evenly spaced points: among all points, outliers would be the farthest.
static std::vector<char> far_apart(const Problem& problem, size_t count) {
    std::vector<size_t> rows;  // points that furniture does not explain
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

// Drops maxima that are near a better one, which keeps their starts.
static void unite(std::vector<Maximum>& maxima, const Shape& shape, double near) {
    std::sort(maxima.begin(), maxima.end(), [](const Maximum& a, const Maximum& b) {
        return a.at.value != b.at.value ? a.at.value > b.at.value : a.from < b.from;
    });
    const auto is_near = [&](const Maximum& best, const Maximum& other) {
        const size_t K = best.at.gradient.size();
        Vec3 v, w;
        difference(best.state.pose, other.state.pose, shape.centre, v, w);
        const double x[6] = {v.x, v.y, v.z, w.x, w.y, w.z};
        double q = 0;
        for (int i = 0; i < 6; ++i) {
            q += weak_prior(i, shape) * x[i] * x[i];
            for (int k = 0; k <= i; ++k) q += (k < i ? 2 : 1) * best.at.information[K * i + k] * x[i] * x[k];
        }
        return squared(w) < 1 && q < near;
    };
    size_t count = 0;
    for (size_t k = 0; k < maxima.size(); ++k) {
        size_t which = 0;
        while (which < count && !is_near(maxima[which], maxima[k])) ++which;
        if (which == count) {
            if (count != k) maxima[count] = std::move(maxima[k]);
            ++count;
            continue;
        }
        std::vector<int>& also = maxima[which].also;
        also.push_back(maxima[k].from);
        also.insert(also.end(), maxima[k].also.begin(), maxima[k].also.end());
    }
    maxima.resize(count);
}

std::vector<Maximum> maximize_all(const Shape& shape, const Problem& problem, const std::vector<State>& starts,
                             const std::vector<double>& blurs, int steps, double enough, double margin, double near) {
    const std::vector<char> coarse = far_apart(problem, ROUGH_POINTS);
    std::vector<Maximum> maxima(starts.size());
    for (size_t k = 0; k < starts.size(); ++k) {
        maxima[k].state = starts[k];
        maxima[k].from = static_cast<int>(k);
    }
    const int few = std::min(steps, FIRST_STEPS);
    const auto level = [&](double blur, int most, double gain, double gap) {
        for_all(maxima.size(), [&] {
            Likelihood own(shape, problem);
            own.coarse = coarse;
            return [&, likelihood = std::move(own)](size_t k) mutable {
                ascend(likelihood, shape, problem, blur, most, gain, maxima[k]);
            };
        });
        const auto rank = [most](const Linear& at) { return at.value - (most > 0 ? 0 : at.of_pose_prior); };
        double best = -1e300;
        for (const Maximum& maximum : maxima) best = std::max(best, rank(maximum.at));
        maxima.erase(std::remove_if(maxima.begin(), maxima.end(),
                                    [&](const Maximum& maximum) { return !(rank(maximum.at) >= best - gap); }),
                     maxima.end());
        if (near > 0 && most > 0) unite(maxima, shape, near);
    };
    if (maxima.size() > 2) level(blurs.empty() ? 0 : blurs[0], 0, 0, 2 * margin);  // without a step
    for (const double blur : blurs) level(blur, few, ROUGHLY, margin);
    for (int done = 0; done < few; done += UNITED_STEPS)
        level(0, std::min(UNITED_STEPS, few - done), ROUGHLY, done + UNITED_STEPS < few ? 2 * margin : margin);
    if (steps > few) level(0, steps - few, enough, margin);
    return maxima;
}

// Newton's method with a line search; the last step is not evaluated. The determinant is that of the factor of the last
// step, not of the maximum: the statistics are equal.
double marginal(Likelihood& likelihood, const Problem& problem, State& state) {
    const int D = problem.size() - 6;
    if (!D) return likelihood.at(state, false);
    likelihood.with_pose = false;
    Linear at, there;
    likelihood.same_place = false;
    linearize(likelihood, state, 6, at);
    likelihood.same_place = !problem.shared;
    double log_det = 0, gain = 0;
    const auto undamped = [](int, double, double) { return 0.0; };
    maximize(at, MARGINAL_STEPS, {}, undamped, [&](const double* step, double predicted, const double* L) {
        log_det = 0;
        for (int i = 0; i < D; ++i) log_det += 2 * std::log(L[i * D + i]);
        if (predicted < QUADRATIC) {
            move_errors(problem, state.z, step, 1);
            gain = 0.5 * predicted;
            return Attempt::LAST;
        }
        double share = 1;
        for (int tries = 0; tries < 4; ++tries, share *= 0.3) {
            State next = state;
            move_errors(problem, next.z, step, share);
            linearize(likelihood, next, 6, there);
            if (there.value < at.value) {
                if (predicted < UNEVEN) break;
                continue;
            }
            std::swap(state, next);
            std::swap(at, there);
            return Attempt::TAKEN;
        }
        return Attempt::LAST;
    });
    return at.value + gain - 0.5 * log_det;
}

}  // namespace tanteo
