#include <algorithm>
#include <cmath>

#include "proposals/coarse.hpp"

namespace tanteo {

namespace {

constexpr double PI = 3.14159265358979323846;
constexpr int TURNS[] = {288, 1152, 4608};  // neighbours are about 23, 15 and 9 degrees apart
constexpr size_t SPARE = 1;                 // points at each end of an axis that may be outliers
constexpr double ALIKE = 1.5;               // turned by less, in steps between turns, and placed so, in cells
constexpr double SURE = 3;                  // standard deviations

// Turns that are even over all attitudes: a super-Fibonacci spiral of quaternions (Alexa, CVPR 2022).
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

// What points take up along each axis after turns.
CoarseTurns turned(const std::vector<Vec3>& points, int count) {
    CoarseTurns out;
    out.into = even_turns(count);
    out.apart = std::cbrt(6 * PI / count);  // balls of that radius have the volume of all attitudes
    const size_t n = points.size(), cut = std::min(SPARE, (n - 1) / 3);
    std::vector<float> along(n);
    for (const Mat3& into : out.into)
        for (int k = 0; k < 3; ++k) {
            for (size_t i = 0; i < n; ++i) along[i] = static_cast<float>((into * points[i])[k]);
            std::nth_element(along.begin(), along.begin() + cut, along.end());
            const float low = along[cut];
            std::nth_element(along.begin() + cut, along.end() - 1 - cut, along.end());
            const float high = along[n - 1 - cut];
            out.width[k].push_back(high - low);
            out.middle[k].push_back(0.5f * (low + high));
        }
    return out;
}

// The fewest turns by which most points move no farther than a cell.
const CoarseTurns& turns_for(const CoarsePoints& points, double cell) {
    for (const CoarseTurns& turns : points.turns)
        if (turns.apart * points.reach <= cell) return turns;
    return points.turns.back();
}

class Starts {
  public:
    Starts(const CoarsePart& part, const CoarsePoints& points, const CoarseEffort& effort)
        : part(part), points(points), effort(effort), cell(coarse_cell(part)), of(turns_for(points, cell)),
          near(1 + 2 * std::cos(ALIKE * of.apart)) {}

    std::vector<CoarseView> found() {
        size_t total = 0;
        for (size_t turn = 0; turn < of.into.size(); ++turn) {
            if (!fits(turn)) continue;
            rooms.push_back(room_of(turn));
            total += rooms.back().all();
        }
        const size_t every = std::max<size_t>(1, total / effort.poses);
        size_t next = 0, before = 0;
        for (const Room& room : rooms) {
            for (; next < before + room.all(); next += every) score(room, next - before);
            before += room.all();
        }
        std::vector<CoarseView> out;
        for (const Kept& one : kept) out.push_back({of.into[one.turn], one.at});
        return out;
    }

  private:
    struct Room {  // where the points may be after a turn
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
    const double near;  // trace of a turn that is small
    std::vector<Room> rooms;
    std::vector<Kept> kept;

    // Whether the box holds the points after a turn, or after one between it and its neighbours.
    bool fits(size_t turn) const {
        const double slack = 2 * (of.apart * points.reach + points.noise);
        for (int k = 0; k < 3; ++k)
            if (of.width[k][turn] > part.high[k] - part.low[k] + slack) return false;
        return true;
    }

    Room room_of(size_t turn) const {
        Room room;
        room.turn = turn;
        for (int k = 0; k < 3; ++k) {
            const double free = std::max(part.high[k] - part.low[k] - of.width[k][turn], 0.0);
            room.count[k] = std::max<size_t>(1, static_cast<size_t>(free / cell + 0.5));
            room.step[k] = free / room.count[k];
            room.low[k] = 0.5 * (part.low[k] + part.high[k] - free + room.step[k]) - of.middle[k][turn];
        }
        return room;
    }

    void score(const Room& room, size_t number) {
        Kept one;
        one.turn = room.turn;
        for (int k = 0; k < 3; ++k) {
            one.at[k] = room.low[k] + room.step[k] * (number % room.count[k]);
            number /= room.count[k];
        }
        const double limit = kept.size() < static_cast<size_t>(effort.begin) ? 1e300 : kept.back().cost;
        one.cost = coarse_score(part, points, {of.into[one.turn], one.at}, effort.most, limit);
        if (one.cost < limit) keep(one);
    }

    // Sorted; of nearly equal rotations and positions only the best.
    void keep(const Kept& one) {
        const auto like = std::find_if(kept.begin(), kept.end(), [&](const Kept& other) { return alike(other, one); });
        if (like != kept.end()) {
            if (like->cost <= one.cost) return;
            kept.erase(like);
        }
        const auto before = [](const Kept& a, const Kept& b) { return a.cost < b.cost; };
        kept.insert(std::upper_bound(kept.begin(), kept.end(), one, before), one);
        if (kept.size() > static_cast<size_t>(effort.begin)) kept.pop_back();
    }

    bool alike(const Kept& a, const Kept& b) const {
        if (squared(a.at - b.at) >= ALIKE * ALIKE * cell * cell) return false;
        double trace = 0;
        for (int i = 0; i < 9; ++i) trace += of.into[a.turn].m[i] * of.into[b.turn].m[i];
        return trace > near;
    }
};

}  // namespace

CoarsePoints coarse_points(const std::vector<CoarsePoint>& points) {
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
    for (const int count : TURNS) out.turns.push_back(turned(about, count));
    return out;
}

std::vector<CoarseView> coarse_starts(const CoarsePart& part, const CoarsePoints& points, const CoarseEffort& effort) {
    return Starts(part, points, effort).found();
}

}  // namespace tanteo
