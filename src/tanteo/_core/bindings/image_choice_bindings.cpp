// Bindings that choose among image candidates: positions of a drawing, distinct poses, nearest pixels.
#include <nanobind/stl/tuple.h>

#include "shape/bvh.hpp"
#include "bindings/image_arguments.hpp"
#include "image/image_slide.hpp"

namespace tanteo {

namespace {

using namespace nb::literals;

// The best yaws and positions of a drawing that is slid over an image, and their costs (see slid).
nb::tuple slide_edges(const EdgeFrame& frame, Doubles camera, Doubles yaws, Doubles centre, Floats distances,
                      Doubles places, double cell, int margin, int samples, double apart, int keep) {
    const Lens lens = lens_of(camera);
    const std::vector<Pose> all = poses(yaws, "yaws");
    const Vec3 middle = vector(centre, "centre");
    if (distances.ndim() != 3 || distances.size() == 0) refuse("distances", "expected channels x rows x columns");
    expect(places, "places", {ANY, 2});
    if (samples < 1 || keep < 1 || margin < 1) refuse("keep", "expected keep, samples and margin of 1 or more");
    const SlideTables tables{distances.data(), static_cast<int64_t>(distances.shape(1)),
                             static_cast<int64_t>(distances.shape(2)), expect(cell, "cell", 1e-3, 1e9),
                             margin, Channels(distances.shape(0))};
    std::vector<Pixel> at;
    for (size_t k = 0; k + 1 < places.size(); k += 2) {
        at.push_back({places.data()[k], places.data()[k + 1]});
        if (tables.cell_of(at.back()) < 0) refuse("places", "expected places inside the margin of the tables");
    }
    std::vector<Slid> found;
    {
        nb::gil_scoped_release release;
        const SlideRules rules{samples, apart, static_cast<size_t>(keep)};
        found = slid(frame, lens, all, middle, tables, at, rules);
    }
    std::vector<int32_t> yaw, place;
    std::vector<double> cost;
    for (const Slid& s : found) {
        yaw.push_back(s.yaw);
        place.push_back(s.place);
        cost.push_back(s.cost);
    }
    const size_t n = found.size();
    return nb::make_tuple(array_of(std::move(yaw), {n}), array_of(std::move(place), {n}),
                          array_of(std::move(cost), {n}));
}

// Indices of B sets of points, in a given order, that differ from every kept one by more than a limit in some point.
OutInts far_apart(Doubles points, Ints order, double limit) {
    const size_t B = points.ndim() ? points.shape(0) : 0, N = points.ndim() > 1 ? points.shape(1) : 0;
    expect(points, "points", {B, N, 3});
    const std::vector<int> in_order = expect(order, "order", ANY, 0, static_cast<int64_t>(B) - 1);
    std::vector<int32_t> kept;
    {
        nb::gil_scoped_release release;
        for (const int k : in_order) {
            const auto one = [&](int other) {
                const double *p = points.data() + 3 * N * k, *q = points.data() + 3 * N * other;
                for (size_t n = 0; n < 3 * N; n += 3)
                    if (!(squared(load(p + n) - load(q + n)) < limit * limit)) return false;
                return true;
            };
            if (std::none_of(kept.begin(), kept.end(), one)) kept.push_back(k);
        }
    }
    const size_t n = kept.size();
    return array_of(std::move(kept), {n});
}

// Index of the pixel nearest to each place; -1 if none is within reach.
OutInts nearest_pixels(Doubles pixels, Doubles places, double reach) {
    std::vector<Box> boxes(expect(pixels, "pixels", {ANY, 2}));
    std::vector<int32_t> out(expect(places, "places", {ANY, 2}), -1);
    const auto at = [](const Doubles& a, size_t k) { return Vec3{a.data()[2 * k], a.data()[2 * k + 1], 0}; };
    for (size_t k = 0; k < boxes.size(); ++k) boxes[k].add(at(pixels, k));
    {
        nb::gil_scoped_release release;
        Bvh tree;
        tree.build(boxes);
        for (size_t k = 0; k < out.size(); ++k) {
            const Vec3 place = at(places, k);
            tree.closest(place, reach * reach, [&](int item, double best) {
                const double far = squared(at(pixels, item) - place);
                if (far < best) out[k] = item;
                return far;
            });
        }
    }
    const size_t n = out.size();
    return array_of(std::move(out), {n});
}

}  // namespace

void offer_image_choices(nb::module_& m) {
    m.def("slide_edges", &slide_edges, "frame"_a, "camera"_a, "yaws"_a, "centre"_a, "distances"_a, "places"_a, "cell"_a,
          "margin"_a, "samples"_a, "apart"_a, "keep"_a);
    m.def("nearest_pixels", &nearest_pixels, "pixels"_a, "places"_a, "reach"_a);
    m.def("far_apart", &far_apart, "points"_a, "order"_a, "limit"_a);
}

}  // namespace tanteo
