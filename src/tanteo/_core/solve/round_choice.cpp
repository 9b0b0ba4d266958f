// Choice among the fits from several starts, and whether the points admit another one.
#include <algorithm>

#include "solve/rounds.hpp"
#include "solve/symmetric.hpp"

namespace tanteo {

namespace {

constexpr int PASSES = 60, TRIAL_PASSES = 10;
constexpr double CONVERGED = 1e-14, TRIAL_CONVERGED = 1e-3;  // largest last step; trials only rank the starts
constexpr double IMPOSSIBLE = 1e9;  // added to the sum of squares of a fit that contradicts the sides

// Among equally good fits, one whose normals are along the touch directions rules out those with grazing touches: those
// with a mean cosine below a fraction of the best one, GRAZING. Touches from all sides (the mean of their directions is
// shorter than ALL_SIDES) are made along the normals of a wall, so that the fraction is SQUARE. Touches from one side only
// determine the side of the material.
constexpr double GRAZING = 0.5, SQUARE = 0.93, ALL_SIDES = 0.7;
constexpr double ELSEWHERE = 0.02;  // different fits differ by this fraction of the size, or angle of the axis [rad], beyond 5 sd

struct Trial {
    RoundState state;
    RoundLinear at;
    bool converged = false;
    double score = 0, squareness = 1;
};

// Mean cosine between known sides and normals; -1 if they do not all point away from the axis, or all towards it.
double squareness_of(const RoundTask& task, const RoundLinear& at) {
    if (task.outward.empty()) return 1;
    bool away = true, towards = true;
    double sum = 0, absolute = 0, length = 0;
    for (size_t i = 0; i < task.outward.size(); ++i) {
        const double l = norm(task.outward[i]), c = dot(at.G[4 * i + at.k - 1], task.outward[i]) * (task.side ? task.side : 1);
        away = away && c >= -0.2 * l;
        towards = towards && c <= 0.2 * l;
        sum += c;
        absolute += std::fabs(c);
        length += l;
    }
    if (!(away || (task.side == 0 && towards))) return -1;
    return std::max((task.side ? sum : absolute) / std::max(length, 1e-300), 0.0);
}

double grazing_of(const RoundTask& task) {
    Vec3 sum;
    double length = 0;
    for (const Vec3& v : task.outward) {
        sum += v;
        length += norm(v);
    }
    return !task.outward.empty() && norm(sum) / std::max(length, 1e-300) < ALL_SIDES ? SQUARE : GRAZING;
}

double as_good(const RoundTask& task, double chi2) { return std::max(chi2 + task.as_good, task.limit); }

size_t best_of(const RoundTask& task, std::vector<Trial>& trials) {
    double least = INFINITY, most = 0;
    for (Trial& one : trials) {
        one.squareness = squareness_of(task, one.at);
        one.score = (std::isfinite(one.at.chi2) ? one.at.chi2 : INFINITY) + (one.squareness >= 0 ? 0 : IMPOSSIBLE);
        least = std::min(least, one.score);
    }
    const double limit = as_good(task, least), grazing = grazing_of(task);
    for (const Trial& one : trials)
        if (one.score < limit) most = std::max(most, one.squareness);
    for (Trial& one : trials)
        if (one.score < limit && one.squareness < grazing * most) one.score += IMPOSSIBLE;
    size_t best = 0;
    for (size_t k = 1; k < trials.size(); ++k)
        if (trials[k].score < trials[best].score) best = k;
    return best;
}

// The inverse of the information, and the least eigenvalue of it scaled to unit diagonal.
void invert(RoundFit& fit) {
    const int M = fit.at.M;
    std::vector<double> unit(M), scaled(fit.at.information);
    for (int i = 0; i < M; ++i) unit[i] = scaled[i * M + i] > 0 ? 1 / std::sqrt(scaled[i * M + i]) : 1;
    for (int i = 0; i < M; ++i)
        for (int j = 0; j < M; ++j) scaled[i * M + j] *= unit[i] * unit[j];
    const Eigen found = eigen(std::move(scaled), M);
    fit.condition = found.values[0];
    fit.whole.assign(static_cast<size_t>(M) * M, 0.0);
    for (int k = 0; k < M; ++k)
        for (int i = 0; i < M; ++i)
            for (int j = 0; j < M; ++j)
                fit.whole[i * M + j] += found.vectors[i * M + k] * found.vectors[j * M + k] * unit[i] * unit[j] /
                                        std::max(found.values[k], 1e-14);
}

// Whether another fit differs from this one by more than its standard deviations sd.
bool elsewhere(const RoundTask& task, const RoundState& own, const RoundState& other, const std::vector<double>& sd) {
    const int m = static_cast<int>(task.rows.size());
    const auto largest = [&](int from, int to) { return *std::max_element(sd.begin() + from, sd.begin() + to); };
    if (std::fabs(other.s - own.s) > std::max(ELSEWHERE * own.s, 5 * sd[m])) return true;
    const Vec3 u{own.R(0, 2), own.R(1, 2), own.R(2, 2)}, v{other.R(0, 2), other.R(1, 2), other.R(2, 2)};
    if (task.kind != RoundKind::CONE) {  // the apex of a cone is far from its points
        const bool line = task.kind == RoundKind::CYLINDER;
        Vec3 gap = other.c - own.c;
        if (line) gap = gap - dot(gap, u) * u;
        if (norm(gap) > std::max(ELSEWHERE * own.s, 5 * largest(0, line ? 2 : 3))) return true;
    }
    if (task.kind == RoundKind::SPHERE) return false;
    return std::acos(std::min(std::fabs(dot(u, v)), 1.0)) > std::max(ELSEWHERE, 5 * largest(m - 2, m));
}

// The most different size among other fits that the points do not rule out; nan without one.
double rival_of(const RoundTask& task, const RoundFit& fit, const std::vector<Trial>& trials) {
    const int M = fit.at.M, m = static_cast<int>(task.rows.size());
    std::vector<double> sd(m + 1, 0.0);
    for (int i = 0; i < m + task.free_size(); ++i) sd[i] = std::sqrt(std::max(fit.whole[i * M + i], 0.0));
    const double limit = as_good(task, fit.at.chi2);
    double size = std::nan("");
    for (const Trial& one : trials) {
        if (!one.converged || !(one.score < limit) || !elsewhere(task, fit.state, one.state, sd)) continue;
        if (!(std::fabs(one.state.s - fit.state.s) <= std::fabs(size - fit.state.s))) size = one.state.s;
    }
    return size;
}

}  // namespace

RoundFit fit_round(const RoundTask& task) {
    const std::vector<RoundState> starts = round_starts(task);
    RoundFit fit;
    std::vector<Trial> trials;
    if (starts.size() == 1) {
        fit.state = starts[0];
        fit.at = linearize(task, fit.state);
    } else {
        for (const RoundState& start : starts) {
            Trial one{start, linearize(task, start)};
            one.converged = refine_round(task, one.state, one.at, TRIAL_PASSES, TRIAL_CONVERGED);
            trials.push_back(std::move(one));
        }
        const Trial& best = trials[best_of(task, trials)];
        fit.state = best.state;
        fit.at = best.at;
    }
    fit.converged = refine_round(task, fit.state, fit.at, PASSES, CONVERGED);
    invert(fit);
    fit.rival = rival_of(task, fit, trials);
    return fit;
}

}  // namespace tanteo
