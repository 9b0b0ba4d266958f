// Many parts of a catalogue, of which arrays lie in mapped files: poses and nats of points on each.
#include "coarse.hpp"
#include "door.hpp"

namespace tanteo {

namespace {

using Floats = nb::ndarray<const float, nb::c_contig, nb::device::cpu>;
using Levels = nb::ndarray<const int8_t, nb::c_contig, nb::device::cpu>;
using Starts = nb::ndarray<const int64_t, nb::c_contig, nb::device::cpu>;

// Where each part's rows begin, and the last end: increasing, within what there is.
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

// A part's places and field out of the arrays of all.
class Parts {
  public:
    Parts(Floats places, Starts place_starts, Levels field, Starts field_starts, Floats grids, Doubles spacings,
          Doubles centres, double levels)
        : grids(grids), spacings(spacings), centres(centres), field(field), places(places), levels(levels) {
        const size_t n = expect(spacings, "spacings", {ANY});
        expect(centres, "centres", {n, 3});
        if (grids.size() != 7 * n) refuse("grid", "expected seven numbers a part");
        if (places.size() % 6) refuse("places", "expected six numbers a place");
        place_at = starts_of(place_starts, "places_start", n, places.size() / 6);
        field_at = starts_of(field_starts, "field_start", n, field.size());
        count = n;
    }

    size_t count = 0;

    CoarsePart part(size_t k, std::vector<CoarsePlace>& room) const {
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
        room.clear();
        for (int64_t i = place_at[k]; i < place_at[k + 1]; ++i) {
            const float* p = places.data() + 6 * i;
            room.push_back({{p[0], p[1], p[2]}, {p[3], p[4], p[5]}});
        }
        out.places = room.data();
        out.count = static_cast<int>(room.size());
        out.spacing = spacings.data()[k];
        out.centre = load(centres.data() + 3 * k);
        return out;
    }

  private:
    Floats grids;
    Doubles spacings, centres;
    Levels field;
    Floats places;
    double levels;
    const int64_t *place_at = nullptr, *field_at = nullptr;
};

nb::tuple coarse(Floats places, Starts place_starts, Levels field, Starts field_starts, Floats grids, Doubles spacings,
                 Doubles centres, double levels, Ints rows, Doubles at, Doubles normals, Doubles sds, Doubles tilts,
                 Doubles radii, Ints pairs, Doubles starts, double most, int pairs_each, int keep) {
    const Parts parts(places, place_starts, field, field_starts, grids, spacings, centres, expect(levels, "levels", 1, 1e6));
    const std::vector<CoarsePoint> points = points_of(at, normals, sds, tilts, radii);
    const std::vector<int> chosen = expect(rows, "rows", ANY, 0, static_cast<int64_t>(parts.count) - 1),
                           tried = expect(pairs, "pairs", ANY, 0, static_cast<int64_t>(points.size()) - 1);
    const std::vector<Pose> begun = poses(starts, "starts");
    CoarseEffort effort;
    effort.most = expect(most, "most", 1e-3, 1e9);
    effort.keep = static_cast<int>(expect(keep, "keep", 1, 1000));
    effort.pairs = static_cast<int>(expect(pairs_each, "pairs_each", 1, 1e6));
    const size_t R = chosen.size(), K = effort.keep;
    std::vector<double> costs(R * K, points.size() * effort.most), Ts(16 * R * K, 0.0);
    {
        nb::gil_scoped_release release;
        std::vector<CoarsePlace> room;
        for (size_t r = 0; r < R; ++r) {
            const std::vector<CoarsePose> found = coarse_poses(parts.part(chosen[r], room), points, tried, begun, effort);
            for (size_t k = 0; k < K; ++k) {
                const bool there = k < found.size();
                store_pose(there ? found[k].pose : Pose{}, &Ts[16 * (r * K + k)]);
                if (there) costs[r * K + k] = found[k].cost;
            }
        }
    }
    return nb::make_tuple(array_of(std::move(costs), {R, K}), array_of(std::move(Ts), {R, K, 4, 4}));
}

}  // namespace

void offer_coarse(nb::module_& m) {
    using namespace nb::literals;
    m.def("coarse", &coarse, "places"_a, "places_start"_a, "field"_a, "field_start"_a, "grid"_a, "spacings"_a,
          "centres"_a, "levels"_a, "rows"_a, "points"_a, "normals"_a, "sds"_a, "tilts"_a, "radii"_a, "pairs"_a, "starts"_a,
          "most"_a, "pairs_each"_a, "keep"_a);
}

}  // namespace tanteo
