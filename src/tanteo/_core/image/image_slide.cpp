#include "image/image_slide.hpp"

#include <algorithm>
#include <cmath>

namespace tanteo {

namespace {

constexpr size_t EVALUATED = 40;  // positions for each kept pose; adjacent ones are then removed

struct Drawing {
    std::vector<int64_t> drawn, inner;  // cells of the tables, relative to the cell of the position
};

// Cell of a pixel in the tables, relative to the cell of the centre. Pixels beyond the margin, or not in front of the
// camera, are at the end of the margin.
int64_t cell_of(const SlideTables& t, const Pixel& pixel, const Pixel& centre, int64_t channel) {
    const auto along = [&](double off) {
        const double cells = off / t.cell + t.margin;
        return cells > 0 ? std::lrint(std::min(cells, 2.0 * t.margin - 1)) : 0;
    };
    return (channel * t.rows + along(pixel.y - centre.y)) * t.columns + along(pixel.x - centre.x);
}

Drawing draw(const EdgeFrame& frame, const Lens& lens, const Pose& pose, const Vec3& middle,
             const std::vector<Vec3>& points, const SlideTables& tables, int samples) {
    const auto at = [&](const Vec3& p) { return project(lens, pose.R * p + pose.t); };
    const size_t N = frame.size();
    std::vector<char> shown(N), rims(N);
    frame.mark(pose, true, shown.data(), rims.data());
    std::vector<Pixel> pixels(N), along(N);
    std::vector<double> upto(N);
    double total = 0;
    for (size_t k = 0; k < N; ++k) {
        const EdgeSample& s = frame.samples[k];
        pixels[k] = at(s.at);
        const Pixel beside = at(s.at + 1e-3 * s.along);
        along[k] = {beside.x - pixels[k].x, beside.y - pixels[k].y};
        const double span = std::sqrt(along[k].x * along[k].x + along[k].y * along[k].y) * s.length;
        total += shown[k] && span > 0 ? span : 0;
        upto[k] = total;
    }
    const Pixel centre = at(middle);
    Drawing out;
    for (int k = 0; k < samples && N; ++k) {
        const auto next = std::lower_bound(upto.begin(), upto.end(), (k + 0.5) / samples * total);
        const size_t n = std::min<size_t>(next - upto.begin(), N - 1);
        out.drawn.push_back(cell_of(tables, pixels[n], centre, tables.channels.of(-along[n].y, along[n].x)));
    }
    for (const Vec3& p : points) out.inner.push_back(cell_of(tables, at(p), centre, 0));
    return out;
}

// Sum of a table at offsets from a cell; stops beyond a limit.
template <class Sum, class T>
double sum_under(const T* from, const std::vector<int64_t>& offsets, double limit) {
    const auto at = [&](size_t k) { return static_cast<Sum>(from[offsets[k]]); };
    Sum sum = 0;
    size_t k = 0;
    for (; k + 8 <= offsets.size() && sum <= limit; k += 8)  // eight independent loads
        sum += ((at(k) + at(k + 1)) + (at(k + 2) + at(k + 3))) + ((at(k + 4) + at(k + 5)) + (at(k + 6) + at(k + 7)));
    for (; k < offsets.size() && sum <= limit; ++k) sum += at(k);
    return sum;
}

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
                       const std::vector<Vec3>& inner, const SlideTables& tables, const std::vector<Pixel>& places,
                       const SlideRules& rules) {
    std::vector<int64_t> from;
    for (const Pixel& p : places) from.push_back(tables.cell_of(p));
    Cheapest cheapest(EVALUATED * rules.keep);
    for (size_t yaw = 0; yaw < yaws.size(); ++yaw) {
        const Drawing drawing = draw(frame, lens, yaws[yaw], centre, inner, tables, rules.samples);
        const double drawn = std::max<size_t>(drawing.drawn.size(), 1), tested = std::max<size_t>(inner.size(), 1);
        for (size_t place = 0; place < places.size(); ++place) {
            const double limit = cheapest.limit() * (1 + 1e-9), most = std::min(rules.most, limit / rules.penalty);
            const double share = sum_under<int>(tables.bare + from[place], drawing.inner, most * tested) / tested;
            if (!(share < most)) continue;
            const double left = (limit - rules.penalty * share) * drawn;
            const double far = sum_under<double>(tables.distances + from[place], drawing.drawn, left) / drawn;
            cheapest.add({static_cast<int>(yaw), static_cast<int>(place), far + rules.penalty * share});
        }
    }
    return apart(cheapest.sorted(), places, static_cast<int>(yaws.size()), rules);
}

}  // namespace tanteo
