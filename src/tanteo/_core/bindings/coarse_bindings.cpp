// Bindings of the coarse evaluation of points on many parts of a catalogue, from arrays in mapped files.
#include "proposals/coarse.hpp"

#include <algorithm>
#include <limits>

#include "bindings/catalogue_arguments.hpp"
#include "parallel.hpp"

namespace tanteo {

namespace {

using Levels = nb::ndarray<const int8_t, nb::c_contig, nb::device::cpu>;

// First row of each part and the end of the last, checked: increasing, within the array.
const int64_t* starts_of(const Starts& starts, const char* name, size_t parts, size_t total) {
    if (starts.size() != parts + 1) refuse(name, "expected one more than parts, got " + std::to_string(starts.size()));
    for (size_t k = 0; k < parts; ++k)
        if (starts.data()[k] < 0 || starts.data()[k] > starts.data()[k + 1]) refuse(name, "expected increasing numbers");
    if (starts.data()[parts] > static_cast<int64_t>(total)) refuse(name, "expected no more than there are");
    return starts.data();
}

std::vector<CoarsePoint> points_of(const Doubles& at, const Doubles& normals, const Doubles& sds, const Doubles& tilts,
                                   const Doubles& radii) {
    const size_t n = expect(at, "points", {ANY, 3});
    expect(normals, "normals", {n, 3});
    expect(sds, "sds", {n});
    expect(tilts, "tilts", {n});
    expect(radii, "radii", {n});
    std::vector<CoarsePoint> out(n);
    for (size_t k = 0; k < n; ++k) {
        out[k].at = load(at.data() + 3 * k);
        out[k].normal = load(normals.data() + 3 * k);
        out[k].oriented = squared(out[k].normal) > 0.25;
        out[k].sd = sds.data()[k];
        out[k].tilt = tilts.data()[k];
        out[k].radius = radii.data()[k];
    }
    return out;
}

// Box and field of each part, from the arrays of all parts.
class Parts {
  public:
    Parts(Levels field, Starts field_starts, Floats grids, Doubles spacings, Doubles centres, Doubles boxes, double levels)
        : grids(grids), spacings(spacings), centres(centres), boxes(boxes), field(field), levels(levels) {
        const size_t n = expect(spacings, "spacings", {ANY});
        expect(centres, "centres", {n, 3});
        expect(boxes, "boxes", {n, 6});
        if (grids.size() != 7 * n) refuse("grid", "expected seven numbers a part");
        field_at = starts_of(field_starts, "field_start", n, field.size());
        count = n;
    }

    size_t count = 0;

    CoarsePart part(size_t k) const {
        CoarsePart out;
        const float* g = grids.data() + 7 * k;
        out.field.origin = {g[0], g[1], g[2]};
        out.field.step = g[3];
        out.field.unit = out.field.step / levels;
        size_t nodes = 1;
        for (int i = 0; i < 3; ++i) {
            if (!(g[4 + i] >= 2 && g[4 + i] <= 1000)) refuse("grid", "expected 2 to 1000 nodes along each axis");
            out.field.shape[i] = static_cast<int>(g[4 + i]);
            nodes *= out.field.shape[i];
        }
        if (!(out.field.step > 0) || nodes != static_cast<size_t>(field_at[k + 1] - field_at[k]))
            refuse("grid", "expected as many nodes as there are in the field");
        out.field.levels = field.data() + field_at[k];
        out.spacing = spacings.data()[k];
        out.centre = load(centres.data() + 3 * k);
        out.low = load(boxes.data() + 6 * k);
        out.high = load(boxes.data() + 6 * k + 3);
        return out;
    }

  private:
    Floats grids;
    Doubles spacings, centres, boxes;
    Levels field;
    double levels;
    const int64_t* field_at = nullptr;
};

// End of the consecutive rows of one kind, which share the first views.
size_t end_of_kind(const std::vector<int>& kinds, size_t begin) {
    size_t end = begin;
    while (end < kinds.size() && kinds[end] == kinds[begin]) ++end;
    return end;
}

nb::tuple coarse(Levels field, Starts field_starts, Floats grids, Doubles spacings, Doubles centres, Doubles boxes,
                 double levels, Ints rows, Ints kinds, double best, double gap, Doubles at, Doubles normals, Doubles sds,
                 Doubles tilts, Doubles radii, double most, int stepped, int keep) {
    const Parts parts(field, field_starts, grids, spacings, centres, boxes, expect(levels, "levels", 1, 1e6));
    const std::vector<CoarsePoint> given = points_of(at, normals, sds, tilts, radii);
    if (given.empty()) refuse("points", "expected one or more");
    const std::vector<int> chosen = expect(rows, "rows", ANY, 0, static_cast<int64_t>(parts.count) - 1),
                           of = expect(kinds, "kinds", chosen.size(), 0, static_cast<int64_t>(parts.count) - 1);
    CoarseEffort effort;
    effort.most = expect(most, "most", 1e-3, 1e9);
    effort.keep = static_cast<int>(expect(keep, "keep", 1, 1000));
    effort.stepped = static_cast<int>(expect(stepped, "stepped", 1, 10000));
    const int begin = effort.begin;
    const size_t R = chosen.size();
    BestPoses poses(R, effort.keep, given.size() * effort.most);
    std::vector<double> scores(R, given.size() * effort.most);
    {
        nb::gil_scoped_release release;
        double cell = std::numeric_limits<double>::infinity();
        for (const int row : chosen) cell = std::min(cell, coarse_cell(parts.part(row)));
        const CoarsePoints points = coarse_points(given, cell);
        std::vector<CoarseRanked> ranked(R);
        std::vector<size_t> ends{0};
        while (ends.back() < R) ends.push_back(end_of_kind(of, ends.back()));
        for_all(ends.size() - 1, [&] {
            return [&](size_t k) {
                const size_t first = ends[k], end = ends[k + 1];
                CoarseEffort own = effort;
                own.begin = static_cast<int>(std::max<size_t>(own.stepped, std::min<size_t>(begin, own.stepped * (end - first))));
                const std::vector<CoarseView> views = coarse_starts(parts.part(chosen[first]), points, own);
                for_all(end - first, [&] {
                    return [&](size_t i) {
                        const size_t r = first + i;
                        ranked[r] = coarse_ranked(parts.part(chosen[r]), points, views, own);
                        if (!ranked[r].empty()) scores[r] = ranked[r].front().first;
                    };
                });
            };
        });
        for (const double score : scores) best = std::min(best, score);
        std::vector<std::vector<CoarsePose>> found(R);
        for_all(R, [&] {
            return [&](size_t r) {
                if (scores[r] <= best + gap) found[r] = coarse_poses(parts.part(chosen[r]), points, std::move(ranked[r]), effort);
            };
        });
        for (size_t r = 0; r < R; ++r) poses.put(r, found[r]);
    }
    return nb::make_tuple(list_of(std::move(scores)), poses.costs_out(), poses.poses_out());
}

}  // namespace

void offer_coarse(nb::module_& m) {
    using namespace nb::literals;
    m.def("coarse", &coarse, "field"_a, "field_start"_a, "grid"_a, "spacings"_a, "centres"_a, "boxes"_a, "levels"_a,
          "rows"_a, "kinds"_a, "best"_a, "gap"_a, "points"_a, "normals"_a, "sds"_a, "tilts"_a, "radii"_a, "most"_a,
          "stepped"_a, "keep"_a);
}

}  // namespace tanteo
