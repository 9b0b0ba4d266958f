#include <algorithm>
#include <cmath>

#include "coarse.hpp"

namespace tanteo {

namespace {

constexpr double PI = 3.14159265358979323846;

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

// How far points reach along each axis after turns, a few at each end left aside.
CoarseTurns turned(const std::vector<Vec3>& points, int count, int spare) {
    CoarseTurns out;
    out.into = even_turns(count);
    out.apart = std::cbrt(6 * PI / count);  // balls of that radius have the volume of all attitudes
    const size_t n = points.size(), cut = std::min<size_t>(spare, (n - 1) / 3);
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

// Best poses of those that are even over all attitudes and over the places where the points are in a part's box.
class Starts {
  public:
    Starts(const CoarsePart& part, const CoarsePoints& points, const CoarseEffort& effort)
        : part(part), points(points), effort(effort), cell(effort.cell * part.spacing) {
        size_t level = 0;
        while (level + 1 < points.turns.size() && points.turns[level].apart * points.reach > effort.turn * cell) ++level;
        of = &points.turns[level];
        slack = static_cast<float>(effort.slack * of->apart * points.reach + points.noise);
    }

    std::vector<CoarseView> found() {
        inside();
        size_t total = 0;
        for (const Room& room : rooms) total += room.count[0] * room.count[1] * room.count[2];
        const size_t every = std::max<size_t>(1, total / effort.poses);
        size_t next = 0, at = 0;
        for (const Room& room : rooms) {
            const size_t all = room.count[0] * room.count[1] * room.count[2];
            for (; next < at + all; next += every) try_at(room, next - at);
            at += all;
        }
        std::vector<CoarseView> out;
        for (const Kept& one : kept) out.push_back({of->into[one.turn], one.at});
        return out;
    }

  private:
    struct Room {  // where the points may be, turned in one way
        int turn = 0, count[3] = {1, 1, 1};
        float low[3] = {}, step[3] = {};
    };
    struct Kept {
        int turn = 0;
        Vec3 at;
        double cost = 0;
    };
    const CoarsePart& part;
    const CoarsePoints& points;
    const CoarseEffort& effort;
    const CoarseTurns* of = nullptr;
    double cell;
    float slack = 0;
    std::vector<Room> rooms;
    std::vector<Kept> kept;

    void inside() {
        float side[3];
        for (int k = 0; k < 3; ++k) side[k] = static_cast<float>(part.high[k] - part.low[k]) + 2 * slack;
        const float *x = of->width[0].data(), *y = of->width[1].data(), *z = of->width[2].data();
        for (size_t r = 0; r < of->into.size(); ++r) {
            if (x[r] > side[0] || y[r] > side[1] || z[r] > side[2]) continue;
            Room room;
            room.turn = static_cast<int>(r);
            for (int k = 0; k < 3; ++k) {
                const float span = std::max(side[k] - 2 * slack - of->width[k][r], 0.0f);
                room.count[k] = std::max(1, static_cast<int>(span / cell + 0.5f));
                const float middle = 0.5f * static_cast<float>(part.low[k] + part.high[k]) - of->middle[k][r];
                room.step[k] = span / room.count[k];
                room.low[k] = middle - 0.5f * span + 0.5f * room.step[k];
            }
            rooms.push_back(room);
        }
    }

    void try_at(const Room& room, size_t number) {
        Kept one;
        one.turn = room.turn;
        for (int k = 0; k < 3; ++k) {
            one.at[k] = room.low[k] + room.step[k] * (number % room.count[k]);
            number /= room.count[k];
        }
        const double limit = kept.size() < static_cast<size_t>(effort.begin) ? 1e300 : kept.back().cost;
        one.cost = coarse_score(part, points, {of->into[one.turn], one.at}, effort, limit);
        if (one.cost < limit) keep(one);
    }

    // In order; of those that are turned and placed nearly alike only the best.
    void keep(const Kept& one) {
        size_t k = 0;
        while (k < kept.size() && !near(kept[k], one)) ++k;
        if (k < kept.size()) {
            if (kept[k].cost <= one.cost) return;
            kept.erase(kept.begin() + k);
        }
        size_t to = kept.size();
        while (to > 0 && kept[to - 1].cost > one.cost) --to;
        kept.insert(kept.begin() + to, one);
        if (kept.size() > static_cast<size_t>(effort.begin)) kept.pop_back();
    }

    bool near(const Kept& a, const Kept& b) const {
        const Mat3 &A = of->into[a.turn], &B = of->into[b.turn];
        double trace = 0;
        for (int i = 0; i < 9; ++i) trace += A.m[i] * B.m[i];
        return trace > 1 + 2 * std::cos(effort.alike * of->apart) && squared(a.at - b.at) < 2.25 * cell * cell;
    }
};

}  // namespace

CoarsePoints coarse_points(const std::vector<CoarsePoint>& points, int spare, int most_turns) {
    CoarsePoints out;
    for (const CoarsePoint& point : points) out.centre += (1.0 / points.size()) * point.at;
    std::vector<double> away;
    std::vector<Vec3> about;
    for (size_t k = 0; k < points.size(); ++k) {
        const CoarsePoint& point = points[k];
        about.push_back(point.at - out.centre);
        away.push_back(norm(about.back()));
        out.noise = std::max(out.noise, 3 * point.sd + std::fabs(point.radius));
        out.oriented = out.oriented || point.oriented;
        if (k % LANES == 0) out.blocks.emplace_back();
        CoarseBlock& b = out.blocks.back();
        const size_t l = k % LANES;
        b.x[l] = about[k].x, b.y[l] = about[k].y, b.z[l] = about[k].z;
        b.radius[l] = point.radius, b.var[l] = point.sd * point.sd, b.weight[l] = 1;
        b.nx[l] = point.normal.x, b.ny[l] = point.normal.y, b.nz[l] = point.normal.z;
        b.tilt2[l] = point.tilt * point.tilt, b.oriented[l] = point.oriented ? 1.0f : 0.0f;
    }
    std::sort(away.begin(), away.end());
    out.reach = away.empty() ? 0 : away[(3 * away.size()) / 4];
    if (!points.empty())
        for (int count : {most_turns / 16, most_turns / 4, most_turns}) out.turns.push_back(turned(about, count, spare));
    return out;
}

std::vector<CoarseView> coarse_starts(const CoarsePart& part, const CoarsePoints& points, const CoarseEffort& effort) {
    return Starts(part, points, effort).found();
}

}  // namespace tanteo
