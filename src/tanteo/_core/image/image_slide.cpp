#include "image/image_slide.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "lanes/lane_kernels.hpp"

namespace tanteo {

namespace {

constexpr size_t EVALUATED = 40;  // positions for each kept pose; adjacent ones are then removed

// Cell of a pixel in the tables, relative to the cell of the centre. Pixels beyond the margin, or not in front of the
// camera, are at the end of the margin.
int64_t cell_of(const SlideTables& t, const Pixel& pixel, const Pixel& centre, int64_t channel) {
    const auto along = [&](double off) {
        const double cells = off / t.cell + t.margin;
        return cells > 0 ? std::lrint(std::min(cells, 2.0 * t.margin - 1)) : 0;
    };
    return (channel * t.rows + along(pixel.y - centre.y)) * t.columns + along(pixel.x - centre.x);
}

// Numbers below a count in an order in which the first ones are always evenly spread (Kronecker's sequence).
std::vector<int> spread_order(int count) {
    std::vector<std::pair<double, int>> keys;
    for (int k = 0; k < count; ++k) keys.push_back({std::fmod(0.6180339887498949 * k, 1.0), k});
    std::sort(keys.begin(), keys.end());
    std::vector<int> order;
    for (const auto& [key, k] : keys) order.push_back(k);
    return order;
}

// Cells of edge samples at even distances along the visible edges, relative to the cell of the position.
std::vector<int64_t> draw(const EdgeFrame& frame, const Lens& lens, const Pose& pose, const Pixel& centre,
                          const SlideTables& tables, const std::vector<int>& order) {
    const auto at = [&](const Vec3& p) { return project(lens, pose.R * p + pose.t); };
    const size_t N = frame.size();
    const auto view = frame.view_from(into_part(pose, {}));
    std::vector<Pixel> pixels(N), along(N);
    std::vector<double> upto(N);
    double total = 0;
    for (size_t k = 0; k < N; ++k) {
        const EdgeSample& s = frame.samples[k];
        pixels[k] = at(s.at);
        const Pixel beside = at(s.at + 1e-3 * s.along);
        along[k] = {beside.x - pixels[k].x, beside.y - pixels[k].y};
        const double span = std::sqrt(along[k].x * along[k].x + along[k].y * along[k].y) * s.length;
        total += view->shown[k] && span > 0 ? span : 0;
        upto[k] = total;
    }
    std::vector<int64_t> out;
    for (size_t j = 0; j < order.size() && N; ++j) {
        const auto next = std::lower_bound(upto.begin(), upto.end(), (order[j] + 0.5) / order.size() * total);
        const size_t n = std::min<size_t>(next - upto.begin(), N - 1);
        out.push_back(cell_of(tables, pixels[n], centre, tables.channels.of(-along[n].y, along[n].x)));
    }
    return out;
}

// Sum of a table at offsets from a cell.
double sum_under(const float* from, const std::vector<int64_t>& offsets) {
    double sum = 0;
    for (const int64_t offset : offsets) sum += from[offset];
    return sum;
}

// Consecutive positions of one row of cells.
struct Run {
    size_t first, count;
    int64_t from;  // cell of the first position
    size_t cells;
};

std::vector<Run> runs_of(const std::vector<int64_t>& from, const std::vector<Pixel>& places) {
    constexpr int64_t LONGEST = 256;  // cells whose sums stay in the nearest cache
    std::vector<Run> runs;
    for (size_t k = 0; k < places.size(); ++k) {
        const int64_t along = runs.empty() ? -1 : from[k] - runs.back().from;
        if (along >= 0 && along < LONGEST && places[k].y == places[k - 1].y) {
            ++runs.back().count;
            runs.back().cells = std::max(runs.back().cells, static_cast<size_t>(along) + 1);
        } else {
            runs.push_back({k, 1, from[k], 1});
        }
    }
    return runs;
}

// The cells of the tables that drawings at positions reach, as whole numbers whose sums over all samples fit into 16 bits.
// They rank the positions; the best ones are evaluated exactly.
struct Ranks {
    Ranks(const SlideTables& t, const std::vector<int64_t>& from, const std::vector<std::vector<int64_t>>& drawings,
          int samples)
        : tables(t) {
        int64_t last_row = 0, last_column = 0, bottom = 0, right = 0;
        row = column = top = left = INT64_MAX;
        for (const int64_t cell : from) {
            row = std::min(row, cell / t.columns), last_row = std::max(last_row, cell / t.columns);
            column = std::min(column, cell % t.columns), last_column = std::max(last_column, cell % t.columns);
        }
        for (const std::vector<int64_t>& drawn : drawings)
            for (const int64_t cell : drawn) {
                const int64_t y = cell / t.columns % t.rows, x = cell % t.columns;
                top = std::min(top, y), bottom = std::max(bottom, y), left = std::min(left, x), right = std::max(right, x);
            }
        if (from.empty() || top == INT64_MAX) return;
        rows = last_row - row + bottom - top + 1;
        columns = last_column - column + right - left + 1;
        std::vector<float> reached;
        reached.reserve(t.channels.count() * rows * columns);
        for (int64_t c = 0; c < t.channels.count(); ++c)
            for (int64_t y = 0; y < rows; ++y) {
                const float* begin = t.distances + ((c * t.rows + row + top + y) * t.columns + column + left);
                reached.insert(reached.end(), begin, begin + columns);
            }
        const double highest = std::max<double>(1e-9, *std::max_element(reached.begin(), reached.end()));
        scale = std::max(std::floor(65535.0 / samples), 1.0) / highest;
        costs.resize(reached.size() + SPARE_SHORTS);
        for (size_t k = 0; k < reached.size(); ++k) costs[k] = static_cast<uint16_t>(std::max(0.0f, reached[k]) * scale + 0.5);
    }
    int64_t place(int64_t cell) const { return (cell / tables.columns - row) * columns + cell % tables.columns - column; }
    int64_t offset(int64_t cell) const {
        const int64_t y = cell / tables.columns;
        return (y / tables.rows * rows + y % tables.rows - top) * columns + cell % tables.columns - left;
    }

    const SlideTables& tables;
    int64_t row, column, top, left, rows = 0, columns = 0;  // first cells of positions and drawings, and the size
    double scale = 1;
    std::vector<uint16_t> costs;
};

bool cheaper(const Slid& a, const Slid& b) {
    return a.cost != b.cost ? a.cost < b.cost : (a.yaw != b.yaw ? a.yaw < b.yaw : a.place < b.place);
}

// The cheapest of all added items.
class Cheapest {
  public:
    explicit Cheapest(size_t keep) : keep(keep) {}
    double limit() const { return heap.size() < keep ? 1e300 : heap.front().cost; }
    void add(const Slid& slid) {
        if (heap.size() == keep) {
            if (!cheaper(slid, heap.front())) return;
            std::pop_heap(heap.begin(), heap.end(), cheaper);
            heap.pop_back();
        }
        heap.push_back(slid);
        std::push_heap(heap.begin(), heap.end(), cheaper);
    }
    std::vector<Slid> sorted() {
        std::sort(heap.begin(), heap.end(), cheaper);
        return std::move(heap);
    }

  private:
    size_t keep;
    std::vector<Slid> heap;
};

std::vector<Slid> apart(const std::vector<Slid>& all, const std::vector<Pixel>& places, int yaws,
                        const SlideRules& rules) {
    std::vector<Slid> kept;
    for (const Slid& a : all) {
        if (kept.size() == rules.keep) break;
        const bool near = std::any_of(kept.begin(), kept.end(), [&](const Slid& b) {
            const int turn = std::abs(a.yaw - b.yaw);
            const Pixel &p = places[a.place], &q = places[b.place];
            return std::min(turn, yaws - turn) <= 1 && std::max(std::fabs(p.x - q.x), std::fabs(p.y - q.y)) <= rules.apart;
        });
        if (!near) kept.push_back(a);
    }
    return kept;
}

}  // namespace

int64_t SlideTables::cell_of(const Pixel& place) const {
    const double x = place.x / cell, y = place.y / cell;
    const bool within = x > -0.5 && y > -0.5 && x < columns && y < rows;
    const int64_t column = within ? std::lrint(x) : columns, row = within ? std::lrint(y) : rows;
    return column + 2 * margin > columns || row + 2 * margin > rows ? -1 : row * columns + column;
}

std::vector<Slid> slid(const EdgeFrame& frame, const Lens& lens, const std::vector<Pose>& yaws, const Vec3& centre,
                       const SlideTables& tables, const std::vector<Pixel>& places, const SlideRules& rules) {
    const std::vector<int> order = spread_order(rules.samples);
    std::vector<std::vector<int64_t>> drawings;
    for (const Pose& yaw : yaws)
        drawings.push_back(draw(frame, lens, yaw, project(lens, yaw.R * centre + yaw.t), tables, order));
    std::vector<int64_t> from;
    for (const Pixel& p : places) from.push_back(tables.cell_of(p));
    const Ranks ranks(tables, from, drawings, rules.samples);
    std::vector<int64_t> in_ranks;
    for (const int64_t cell : from) in_ranks.push_back(ranks.place(cell));
    const std::vector<Run> runs = runs_of(in_ranks, places);

    Cheapest cheapest(EVALUATED * rules.keep);
    const LaneKernels& kernels = lane_kernels();
    std::vector<uint16_t> sums;
    std::vector<int64_t> drawn;
    for (size_t yaw = 0; yaw < yaws.size(); ++yaw) {
        drawn.clear();
        for (const int64_t offset : drawings[yaw]) drawn.push_back(ranks.offset(offset));
        const double whole = ranks.scale * drawn.size();
        for (const Run& run : runs) {
            sums.resize(std::max(sums.size(), run.cells + SPARE_SHORTS));
            kernels.sums_under(ranks.costs.data() + run.from, drawn.data(), drawn.size(), run.cells, sums.data());
            double limit = cheapest.limit() * whole;
            for (size_t k = run.first; k < run.first + run.count; ++k) {
                const uint16_t sum = sums[in_ranks[k] - run.from];
                if (sum >= limit) continue;
                cheapest.add({static_cast<int>(yaw), static_cast<int>(k), sum / whole});
                limit = cheapest.limit() * whole;
            }
        }
    }
    std::vector<Slid> best = cheapest.sorted();
    for (Slid& one : best) {
        const std::vector<int64_t>& drawn = drawings[one.yaw];
        one.cost = sum_under(tables.distances + from[one.place], drawn) / std::max<size_t>(drawn.size(), 1);
    }
    std::sort(best.begin(), best.end(), cheaper);
    return apart(best, places, static_cast<int>(yaws.size()), rules);
}

}  // namespace tanteo
