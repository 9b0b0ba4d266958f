// Bindings for edges of a part at poses of the camera: their visibility, matches in an image, and refinement of the pose.
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>

#include <memory>

#include "bindings/image_arguments.hpp"
#include "image/image_frame.hpp"

namespace tanteo {

namespace {

using namespace nb::literals;

std::shared_ptr<EdgeFrame> make_edge_frame(Doubles points, Doubles tangents, Doubles normals, Doubles lengths,
                                           Flags sharp, Doubles corners, double diagonal, Doubles middle,
                                           double slack, double view_step) {
    const std::vector<Vec3> at = vectors(points, "points");
    expect(tangents, "tangents", {at.size(), 3});
    expect(normals, "normals", {at.size(), 2, 3});
    expect(lengths, "lengths", {at.size()});
    expect(corners, "corners", {ANY, 3, 3});
    if (sharp.size() != at.size()) refuse("sharp", "expected one for each sample");
    std::vector<EdgeSample> samples;
    std::vector<Vec3> sides, surface;
    for (size_t k = 0; k < at.size(); ++k) {
        samples.push_back({at[k], load(tangents.data() + 3 * k), lengths.data()[k]});
        for (size_t j = 0; j < 2; ++j) sides.push_back(load(normals.data() + 6 * k + 3 * j));
    }
    for (size_t k = 0; k < corners.size(); k += 3) surface.push_back(load(corners.data() + k));
    return std::make_shared<EdgeFrame>(std::move(samples), sides,
                                       std::vector<char>(sharp.data(), sharp.data() + sharp.size()), surface, diagonal,
                                       vector(middle, "middle"), slack, expect(view_step, "view_step", 1e-12, 1.0));
}

EdgePoints edge_points(const Ints& nearest, const Doubles& pixels, const Doubles& sds) {
    const size_t M = expect(pixels, "pixels", {ANY, 2});
    expect(sds, "sds", {M});
    if (nearest.ndim() != 3 || nearest.size() == 0) refuse("nearest", "expected channels x rows x columns");
    return {nearest.data(), static_cast<int64_t>(M), static_cast<int64_t>(nearest.shape(1)),
            static_cast<int64_t>(nearest.shape(2)), pixels.data(), sds.data(), Channels(nearest.shape(0))};
}

// Which samples are visible edges at poses, and which are on the outline of the part.
nb::tuple visible_edges(const EdgeFrame& frame, Doubles Ts, bool hidden) {
    const std::vector<Pose> all = poses(Ts);
    const size_t N = frame.size(), B = all.size();
    std::vector<char> shown(B * N), rims(B * N);
    {
        nb::gil_scoped_release release;
        for (size_t b = 0; b < B; ++b) frame.mark(all[b], hidden, shown.data() + b * N, rims.data() + b * N);
    }
    return nb::make_tuple(flags_of(shown, {B, N}), flags_of(rims, {B, N}));
}

// Matches of samples of edges at poses: numbers (x, y, normal, span, offset, sd, slope), the edge points or -1, whether
// they are in the image.
nb::tuple match_edges(const EdgeFrame& frame, Doubles camera, Ints nearest, Doubles pixels, Doubles sds, Doubles Ts,
                     Flags shown, double reach) {
    const Lens lens = lens_of(camera);
    const std::vector<Pose> all = poses(Ts);
    const EdgePoints table = edge_points(nearest, pixels, sds);
    const size_t N = frame.size(), B = all.size();
    if (shown.size() != B * N) refuse("shown", "expected one for each sample at each pose");
    std::vector<double> numbers(B * N * 13);
    std::vector<int32_t> which(B * N);
    std::vector<char> inside(B * N);
    {
        nb::gil_scoped_release release;
        for (size_t b = 0; b < B; ++b)
            for (size_t n = 0; n < N; ++n) {
                const size_t row = b * N + n;
                const EdgeMatch match =
                    match_edge(lens, table, frame.samples[n], all[b], shown.data()[row], frame.diagonal, reach);
                double* out = &numbers[13 * row];
                for (const double v : {match.x, match.y, match.nx, match.ny, match.span, match.offset, match.sd}) *out++ = v;
                std::copy(match.slope, match.slope + 6, out);
                which[row] = match.point;
                inside[row] = match.inside;
            }
    }
    return nb::make_tuple(array_of(std::move(numbers), {B, N, 13}), array_of(std::move(which), {B, N}),
                          flags_of(inside, {B, N}));
}

// Poses refined on the edges of an image (see refined); visibility: rounds that compute the visibility of edges again.
Out refine_edges(const EdgeFrame& frame, Doubles camera, Ints nearest, Doubles pixels, Doubles sds, Doubles Ts,
                 Doubles starts, Doubles priors, Doubles reaches, Flags visibility, double bias, double correlation) {
    const Lens lens = lens_of(camera);
    const EdgePoints table = edge_points(nearest, pixels, sds);
    std::vector<Pose> all = poses(Ts);
    const std::vector<Pose> means = poses(starts, "starts");
    expect(starts, "starts", {all.size(), 4, 4});
    expect(priors, "priors", {all.size(), 6, 6});
    std::vector<Round> rounds(expect(reaches, "reaches", {ANY}));
    if (visibility.size() != rounds.size()) refuse("visibility", "expected one for each of the reaches");
    for (size_t k = 0; k < rounds.size(); ++k) rounds[k] = {reaches.data()[k], visibility.data()[k]};
    {
        nb::gil_scoped_release release;
        for (size_t b = 0; b < all.size(); ++b)
            all[b] = refined(frame, lens, table, all[b], means[b], priors.data() + 36 * b, rounds, {bias, correlation});
    }
    return poses_out(all);
}

}  // namespace

void offer_images(nb::module_& m) {
    nb::class_<EdgeFrame>(m, "EdgeFrame").def_prop_ro("size", &EdgeFrame::size);
    m.def("make_edge_frame", &make_edge_frame, "points"_a, "tangents"_a, "normals"_a, "lengths"_a, "sharp"_a,
          "corners"_a, "diagonal"_a, "middle"_a, "slack"_a, "view_step"_a);
    m.def("visible_edges", &visible_edges, "frame"_a, "poses"_a, "hidden"_a);
    m.def("match_edges", &match_edges, "frame"_a, "camera"_a, "nearest"_a, "pixels"_a, "sds"_a, "poses"_a, "shown"_a,
          "reach"_a);
    m.def("refine_edges", &refine_edges, "frame"_a, "camera"_a, "nearest"_a, "pixels"_a, "sds"_a, "poses"_a,
          "starts"_a, "priors"_a, "reaches"_a, "visibility"_a, "bias"_a, "correlation"_a);
    offer_image_choices(m);
}

}  // namespace tanteo
