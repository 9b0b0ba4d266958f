// The axes and faces of many parts, of which arrays lie in mapped files: poses and nats of sensed centres on each.
#include "axes.hpp"
#include "door.hpp"

namespace tanteo {

namespace {

using Floats = nb::ndarray<const float, nb::c_contig, nb::device::cpu>;
using Starts = nb::ndarray<const int64_t, nb::c_contig, nb::device::cpu>;

// Rows of an array by part: where they begin, and the last end.
struct Table {
    const float* data;
    const int64_t* starts;
    int width;

    Table(const Floats& values, const Starts& where, int width, const char* name, const std::vector<int>& rows)
        : data(values.data()), starts(where.data()), width(width) {
        if (values.size() % width) refuse(name, "expected " + std::to_string(width) + " numbers a row");
        const int64_t total = values.size() / width;
        for (const int row : rows)
            if (static_cast<size_t>(row) + 1 >= where.size() || starts[row] < 0 || starts[row + 1] > total ||
                starts[row] > starts[row + 1])
                refuse(name, "expected rows that begin at increasing numbers, no more than there are");
    }
    const float* begin(int row) const { return data + width * starts[row]; }
    size_t count(int row) const { return starts[row + 1] - starts[row]; }
};

std::vector<SensedCentre> centres_of(const Doubles& rows) {
    std::vector<SensedCentre> out(expect(rows, "centres", {ANY, 13}));
    for (size_t k = 0; k < out.size(); ++k) {
        const double* x = rows.data() + 13 * k;
        if (!(x[6] > 0 && x[7] > 0 && x[9] > 0)) refuse("centres", "expected positive standard deviations");
        if (!(x[12] >= 0 && x[12] < ModelAxes::KINDS)) refuse("centres", "expected kinds of points that there are");
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

std::vector<SensedPlane> planes_of(const Doubles& rows) {
    std::vector<SensedPlane> out(expect(rows, "sensed", {ANY, 12}));
    for (size_t k = 0; k < out.size(); ++k) {
        const double* x = rows.data() + 12 * k;
        out[k] = {load(x), load(x + 3), x[6], x[7], x[8], x[9], x[10] > 0, x[11] > 0};
    }
    return out;
}

// Those of a part: one point with its normal may be of a face that is not compared, by the share of these.
std::vector<SensedPlane> on_part(std::vector<SensedPlane> planes, double unseen) {
    constexpr double LOOSE = 1.5;
    for (SensedPlane& plane : planes)
        if (plane.alone && unseen > 0) plane.most = std::min(plane.most, LOOSE - std::log(unseen));
    return planes;
}

ModelFaces faces_of(const Table& planes, const Table& rounds, int row) {
    ModelFaces out;
    for (size_t k = 0; k < planes.count(row); ++k) {
        const float* x = planes.begin(row) + 7 * k;
        out.planes.push_back({{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, x[6]});
    }
    for (size_t k = 0; k < rounds.count(row); ++k) {
        const float* x = rounds.begin(row) + 9 * k;
        out.rounds.push_back({{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, x[6], x[7], x[8]});
    }
    return out;
}

Out axes_lack(Floats axes, Starts starts, Ints rows, Doubles centres) {
    const std::vector<int> chosen = expect(rows, "rows", ANY, 0, static_cast<int64_t>(starts.size()) - 2);
    const Table table(axes, starts, ModelAxes::COLUMNS, "axes", chosen);
    const std::vector<SensedCentre> felt = centres_of(centres);
    std::vector<double> out(chosen.size());
    {
        nb::gil_scoped_release release;
        for (size_t r = 0; r < out.size(); ++r)
            out[r] = lacking(ModelAxes(table.begin(chosen[r]), table.count(chosen[r])), felt);
    }
    return array_of(std::move(out), {chosen.size()});
}

nb::tuple on_axes(Floats axes, Starts axes_start, Floats planes, Starts planes_start, Floats rounds, Starts rounds_start,
                  Doubles unseen, Ints rows, Doubles centres, Doubles sensed, Ints seeds, Doubles poses_before, Ints poses_start,
                  double limit, double behind, int keep) {
    const std::vector<int> chosen = expect(rows, "rows", ANY, 0, static_cast<int64_t>(axes_start.size()) - 2);
    const Table own(axes, axes_start, ModelAxes::COLUMNS, "axes", chosen), flat(planes, planes_start, 7, "planes", chosen);
    const Table round(rounds, rounds_start, 9, "rounds", chosen);
    expect(unseen, "unseen", {axes_start.size() - 1});
    SensedScene scene{centres_of(centres), planes_of(sensed)};
    const std::vector<SensedPlane> felt = scene.planes;
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
    expect(behind, "behind", 0, 1e9);
    std::vector<double> costs(R * K, limit), Ts(16 * R * K, 0.0);
    std::vector<int32_t> all(R, 0);
    {
        nb::gil_scoped_release release;
        double near = limit;  // what is farther behind the best so far does not matter
        for (size_t r = 0; r < R; ++r) {
            const ModelAxes model(own.begin(chosen[r]), own.count(chosen[r]));
            scene.planes = on_part(felt, unseen.data()[chosen[r]]);
            const std::vector<Pose> starts(before.begin() + from[r], before.begin() + from[r + 1]);
            const AxisPoses found = axis_poses(model, faces_of(flat, round, chosen[r]), scene, tried, starts, near, keep);
            all[r] = found.all;
            if (!found.best.empty()) near = std::min(near, found.best[0].cost + behind);
            for (size_t k = 0; k < K; ++k) {
                const bool there = k < found.best.size();
                store_pose(there ? found.best[k].pose : Pose{}, &Ts[16 * (r * K + k)]);
                if (there) costs[r * K + k] = std::min(found.best[k].cost, limit);
            }
        }
    }
    return nb::make_tuple(array_of(std::move(costs), {R, K}), array_of(std::move(Ts), {R, K, 4, 4}),
                          array_of(std::move(all), {R}));
}

}  // namespace

void offer_axes(nb::module_& m) {
    using namespace nb::literals;
    m.def("axes_lack", &axes_lack, "axes"_a, "starts"_a, "rows"_a, "centres"_a);
    m.def("on_axes", &on_axes, "axes"_a, "axes_start"_a, "planes"_a, "planes_start"_a, "rounds"_a, "rounds_start"_a,
          "unseen"_a, "rows"_a, "centres"_a, "sensed"_a, "seeds"_a, "poses_before"_a, "poses_start"_a, "limit"_a, "behind"_a, "keep"_a);
}

}  // namespace tanteo
