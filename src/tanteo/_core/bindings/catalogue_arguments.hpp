// Arguments and results of the bindings for many parts: tables of faces in mapped files, sensed planes, best poses.
#pragma once
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "bindings/conversion.hpp"
#include "proposals/planes.hpp"

namespace tanteo {

// Rows of an array by part: first row of each part, and the end of the last.
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

// Replaces the faces by those of one part.
inline void read_faces(const Table& planes, const Table& rounds, int row, ModelFaces& out) {
    out.planes.clear();
    out.rounds.clear();
    const float* x = planes.begin(row);
    for (size_t k = 0; k < planes.count(row); ++k, x += 7)
        out.planes.push_back({{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, x[6]});
    x = rounds.begin(row);
    for (size_t k = 0; k < rounds.count(row); ++k, x += 9)
        out.rounds.push_back({{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, x[6], x[7], x[8]});
}

inline std::vector<SensedPlane> sensed_planes(const Doubles& rows) {
    std::vector<SensedPlane> out(expect(rows, "sensed", {ANY, 12}));
    for (size_t k = 0; k < out.size(); ++k) {
        const double* x = rows.data() + 12 * k;
        out[k] = {load(x), load(x + 3), x[6], x[7], x[8], x[9], x[10] > 0, x[11] > 0};
    }
    return out;
}

// Cost of a plane without a compared face [nats]: one point with its normal may be on a face that is not compared, with the
// fraction of the area that these faces have.
inline double most_of(const SensedPlane& plane, double unseen) {
    constexpr double LOOSE = 1.5;
    return plane.alone && unseen > 0 ? std::min(plane.most, LOOSE - std::log(unseen)) : plane.most;
}

// The best poses of each part and their costs; parts with fewer poses have the identity at the largest cost.
struct BestPoses {
    size_t parts, keep;
    double most;
    std::vector<double> costs, Ts;

    BestPoses(size_t parts, size_t keep, double most)
        : parts(parts), keep(keep), most(most), costs(parts * keep, most), Ts(16 * parts * keep, 0.0) {}
    template <class Found>
    void put(size_t part, const std::vector<Found>& found) {
        for (size_t k = 0; k < keep; ++k) {
            const bool there = k < found.size();
            store_pose(there ? found[k].pose : Pose{}, &Ts[16 * (part * keep + k)]);
            if (there) costs[part * keep + k] = std::min(found[k].cost, most);
        }
    }
    Out costs_out() { return array_of(std::move(costs), {parts, keep}); }
    Out poses_out() { return array_of(std::move(Ts), {parts, keep, 4, 4}); }
};

}  // namespace tanteo
