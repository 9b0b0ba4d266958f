// The door for images: edges of a part at poses of the camera, and drawings that are slid over an image.
#include <nanobind/stl/tuple.h>

#include "door.hpp"
#include "image_edge.hpp"

namespace tanteo {

namespace {

using namespace nb::literals;
using Floats = nb::ndarray<const float, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::c_contig, nb::device::cpu>;

Lens lens_of(const Doubles& camera) {
    expect(camera, "camera", {12});
    const double* c = camera.data();
    Lens lens{c[0], c[1], c[2], c[3], {}};
    std::copy(c + 4, c + 12, lens.k);
    return lens;
}

// Samples of edges at poses: numbers (x, y, normal, span, offset, sd, slope), the edge points or -1, whether they are
// in the image.
nb::tuple meet_edges(Doubles camera, Ints nearest, Doubles pixels, Doubles sds, Doubles points, Doubles tangents,
                     Doubles lengths, Doubles Ts, Flags shown, double diagonal, double reach) {
    const Lens lens = lens_of(camera);
    const std::vector<Vec3> at = vectors(points, "points"), along = vectors(tangents, "tangents");
    const std::vector<Pose> all = poses(Ts);
    const size_t N = at.size(), B = all.size(), M = expect(pixels, "pixels", {ANY, 2});
    expect(sds, "sds", {M});
    expect(lengths, "lengths", {N});
    expect(tangents, "tangents", {N, 3});
    if (nearest.ndim() != 3 || nearest.size() == 0) refuse("nearest", "expected channels x rows x columns");
    if (shown.size() != B * N) refuse("shown", "expected one for each sample at each pose");
    const EdgePoints table{nearest.data(), static_cast<int64_t>(nearest.shape(0)), static_cast<int64_t>(nearest.shape(1)),
                           static_cast<int64_t>(nearest.shape(2)), pixels.data(), sds.data(), static_cast<int64_t>(M)};
    std::vector<double> numbers(B * N * 13);
    std::vector<int32_t> which(B * N), inside(B * N);
    {
        nb::gil_scoped_release release;
        for (size_t b = 0; b < B; ++b)
            for (size_t n = 0; n < N; ++n) {
                const size_t row = b * N + n;
                const EdgeSample sample{at[n], along[n], lengths.data()[n]};
                const EdgeMet met = meet_edge(lens, table, sample, all[b], shown.data()[row], diagonal, reach);
                double* out = &numbers[13 * row];
                for (const double v : {met.x, met.y, met.nx, met.ny, met.span, met.offset, met.sd}) *out++ = v;
                std::copy(met.slope, met.slope + 6, out);
                which[row] = met.point;
                inside[row] = met.inside;
            }
    }
    return nb::make_tuple(array_of(std::move(numbers), {B, N, 13}), array_of(std::move(which), {B, N}),
                          array_of(std::move(inside), {B, N}));
}

// Costs of drawings, one for each yaw, at places (see slide).
Out slid_costs(Floats distances, Floats bare, Ints drawn, Ints inner, Ints slides, double most, double penalty) {
    if (drawn.ndim() != 2 || inner.ndim() != 2 || drawn.shape(0) != inner.shape(0))
        refuse("drawn", "expected yaws x samples, and as many yaws in inner");
    if (distances.size() == 0 || bare.size() == 0) refuse("distances", "expected a table, got an empty one");
    const size_t Y = drawn.shape(0), S = slides.size();
    std::vector<double> costs(Y * S);
    {
        nb::gil_scoped_release release;
        for (size_t y = 0; y < Y; ++y)
            slide(distances.data(), distances.size(), bare.data(), bare.size(), drawn.data() + y * drawn.shape(1),
                  drawn.shape(1), inner.data() + y * inner.shape(1), inner.shape(1), slides.data(), S, most, penalty,
                  &costs[y * S]);
    }
    return array_of(std::move(costs), {Y, S});
}

}  // namespace

void offer_images(nb::module_& m) {
    m.def("meet_edges", &meet_edges, "camera"_a, "nearest"_a, "pixels"_a, "sds"_a, "points"_a, "tangents"_a,
          "lengths"_a, "poses"_a, "shown"_a, "diagonal"_a, "reach"_a);
    m.def("slid_costs", &slid_costs, "distances"_a, "bare"_a, "drawn"_a, "inner"_a, "slides"_a, "most"_a, "penalty"_a);
}

}  // namespace tanteo
