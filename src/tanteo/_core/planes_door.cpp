// The planar faces of many parts, of which arrays lie in mapped files: poses and nats of sensed planes on each.
#include "door.hpp"
#include "planes.hpp"

namespace tanteo {

namespace {

using Floats = nb::ndarray<const float, nb::c_contig, nb::device::cpu>;
using Starts = nb::ndarray<const int64_t, nb::c_contig, nb::device::cpu>;

// Nats of a plane that may be of a face that is not compared, by their share of the part.
double most_of(const SensedPlane& plane, double share) {
    constexpr double LOOSE = 1.5;
    return share > 0 ? std::min(plane.most, LOOSE - std::log(share)) : plane.most;
}

std::vector<SensedPlane> sensed_of(const Doubles& planes) {
    const size_t n = expect(planes, "sensed", {ANY, 12});
    std::vector<SensedPlane> out(n);
    for (size_t k = 0; k < n; ++k) {
        const double* x = planes.data() + 12 * k;
        out[k] = {load(x), load(x + 3), x[6], x[7], x[8], x[9], x[10] > 0, x[11] > 0};
    }
    return out;
}

// Rows of each part in an array: where they begin, and the last end.
void check_starts(const Starts& starts, const char* name, const std::vector<int>& rows, int64_t total) {
    for (const int row : rows)
        if (static_cast<size_t>(row) + 1 >= starts.size() || starts.data()[row] < 0 || starts.data()[row + 1] > total ||
            starts.data()[row] > starts.data()[row + 1])
            refuse(name, "expected increasing numbers, no more than there are faces");
}

nb::tuple on_planes(Floats planes, Starts starts, Floats rounds, Starts round_starts, Doubles unseen, Ints rows, Doubles sensed, Ints triples, double limit, double behind, int keep) {
    if (planes.size() % 7) refuse("planes", "expected seven numbers a face");
    const int64_t total = planes.size() / 7, parts = static_cast<int64_t>(starts.size()) - 1;
    const std::vector<int> chosen = expect(rows, "rows", ANY, 0, parts - 1);
    expect(unseen, "unseen", {static_cast<size_t>(parts)});
    const std::vector<SensedPlane> felt = sensed_of(sensed);
    const std::vector<int> tried = expect(triples, "triples", ANY, -1, static_cast<int64_t>(felt.size()) - 1);
    for (size_t k = 0; k < tried.size(); ++k)
        if (tried[k] < 0 && k % 3 != 2) refuse("triples", "expected -1 only for a third plane that there is not");
    expect(limit, "limit", 0, 1e9);
    expect(behind, "behind", 0, 1e9);
    const size_t R = chosen.size(), K = static_cast<size_t>(expect(keep, "keep", 1, 1000));
    check_starts(starts, "starts", chosen, total);
    if (rounds.size() % 9) refuse("rounds", "expected nine numbers a cylinder");
    check_starts(round_starts, "rounds_start", chosen, rounds.size() / 9);
    std::vector<double> costs(R * K, limit), Ts(16 * R * K, 0.0);
    {
        nb::gil_scoped_release release;
        ModelFaces faces;
        double near = limit;  // what is farther behind the best so far does not matter
        for (size_t r = 0; r < R; ++r) {
            faces.planes.clear();
            faces.rounds.clear();
            for (int64_t k = starts.data()[chosen[r]]; k < starts.data()[chosen[r] + 1]; ++k) {
                const float* x = planes.data() + 7 * k;
                faces.planes.push_back({{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, x[6]});
            }
            for (int64_t k = round_starts.data()[chosen[r]]; k < round_starts.data()[chosen[r] + 1]; ++k) {
                const float* x = rounds.data() + 9 * k;
                faces.rounds.push_back({{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, x[6], x[7], x[8]});
            }
            std::vector<SensedPlane> own(felt);
            for (size_t k = 0; k < own.size(); ++k)
                if (sensed.data()[12 * k + 11] > 0) own[k].most = most_of(felt[k], unseen.data()[chosen[r]]);
            const std::vector<PlanePose> found = plane_poses(faces, own, tried, near, static_cast<int>(K));
            if (!found.empty()) near = std::min(near, found[0].cost + behind);
            for (size_t k = 0; k < K; ++k) {
                const bool there = k < found.size();
                store_pose(there ? found[k].pose : Pose{}, &Ts[16 * (r * K + k)]);
                if (there) costs[r * K + k] = std::min(found[k].cost, limit);
            }
        }
    }
    return nb::make_tuple(array_of(std::move(costs), {R, K}), array_of(std::move(Ts), {R, K, 4, 4}));
}

}  // namespace

void offer_planes(nb::module_& m) {
    using namespace nb::literals;
    m.def("on_planes", &on_planes, "planes"_a, "starts"_a, "rounds"_a, "rounds_start"_a, "unseen"_a, "rows"_a, "sensed"_a, "triples"_a, "limit"_a, "behind"_a, "keep"_a);
}

}  // namespace tanteo
