// Bindings of the comparison of an outline with many parts of a catalogue, from arrays in mapped files.
#include "bindings/conversion.hpp"
#include "image/outlines.hpp"
#include "parallel.hpp"

namespace tanteo {

namespace {

ObservedOutline observed_of(const Doubles& reach, const Doubles& middle, const Doubles& eye) {
    ObservedOutline out;
    expect(reach, "reach", {DIRECTIONS});
    std::copy(reach.data(), reach.data() + DIRECTIONS, out.reach.begin());
    expect(middle, "middle", {2});
    std::copy(middle.data(), middle.data() + 2, out.middle);
    out.eye = vector(eye, "eye");
    expect(out.eye.z, "eye", 1e-9, 1e9);
    return out;
}

// Costs and poses of every stable pose; the hull points of part k are the rows start[k] to start[k + 1].
nb::tuple fit_outlines(Floats hull, Starts start, Floats downs, Ints of, Doubles reach, Doubles middle, Doubles eye,
                       double sd, double shadow, double most) {
    if (hull.size() % 3) refuse("hull", "expected three numbers a point");
    if (start.size() < 1) refuse("hull_start", "expected a number at least");
    const size_t parts = start.size() - 1;
    for (size_t k = 0; k < parts; ++k)
        if (start.data()[k] < 0 || start.data()[k] > start.data()[k + 1]) refuse("hull_start", "expected increasing numbers");
    if (start.data()[parts] > static_cast<int64_t>(hull.size() / 3)) refuse("hull_start", "expected no more than there are");
    const std::vector<int> whose = expect(of, "of", ANY, 0, static_cast<int64_t>(parts) - 1);
    if (downs.size() != 3 * whose.size()) refuse("downs", "expected three numbers for each stable pose");
    ObservedOutline observed = observed_of(reach, middle, eye);
    observed.sd = expect(sd, "sd", 1e-9, 1e3);
    observed.shadow = expect(shadow, "shadow", 1e-6, 1e3);
    observed.most = expect(most, "most", 1e-6, 1e12);
    std::vector<double> costs(whose.size()), Ts(16 * whose.size());
    {
        nb::gil_scoped_release release;
        for_all(whose.size(), [&] {
            return [&, points = std::vector<Vec3>()](size_t m) mutable {
                points.clear();
                for (int64_t i = start.data()[whose[m]]; i < start.data()[whose[m] + 1]; ++i) {
                    const float* p = hull.data() + 3 * i;
                    points.push_back({p[0], p[1], p[2]});
                }
                const float* d = downs.data() + 3 * m;
                const OutlineFit fit = fit_outline(points, {d[0], d[1], d[2]}, observed);
                costs[m] = fit.cost;
                store_pose(fit.pose, &Ts[16 * m]);
            };
        });
    }
    return nb::make_tuple(list_of(std::move(costs)), array_of(std::move(Ts), {whose.size(), 4, 4}));
}

}  // namespace

void offer_outlines(nb::module_& m) {
    using namespace nb::literals;
    m.def("fit_outlines", &fit_outlines, "hull"_a, "hull_start"_a, "downs"_a, "of"_a, "reach"_a, "middle"_a, "eye"_a,
          "sd"_a, "shadow"_a, "most"_a);
}

}  // namespace tanteo
