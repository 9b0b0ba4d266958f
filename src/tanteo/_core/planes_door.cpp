// The planar faces of many parts, of which arrays lie in mapped files: poses and nats of sensed planes on each.
#include "door.hpp"
#include "parallel.hpp"
#include "plane_search.hpp"
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

// The planar faces and cylinders of some of many parts.
class Parts {
  public:
    Parts(const Floats& planes, const Starts& starts, const Floats& rounds, const Starts& round_starts, const Ints& rows)
        : rows(expect(rows, "rows", ANY, 0, static_cast<int64_t>(starts.size()) - 2)), planes(planes), rounds(rounds),
          starts(starts), round_starts(round_starts) {
        if (planes.size() % 7) refuse("planes", "expected seven numbers a face");
        if (rounds.size() % 9) refuse("rounds", "expected nine numbers a cylinder");
        check_starts(starts, "starts", this->rows, planes.size() / 7);
        check_starts(round_starts, "rounds_start", this->rows, rounds.size() / 9);
    }

    void faces(size_t r, ModelFaces& out) const {
        const int row = rows[r];
        out.planes.clear();
        out.rounds.clear();
        for (int64_t k = starts.data()[row]; k < starts.data()[row + 1]; ++k) {
            const float* x = planes.data() + 7 * k;
            out.planes.push_back({{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, x[6]});
        }
        for (int64_t k = round_starts.data()[row]; k < round_starts.data()[row + 1]; ++k) {
            const float* x = rounds.data() + 9 * k;
            out.rounds.push_back({{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, x[6], x[7], x[8]});
        }
    }

    const std::vector<int> rows;

  private:
    const Floats &planes, &rounds;
    const Starts &starts, &round_starts;
};

nb::tuple on_planes(Floats planes, Starts starts, Floats rounds, Starts round_starts, Doubles unseen, Ints rows,
                    Doubles sensed, Ints triples, Ints walls, double limit, double behind, int keep) {
    const Parts parts(planes, starts, rounds, round_starts, rows);
    expect(unseen, "unseen", {starts.size() - 1});
    const std::vector<SensedPlane> felt = sensed_of(sensed);
    const std::vector<int> tried = expect(triples, "triples", ANY, -1, static_cast<int64_t>(felt.size()) - 1);
    for (size_t k = 0; k < tried.size(); ++k)
        if (tried[k] < 0 && k % 3 != 2) refuse("triples", "expected -1 only for a third plane that there is not");
    const std::vector<int> rolled = expect(walls, "walls", ANY, 0, static_cast<int64_t>(felt.size()) - 1);
    expect(limit, "limit", 0, 1e9);
    expect(behind, "behind", 0, 1e9);
    const size_t R = parts.rows.size(), K = static_cast<size_t>(expect(keep, "keep", 1, 1000));
    std::vector<double> costs(R * K, limit), Ts(16 * R * K, 0.0);
    {
        nb::gil_scoped_release release;
        const auto make = [&] {
            std::vector<double> most(felt.size());
            return [&, search = PlaneSearch(felt, tried, rolled), faces = ModelFaces{}, most](size_t r) mutable {
                parts.faces(r, faces);
                for (size_t k = 0; k < felt.size(); ++k)
                    most[k] = felt[k].alone ? most_of(felt[k], unseen.data()[parts.rows[r]]) : felt[k].most;
                const std::vector<PlanePose> found = search.on(faces, most, limit, behind, static_cast<int>(K));
                for (size_t k = 0; k < K; ++k) {
                    const bool there = k < found.size();
                    store_pose(there ? found[k].pose : Pose{}, &Ts[16 * (r * K + k)]);
                    if (there) costs[r * K + k] = std::min(found[k].cost, limit);
                }
            };
        };
        for_all(R, make);
    }
    return nb::make_tuple(array_of(std::move(costs), {R, K}), array_of(std::move(Ts), {R, K, 4, 4}));
}

}  // namespace

void offer_planes(nb::module_& m) {
    using namespace nb::literals;
    m.def("on_planes", &on_planes, "planes"_a, "starts"_a, "rounds"_a, "rounds_start"_a, "unseen"_a, "rows"_a, "sensed"_a,
          "triples"_a, "walls"_a, "limit"_a, "behind"_a, "keep"_a);
}

}  // namespace tanteo
