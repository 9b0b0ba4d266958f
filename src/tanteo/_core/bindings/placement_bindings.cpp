// Binding of random placements of three points on the surface of a part.
#include "proposals/placements.hpp"

#include <nanobind/stl/tuple.h>

#include "bindings/conversion.hpp"

namespace tanteo {

namespace {

// Poses of placements, the logs of their weights, and the number of the draw of each.
std::tuple<Out, Out, OutInts> placed(const Shape& shape, Doubles points, Doubles offsets, Doubles sds, int64_t seed) {
    const size_t draws = expect(points, "points", {ANY, 3, 3});
    expect(offsets, "offsets", {3});
    expect(sds, "sds", {draws, 3});
    std::vector<TouchedPoint> touched(3 * draws);
    for (size_t k = 0; k < touched.size(); ++k)
        touched[k] = {load(points.data() + 3 * k), expect(offsets.data()[k % 3], "offsets", 0, 1e300),
                      expect(sds.data()[k], "sds", 1e-300, 1e300)};
    std::vector<PlacedPose> found;
    {
        nb::gil_scoped_release release;
        found = placements(shape, touched, static_cast<uint64_t>(seed));
    }
    std::vector<Pose> at;
    std::vector<double> logs;
    std::vector<int32_t> from;
    for (const PlacedPose& one : found) {
        at.push_back(one.pose);
        logs.push_back(one.log_weight);
        from.push_back(one.draw);
    }
    return {poses_out(at), list_of(std::move(logs)), list_of(std::move(from))};
}

}  // namespace

void offer_placements(nb::module_& m) {
    using namespace nb::literals;
    m.def("placements", &placed, "shape"_a, "points"_a, "offsets"_a, "sds"_a, "seed"_a);
}

}  // namespace tanteo
