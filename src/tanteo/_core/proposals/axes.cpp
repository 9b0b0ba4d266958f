// Necessary conditions for sensed centres on a part at any pose: axes of their kind, side and size, at their distances.
#include "proposals/axes.hpp"

#include <algorithm>
#include <cmath>

namespace tanteo {

namespace {

constexpr double TURNED = 0.004;    // tolerance of angles [rad]: made and meshed axes differ from the drawing
constexpr double PARALLEL = 1e-3;   // sine below which two axes are parallel
constexpr double LOOSE = 1.5;       // cost of a centre on an axis that is not stored, in addition to minus the log of their fraction [nats]
constexpr double LEAST_UNSEEN = 1e-3;  // least fraction of axes that are not stored, below which it counts as zero
constexpr double NEVER = 1e300;

// Least distance between the lines or points of two axes.
double between(const ModelAxis& a, const ModelAxis& b) {
    const Vec3 off = b.middle - a.middle;
    if (a.point && b.point) return norm(off);
    const Vec3 across = cross(a.along, b.along);
    const double sine = norm(across);
    if (a.point || (sine <= PARALLEL && !b.point)) return norm(off - dot(off, b.along) * b.along);
    if (b.point) return norm(off - dot(off, a.along) * a.along);
    return std::fabs(dot(off, across)) / sine;
}

// Largest distance between points of two axes; without bound along a line.
double ends_apart(const ModelAxis& a, const ModelAxis& b) {
    return a.point && b.point ? norm(a.middle - b.middle) : NEVER;
}

}  // namespace

ModelAxes::ModelAxes(const float* rows, size_t count) {
    double share[KINDS] = {};
    for (size_t k = 0; k < count; ++k) {
        const float* x = rows + COLUMNS * k;
        if (!std::all_of(x, x + COLUMNS, [](float value) { return std::fabs(value) < 1e6f; })) continue;  // counts as unseen
        const Vec3 a{x[0], x[1], x[2]}, b{x[3], x[4], x[5]};
        const double weight = x[8], half = 0.5 * norm(b - a);
        const int number = static_cast<int>(x[10]), kind = std::clamp(static_cast<int>(x[11]), 0, KINDS - 1);
        const bool line = x[12] > 0;
        share[kind] += weight;
        ModelAxis axis;
        axis.point = !line;
        axis.along = unit(b - a);
        axis.middle = axis.point ? a : 0.5 * (a + b);
        axis.wall = axis.point ? 0 : half;
        axis.least = x[6];
        axis.most = x[7];
        axis.side = x[9] < 0 ? -1 : 1;
        axis.kind = kind;
        axis.number = number;
        all.push_back(axis);
    }
    for (int kind = 0; kind < KINDS; ++kind) unseen[kind] = share[kind] > 0 ? std::max(1 - share[kind], 0.0) : 0;
}

AxisFits::AxisFits(const ModelAxes& axes, const std::vector<SensedCentre>& centres) : axes(axes), centres(centres) {
    const size_t N = axes.all.size();
    sizes.assign(centres.size() * N, NEVER);
    for (size_t i = 0; i < centres.size(); ++i) {
        const SensedCentre& own = centres[i];
        const double unseen = axes.unseen[own.kind];
        most_of.push_back(unseen > LEAST_UNSEEN ? std::min(own.most, LOOSE - std::log(unseen)) : own.most);
        for (size_t a = 0; a < N; ++a) {
            const ModelAxis& axis = axes.all[a];
            if (axis.kind != own.kind || own.side * axis.side < 0) continue;
            const double off = own.size > 0 ? (own.size - std::clamp(own.size, axis.least, axis.most)) / own.size_sd : 0;
            sizes[i * N + a] = 0.5 * off * off;
        }
    }
}

double AxisFits::least_apart(int a, int b) const { return between(axes.all[a], axes.all[b]); }

bool AxisFits::agree(int i, int a, int j, int b) const {
    const SensedCentre &p = centres[i], &q = centres[j];
    const double apart = norm(p.at - q.at), within = SDS * std::hypot(p.sd, q.sd);
    const ModelAxis &first = axes.all[a], &second = axes.all[b];
    if (a == b) return !first.point || apart < within;
    if (between(first, second) > apart + within || ends_apart(first, second) < apart - within) return false;
    if (!p.oriented() || !q.oriented()) return true;
    const double sensed = std::acos(std::clamp(std::fabs(dot(p.axis, q.axis)), 0.0, 1.0));
    const double modelled = std::acos(std::clamp(std::fabs(dot(first.along, second.along)), 0.0, 1.0));
    return std::fabs(sensed - modelled) < SDS * std::hypot(p.tilt, q.tilt) + TURNED;
}

double AxisFits::lacking() const {
    const int n = static_cast<int>(centres.size()), N = static_cast<int>(axes.all.size());
    std::vector<double> more(n);  // additional cost of each centre without an axis
    double sum = 0;
    for (int i = 0; i < n; ++i) {
        double least = most(i);
        for (int a = 0; a < N; ++a) least = std::min(least, size(i, a));
        more[i] = most(i) - least;
        sum += least;
    }
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < i; ++j) {
            if (!(more[i] > 0 && more[j] > 0) || axes.unseen[centres[i].kind] > LEAST_UNSEEN) continue;
            bool fits = false;
            for (int a = 0; a < N && !fits; ++a)
                for (int b = 0; b < N && !fits && may_match(i, a); ++b) fits = may_match(j, b) && agree(i, a, j, b);
            if (fits) continue;
            sum += std::min(more[i], more[j]);
            more[i] = more[j] = 0;
        }
    return sum;
}

double lacking(const ModelAxes& axes, const std::vector<SensedCentre>& centres) {
    return AxisFits(axes, centres).lacking();
}

}  // namespace tanteo
