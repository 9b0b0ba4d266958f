// The width of lanes, and what their kernels return, for tests.
#include <nanobind/stl/vector.h>

#include "bindings/conversion.hpp"
#include "factors/truncated_normal.hpp"
#include "lanes/lane_kernels.hpp"

namespace tanteo {

namespace {

void set_width(int width) {
    if (!set_lane_width(width)) refuse("width", "expected one of lane_widths(), got " + std::to_string(width));
}

// exp of numbers, in lanes.
Out exponentials_of(Doubles numbers) {
    std::vector<double> out = doubles(numbers, "numbers", {ANY});
    const size_t count = out.size();
    out.resize((count + WIDEST_LANES - 1) / WIDEST_LANES * WIDEST_LANES);
    lane_kernels().exponentials(out.data(), out.size());
    out.resize(count);
    return list_of(std::move(out));
}

// Integrals over edges (h, t1, t2): probability of the wedge, integral of the density along the edge, and the density at its
// last end less that at the first.
Out edge_integrals(Doubles edges) {
    const size_t count = expect(edges, "edges", {ANY, 3});
    MassQueue queue;
    queue.clear(true);
    for (size_t k = 0; k < count; ++k) {
        const double* e = edges.data() + 3 * k;
        queue.add_edge(1, 0, e[0], e[1], e[2], true);
    }
    queue.run();
    std::vector<double> out;
    for (size_t k = 0; k < count; ++k) {
        const MassQueue::EdgeIntegrals own = queue.of_edge(k);
        out.insert(out.end(), {own.wedge, own.along, own.ends});
    }
    return array_of(std::move(out), {count, 3});
}

}  // namespace

void offer_lanes(nb::module_& m) {
    m.def("lane_widths", &lane_widths);
    m.def("set_lane_width", &set_width, nb::arg("width"));
    m.def("exponentials", &exponentials_of, nb::arg("numbers"));
    m.def("edge_integrals", &edge_integrals, nb::arg("edges"));
}

}  // namespace tanteo
