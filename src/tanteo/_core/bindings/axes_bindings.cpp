// Bindings of the comparison of sensed centres and planes with axes and faces of many parts, from arrays in mapped files.
#include "proposals/axes.hpp"
#include "bindings/catalogue_arguments.hpp"

namespace tanteo {

namespace {

std::vector<SensedCentre> centres_of(const Doubles& rows) {
    std::vector<SensedCentre> out(expect(rows, "centres", {ANY, 13}));
    for (size_t k = 0; k < out.size(); ++k) {
        const double* x = rows.data() + 13 * k;
        if (!(x[6] > 0 && x[7] > 0 && x[9] > 0)) refuse("centres", "expected positive standard deviations");
        if (!(x[12] >= 0 && x[12] < ModelAxes::KINDS)) refuse("centres", "expected numbers of known kinds");
        SensedCentre& own = out[k];
        own.at = load(x);
        own.axis = load(x + 3);
        own.sd = x[6];
        own.tilt = x[7];
        own.size = x[8];
        own.size_sd = x[9];
        own.most = x[10];
        own.side = x[11] > 0 ? 1 : (x[11] < 0 ? -1 : 0);
        own.kind = static_cast<int>(x[12]);
    }
    return out;
}

Out axes_lack(Floats axes, Starts starts, Ints rows, Doubles centres) {
    const std::vector<int> chosen = expect(rows, "rows", ANY, 0, static_cast<int64_t>(starts.size()) - 2);
    const Table table(axes, starts, ModelAxes::COLUMNS, "axes", chosen);
    const std::vector<SensedCentre> own = centres_of(centres);
    std::vector<double> out(chosen.size());
    {
        nb::gil_scoped_release release;
        for (size_t r = 0; r < out.size(); ++r)
            out[r] = lacking(ModelAxes(table.begin(chosen[r]), table.count(chosen[r])), own);
    }
    return list_of(std::move(out));
}

nb::tuple on_axes(Floats axes, Starts axes_start, Floats planes, Starts planes_start, Floats rounds, Starts rounds_start,
                  Doubles unseen, Ints rows, Doubles centres, Doubles sensed, Ints seeds, Doubles poses_before, Ints poses_start,
                  double limit, double gap, int keep) {
    const std::vector<int> chosen = expect(rows, "rows", ANY, 0, static_cast<int64_t>(axes_start.size()) - 2);
    const Table own(axes, axes_start, ModelAxes::COLUMNS, "axes", chosen), flat(planes, planes_start, 7, "planes", chosen);
    const Table round(rounds, rounds_start, 9, "rounds", chosen);
    expect(unseen, "unseen", {axes_start.size() - 1});
    SensedScene scene{centres_of(centres), sensed_planes(sensed)};
    const std::vector<SensedPlane> stated = scene.planes;
    const int64_t C = scene.centres.size(), items = C + scene.planes.size();
    const std::vector<int> tried = expect(seeds, "seeds", ANY, -1, items - 1);
    if (tried.size() % 3) refuse("seeds", "expected three numbers each");
    for (size_t k = 0; k < tried.size(); ++k)
        if (k % 3 && ((tried[k - 1] < 0 && tried[k] >= 0) || (tried[k - 1] >= C && tried[k] >= 0 && tried[k] < C)))
            refuse("seeds", "expected centres, then planes, then -1");
    const std::vector<Pose> before = poses(poses_before, "poses_before");
    const size_t R = chosen.size(), K = static_cast<size_t>(expect(keep, "keep", 1, 1000));
    const std::vector<int> from = expect(poses_start, "poses_start", R + 1, 0, static_cast<int64_t>(before.size()));
    for (size_t r = 0; r < R; ++r)
        if (from[r] > from[r + 1]) refuse("poses_start", "expected increasing numbers");
    expect(limit, "limit", 0, 1e9);
    expect(gap, "gap", 0, 1e9);
    BestPoses best(R, K, limit);
    ModelFaces faces;
    std::vector<int32_t> all(R, 0);
    {
        nb::gil_scoped_release release;
        double near = limit;  // costs beyond a gap to the best so far are not needed
        for (size_t r = 0; r < R; ++r) {
            const ModelAxes model(own.begin(chosen[r]), own.count(chosen[r]));
            for (size_t k = 0; k < stated.size(); ++k) scene.planes[k].most = most_of(stated[k], unseen.data()[chosen[r]]);
            read_faces(flat, round, chosen[r], faces);
            const std::vector<Pose> starts(before.begin() + from[r], before.begin() + from[r + 1]);
            const AxisPoses found = axis_poses(model, faces, scene, tried, starts, near, keep);
            all[r] = found.all;
            if (!found.best.empty()) near = std::min(near, found.best[0].cost + gap);
            best.put(r, found.best);
        }
    }
    return nb::make_tuple(best.costs_out(), best.poses_out(), list_of(std::move(all)));
}

}  // namespace

void offer_axes(nb::module_& m) {
    using namespace nb::literals;
    m.def("axes_lack", &axes_lack, "axes"_a, "starts"_a, "rows"_a, "centres"_a);
    m.def("on_axes", &on_axes, "axes"_a, "axes_start"_a, "planes"_a, "planes_start"_a, "rounds"_a, "rounds_start"_a,
          "unseen"_a, "rows"_a, "centres"_a, "sensed"_a, "seeds"_a, "poses_before"_a, "poses_start"_a, "limit"_a, "gap"_a, "keep"_a);
}

}  // namespace tanteo
