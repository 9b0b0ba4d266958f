#include <algorithm>
#include <cmath>
#include <iterator>

#include "proposals/coarse.hpp"

namespace tanteo {

namespace {

constexpr double PI = 3.14159265358979323846;
constexpr int TURNS[] = {288, 1152, 4608};  // adjacent turns are about 23, 15 and 9 degrees apart
constexpr size_t SPARE = 1;                 // points at each end of an axis that may be outliers
constexpr double EQUAL = 1.5;               // distance of equal views: in steps between turns, and in cells
constexpr double SURE = 3;                  // standard deviations

// Uniform attitudes: a super-Fibonacci spiral of quaternions (Alexa, CVPR 2022).
std::vector<Mat3> even_turns(int count) {
    constexpr double PHI = 1.4142135623730951, PSI = 1.533751168755204288118041;
    std::vector<Mat3> out;
    for (int k = 0; k < count; ++k) {
        const double s = (k + 0.5) / count, r = std::sqrt(s), q = std::sqrt(1 - s), a = 2 * PI * (k + 0.5) / PHI,
                     b = 2 * PI * (k + 0.5) / PSI;
        const double x = r * std::sin(a), y = r * std::cos(a), z = q * std::sin(b), w = q * std::cos(b);
        out.push_back({{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 2 * (x * y + z * w),
                        1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 2 * (x * z - y * w), 2 * (y * z + x * w),
                        1 - 2 * (x * x + y * y)}});
    }
    return out;
}

// The values with `SPARE` smaller and with `SPARE` larger ones.
class Ends {
  public:
    Ends() {
        std::fill(low, low + SPARE + 1, 3e38f);
        std::fill(high, high + SPARE + 1, -3e38f);
    }
    void add(float value) {
        float smaller = value, larger = value;
        for (size_t k = 0; k <= SPARE; ++k) {
            const float least = std::min(low[k], smaller), most = std::max(high[k], larger);
            smaller = std::max(low[k], smaller);
            larger = std::min(high[k], larger);
            low[k] = least;
            high[k] = most;
        }
    }
    float low[SPARE + 1], high[SPARE + 1];
};

// Extent of points along each axis at uniform attitudes.
CoarseTurns turned(const std::vector<Vec3>& points, size_t level) {
    static const std::vector<Mat3> even[] = {even_turns(TURNS[0]), even_turns(TURNS[1]), even_turns(TURNS[2])};
    CoarseTurns out;
    out.into = even[level].data();
    out.count = even[level].size();
    out.apart = std::cbrt(6 * PI / out.count);  // balls of this radius fill the volume of all attitudes
    const size_t cut = std::min(SPARE, (points.size() - 1) / 3);
    for (size_t turn = 0; turn < out.count; ++turn) {
        Ends ends[3];
        for (const Vec3& point : points) {
            const Vec3 at = out.into[turn] * point;
            for (int k = 0; k < 3; ++k) ends[k].add(static_cast<float>(at[k]));
        }
        for (int k = 0; k < 3; ++k) {
            out.width[k].push_back(ends[k].high[cut] - ends[k].low[cut]);
            out.middle[k].push_back(0.5f * (ends[k].low[cut] + ends[k].high[cut]));
        }
    }
    return out;
}

// The fewest turns between which most points move at most a cell.
const CoarseTurns& turns_for(const CoarsePoints& points, double cell) {
    for (const CoarseTurns& turns : points.turns)
        if (turns.apart * points.reach <= cell) return turns;
    return points.turns.back();
}

class Starts {
  public:
    Starts(const CoarsePart& part, const CoarsePoints& points, const CoarseEffort& effort)
        : part(part), points(points), effort(effort), cell(coarse_cell(part)), of(turns_for(points, cell)),
          near(1 + 2 * std::cos(EQUAL * of.apart)) {}

    std::vector<CoarseView> found() {
        size_t total = 0;
        for (size_t turn = 0; turn < of.count; ++turn) {
            if (!fits(turn)) continue;
            regions.push_back(region_of(turn));
            total += regions.back().all();
        }
        const size_t every = std::max<size_t>(1, total / effort.poses);
        size_t next = 0, before = 0;
        for (const Region& region : regions) {
            for (; next < before + region.all(); next += every) score(region, next - before);
            before += region.all();
        }
        std::vector<CoarseView> out;
        for (const Kept& one : kept) out.push_back({of.into[one.turn], one.at});
        return out;
    }

  private:
    struct Region {  // possible positions of the points at an attitude
        size_t turn = 0, count[3] = {1, 1, 1};
        double low[3] = {}, step[3] = {};
        size_t all() const { return count[0] * count[1] * count[2]; }
    };
    struct Kept {
        size_t turn = 0;
        Vec3 at;
        double cost = 0;
    };
    const CoarsePart& part;
    const CoarsePoints& points;
    const CoarseEffort& effort;
    const double cell;
    const CoarseTurns& of;
    const double near;  // trace of the largest small turn
    std::vector<Region> regions;
    std::vector<Kept> kept;

    // Whether the box can contain the points at an attitude, or at one between it and the adjacent ones.
    bool fits(size_t turn) const {
        const double slack = 2 * (of.apart * points.reach + points.noise);
        for (int k = 0; k < 3; ++k)
            if (of.width[k][turn] > part.high[k] - part.low[k] + slack) return false;
        return true;
    }

    Region region_of(size_t turn) const {
        Region region;
        region.turn = turn;
        for (int k = 0; k < 3; ++k) {
            const double free = std::max(part.high[k] - part.low[k] - of.width[k][turn], 0.0);
            region.count[k] = std::max<size_t>(1, static_cast<size_t>(free / cell + 0.5));
            region.step[k] = free / region.count[k];
            region.low[k] = 0.5 * (part.low[k] + part.high[k] - free + region.step[k]) - of.middle[k][turn];
        }
        return region;
    }

    void score(const Region& region, size_t number) {
        Kept one;
        one.turn = region.turn;
        for (int k = 0; k < 3; ++k) {
            one.at[k] = region.low[k] + region.step[k] * (number % region.count[k]);
            number /= region.count[k];
        }
        const double limit = kept.size() < static_cast<size_t>(effort.begin) ? 1e300 : kept.back().cost;
        one.cost = coarse_score(part, points, {of.into[one.turn], one.at}, effort.most, limit);
        if (one.cost < limit) keep(one);
    }

    // Inserts in order; among nearly equal views only the best stays.
    void keep(const Kept& one) {
        const auto same = std::find_if(kept.begin(), kept.end(), [&](const Kept& other) { return are_equal(other, one); });
        if (same != kept.end()) {
            if (same->cost <= one.cost) return;
            kept.erase(same);
        }
        const auto before = [](const Kept& a, const Kept& b) { return a.cost < b.cost; };
        kept.insert(std::upper_bound(kept.begin(), kept.end(), one, before), one);
        if (kept.size() > static_cast<size_t>(effort.begin)) kept.pop_back();
    }

    bool are_equal(const Kept& a, const Kept& b) const {
        if (squared(a.at - b.at) >= EQUAL * EQUAL * cell * cell) return false;
        double trace = 0;
        for (int i = 0; i < 9; ++i) trace += of.into[a.turn].m[i] * of.into[b.turn].m[i];
        return trace > near;
    }
};

}  // namespace

CoarsePoints coarse_points(const std::vector<CoarsePoint>& points, double cell) {
    CoarsePoints out;
    for (const CoarsePoint& point : points) out.middle += (1.0 / points.size()) * point.at;
    std::vector<double> away;
    std::vector<Vec3> about;
    for (size_t k = 0; k < points.size(); ++k) {
        const CoarsePoint& point = points[k];
        const Vec3& p = about.emplace_back(point.at - out.middle);
        away.push_back(norm(p));
        out.noise = std::max(out.noise, SURE * point.sd + std::fabs(point.radius));
        out.oriented = out.oriented || point.oriented;
        const size_t l = k % LANES;
        if (l == 0) out.blocks.emplace_back();
        CoarseBlock& b = out.blocks.back();
        const auto narrow = [](double value) { return static_cast<float>(value); };
        b.x[l] = narrow(p.x), b.y[l] = narrow(p.y), b.z[l] = narrow(p.z), b.weight[l] = 1;
        b.radius[l] = narrow(point.radius), b.var[l] = narrow(point.sd * point.sd);
        b.nx[l] = narrow(point.normal.x), b.ny[l] = narrow(point.normal.y), b.nz[l] = narrow(point.normal.z);
        b.tilt2[l] = narrow(point.tilt * point.tilt), b.oriented[l] = point.oriented ? 1.0f : 0.0f;
    }
    std::sort(away.begin(), away.end());
    out.reach = away[3 * (away.size() - 1) / 4];
    for (size_t level = 0; level < std::size(TURNS); ++level) {
        out.turns.push_back(turned(about, level));
        if (out.turns.back().apart * out.reach <= cell) break;
    }
    return out;
}

std::vector<CoarseView> coarse_starts(const CoarsePart& part, const CoarsePoints& points, const CoarseEffort& effort) {
    return Starts(part, points, effort).found();
}

}  // namespace tanteo
