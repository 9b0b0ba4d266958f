#include "proposals/coarse.hpp"

#include <algorithm>

#include "proposals/coarse_into.hpp"

namespace tanteo {

namespace {

constexpr double CELL = 0.7;       // cell over the spacing of surface samples: with 1, poses are missed three times as often
constexpr double BETWEEN = 0.316;  // error of a field at the nearest node instead of the point, in steps of its grid

}  // namespace

double coarse_cell(const CoarsePart& part) { return CELL * part.spacing; }

double coarse_score(const CoarsePart& part, const CoarsePoints& points, const CoarseView& view, double most, double limit) {
    const CoarseField& f = part.field;
    const double sd = 0.5 * coarse_cell(part) / f.step;  // a view is up to half a cell off
    const float per = static_cast<float>(0.5 / (sd * sd + BETWEEN * BETWEEN)), unit = static_cast<float>(f.unit / f.step),
                top = static_cast<float>(most), inverse = static_cast<float>(1 / f.step);
    const float mx = f.shape[0] - 1.0f, my = f.shape[1] - 1.0f, mz = f.shape[2] - 1.0f;
    const CoarseInto into(f, view);
    float sum = 0;
    for (const CoarseBlock& b : points.blocks) {
        float x[LANES], y[LANES], z[LANES], off[LANES], d[LANES], cost[LANES];
        int node[LANES];
        place(into, b, x, y, z);
        for (int l = 0; l < LANES; ++l) {
            const float cx = std::min(mx, std::max(0.0f, x[l])), cy = std::min(my, std::max(0.0f, y[l])),
                        cz = std::min(mz, std::max(0.0f, z[l]));
            off[l] = (x[l] - cx) * (x[l] - cx) + (y[l] - cy) * (y[l] - cy) + (z[l] - cz) * (z[l] - cz);
            node[l] = (static_cast<int>(cx + 0.5f) * f.shape[1] + static_cast<int>(cy + 0.5f)) * f.shape[2] +
                      static_cast<int>(cz + 0.5f);
        }
        for (int l = 0; l < LANES; ++l) d[l] = f.levels[node[l]];
        for (int l = 0; l < LANES; ++l) {
            const float e = unit * d[l] - b.radius[l] * inverse;
            cost[l] = std::min((e * e + off[l]) * per, top) * b.weight[l];
        }
        for (int l = 0; l < LANES; ++l) sum += cost[l];
        if (sum > limit) break;
    }
    return sum;
}

CoarseRanked coarse_ranked(const CoarsePart& part, const CoarsePoints& points, const std::vector<CoarseView>& views,
                           const CoarseEffort& effort) {
    CoarseRanked best;
    const size_t most = effort.stepped;
    for (const CoarseView& view : views) {
        const double limit = best.size() < most ? 1e300 : best.back().first;
        const double cost = coarse_score(part, points, view, effort.most, limit);
        if (!(cost < limit)) continue;
        if (best.size() == most) best.pop_back();
        const auto after = [](double a, const auto& b) { return a < b.first; };
        best.insert(std::upper_bound(best.begin(), best.end(), cost, after), {cost, view});
    }
    return best;
}

}  // namespace tanteo
