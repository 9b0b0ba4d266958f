#include "proposals/propose.hpp"

#include <cmath>

#include "normal.hpp"

namespace tanteo {

namespace {


struct Axes {  // a line and two directions across it
    Vec3 e, y, z;
    explicit Axes(const Vec3& along) : e(along), y(any_across(along)), z(cross(along, y)) {}
};

// Attitude that maps the part's axes to the world's, turned about the line by an angle.
Mat3 attitude(const Axes& world, const Axes& part, double c, double s) {
    Mat3 R;
    const Vec3 y = c * part.y + s * part.z, z = -s * part.y + c * part.z;
    add_outer(R, 1, world.e, part.e);
    add_outer(R, 1, world.y, y);
    add_outer(R, 1, world.z, z);
    return R;
}

}  // namespace

double score(const Shape& shape, const Problem& problem, const std::vector<int>& rows, const Pose& pose, double blur,
             double tilt, double limit) {
    double sum = 0;
    for (const int j : rows) {
        sum += problem.factors[j]->rough_cost(shape, pose, blur, tilt);
        if (sum > limit) break;
    }
    return sum;
}

std::vector<Proposal> propose(const Shape& shape, const Problem& problem, const std::vector<int>& rows, int from, int to,
                              const Effort& effort, uint64_t seed) {
    Random random{seed};
    std::vector<Proposal> got;
    std::vector<double> heap;
    std::vector<int> partners;
    double bound = 1e300;
    const Factor &P = *problem.factors[from], &Q = *problem.factors[to];
    const double gap = norm(Q.at - P.at);
    if (!(gap > 0)) return {};
    const Axes world((1 / gap) * (Q.at - P.at));
    const Sites firsts = P.sites(shape), seconds = Q.sites(shape);
    if (!firsts.size() || !seconds.size()) return {};
    const bool oriented = P.oriented && Q.oriented;
    const Vec3 middle = 0.5 * (P.at + Q.at);
    const double low = std::max(gap - effort.tolerance, 0.0), high = gap + effort.tolerance;
    int done = 0;
    for (int tries = 0; done < effort.per_pair && tries < 3 * effort.per_pair; ++tries) {
        const auto [A, na] = firsts[random.next() % firsts.size()];
        const auto fits = [&, A = A, na = na](const Site& there) {
            const auto& [B, nb] = there;
            const double d2 = squared(B - A);
            if (!(d2 > 0) || d2 < low * low || d2 > high * high) return false;
            if (!oriented) return true;
            const Vec3 e = (1 / std::sqrt(d2)) * (B - A);
            return std::fabs(dot(na, e) - dot(P.direction, world.e)) < 2 * effort.tilt &&
                   std::fabs(dot(nb, e) - dot(Q.direction, world.e)) < 2 * effort.tilt &&
                   std::fabs(dot(na, nb) - dot(P.direction, Q.direction)) < 2.5 * effort.tilt;
        };
        partners.clear();
        const size_t window = random.next() % seconds.size();  // samples are in random order: consecutive ones are a random subset
        const size_t some = seconds.window();
        for (size_t k = 0; k < some; ++k) {
            const size_t b = (window + k) % seconds.size();
            if (fits(seconds[b])) partners.push_back(static_cast<int>(b));
        }
        if (partners.empty()) continue;
        const auto [B, nb] = seconds[partners[random.next() % partners.size()]];
        const double length = norm(B - A);
        if (!(length > 0)) continue;
        const Axes part((1 / length) * (B - A));
        ++done;
        double first = 0, step = 2 * PI / effort.spins;
        int spins = effort.spins;
        if (oriented) {  // the spin that aligns both normals best
            double c = 0, s = 0;
            for (int w = 0; w < 2; ++w) {
                const Vec3 &m = w ? Q.direction : P.direction, &g = w ? nb : na;
                const double my = dot(m, world.y), mz = dot(m, world.z), gy = dot(g, part.y), gz = dot(g, part.z);
                c += my * gy + mz * gz;
                s += my * gz - mz * gy;
            }
            if (std::hypot(c, s) > 0.3) {
                step = 0.7 * effort.tilt;
                first = std::atan2(s, c) - step;
                spins = 3;
            }
        }
        Proposal best{{}, 1e300};
        double c = std::cos(first), s = std::sin(first);
        const double dc = std::cos(step), ds = std::sin(step);
        for (int spin = 0; spin < spins; ++spin) {
            Pose pose;
            pose.R = attitude(world, part, c, s);
            const double next = c * dc - s * ds;
            s = s * dc + c * ds;
            c = next;
            pose.t = middle - pose.R * (0.5 * (A + B));
            const double limit = std::min(best.cost, bound);
            const double cost = score(shape, problem, rows, pose, effort.blur, effort.tilt, limit);
            if (cost < limit) best = {pose, cost};
        }
        if (!(best.cost < bound)) continue;
        got.push_back(best);
        heap.push_back(best.cost);
        std::push_heap(heap.begin(), heap.end());
        if (static_cast<int>(heap.size()) > effort.keep + effort.keep / 2) {
            std::pop_heap(heap.begin(), heap.end());
            heap.pop_back();
            bound = heap.front();
        }
    }
    return thinned(shape, std::move(got), effort.keep, 0.5 * effort.blur, 0.5 * effort.blur / (0.25 * shape.diagonal));
}

std::vector<Proposal> thinned(const Shape& shape, std::vector<Proposal> all, int keep, double near, double near_turn) {
    std::stable_sort(all.begin(), all.end(), [](const Proposal& a, const Proposal& b) { return a.cost < b.cost; });
    std::vector<Proposal> kept;
    for (const Proposal& one : all) {
        if (static_cast<int>(kept.size()) >= keep) break;
        bool same = false;
        for (const Proposal& other : kept) {
            Vec3 v, w;
            difference(other.pose, one.pose, shape.centre, v, w);
            same = squared(v) < near * near && squared(w) < near_turn * near_turn;
            if (same) break;
        }
        if (!same) kept.push_back(one);
    }
    return kept;
}

}  // namespace tanteo
