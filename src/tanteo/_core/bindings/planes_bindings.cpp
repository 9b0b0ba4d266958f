// Bindings of the comparison of sensed planes with the planar faces of many parts, from arrays in mapped files.
#include "bindings/catalogue_arguments.hpp"
#include "parallel.hpp"
#include "proposals/plane_search.hpp"

namespace tanteo {

namespace {

nb::tuple on_planes(Floats planes, Starts starts, Floats rounds, Starts round_starts, Doubles unseen, Ints rows,
                    Doubles sensed, Ints triples, Ints walls, double limit, double gap, int keep) {
    const std::vector<int> chosen = expect(rows, "rows", ANY, 0, static_cast<int64_t>(starts.size()) - 2);
    const Table flat(planes, starts, 7, "planes", chosen), round(rounds, round_starts, 9, "rounds", chosen);
    expect(unseen, "unseen", {starts.size() - 1});
    const std::vector<SensedPlane> stated = sensed_planes(sensed);
    const std::vector<int> tried = expect(triples, "triples", ANY, -1, static_cast<int64_t>(stated.size()) - 1);
    for (size_t k = 0; k < tried.size(); ++k)
        if (tried[k] < 0 && k % 3 != 2) refuse("triples", "expected -1 only in place of a missing third plane");
    const std::vector<int> rolled = expect(walls, "walls", ANY, 0, static_cast<int64_t>(stated.size()) - 1);
    expect(limit, "limit", 0, 1e9);
    expect(gap, "gap", 0, 1e9);
    BestPoses best(chosen.size(), static_cast<size_t>(expect(keep, "keep", 1, 1000)), limit);
    {
        nb::gil_scoped_release release;
        const auto make = [&] {
            std::vector<double> most(stated.size());
            return [&, search = PlaneSearch(stated, tried, rolled), faces = ModelFaces{}, most](size_t r) mutable {
                read_faces(flat, round, chosen[r], faces);
                for (size_t k = 0; k < stated.size(); ++k) most[k] = most_of(stated[k], unseen.data()[chosen[r]]);
                best.put(r, search.on(faces, most, limit, gap, keep));
            };
        };
        for_all(chosen.size(), make);
    }
    return nb::make_tuple(best.costs_out(), best.poses_out());
}

}  // namespace

void offer_planes(nb::module_& m) {
    using namespace nb::literals;
    m.def("on_planes", &on_planes, "planes"_a, "starts"_a, "rounds"_a, "rounds_start"_a, "unseen"_a, "rows"_a, "sensed"_a,
          "triples"_a, "walls"_a, "limit"_a, "gap"_a, "keep"_a);
}

}  // namespace tanteo
