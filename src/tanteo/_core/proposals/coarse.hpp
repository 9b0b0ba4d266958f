// Parts of which only a box and a coarse field of distances are known: how well can points be of each, and where?
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "vec.hpp"

namespace tanteo {

struct CoarsePoint {
    Vec3 at, normal;  // normal: zero where none was sensed
    double sd = 0, tilt = 1, radius = 0;  // radius: how far it is from the surface, as the centre of a ball
    bool oriented = false;
};

// Signed distances at the nodes of a grid about a part, in steps of `unit`.
struct CoarseField {
    const int8_t* levels = nullptr;
    Vec3 origin;
    double step = 1, unit = 1;
    int shape[3] = {2, 2, 2};
};

struct CoarsePart {
    CoarseField field;
    double spacing = 0;  // between places even over its surface [m]
    Vec3 centre, low, high;  // low, high: corners of its box
};

struct CoarseEffort {
    int poses = 2000;         // that are scored of a kind, about
    int begin = 300;          // of these, that are scored on each part of it
    int stepped = 32;         // of these, from which steps are made
    int keep = 4;             // of what they lead to
    double most = 8;          // nats that a point costs at most: it may be an outlier
};

struct CoarsePose {
    Pose pose;
    double cost = 1e300;
};

constexpr int LANES = 8;

// Points side by side, as many as are taken at once, about the middle of all; what is no point has no weight.
struct CoarseBlock {
    float x[LANES] = {}, y[LANES] = {}, z[LANES] = {}, radius[LANES] = {}, var[LANES] = {}, weight[LANES] = {};
    float nx[LANES] = {}, ny[LANES] = {}, nz[LANES] = {}, tilt2[LANES] = {}, oriented[LANES] = {};
};

// Turns that are even over all attitudes, and what the points take up along a part's axes after each.
struct CoarseTurns {
    double apart = 0;        // of neighbours, about [rad]
    std::vector<Mat3> into;  // of directions of the world into those of the part
    std::vector<float> width[3], middle[3];
};

struct CoarsePoints {
    std::vector<CoarseBlock> blocks;
    std::vector<CoarseTurns> turns;  // from few to many
    Vec3 middle;
    bool oriented = false;
    double reach = 0, noise = 0;  // how far most are from the middle, and how far any may be from the surface [m]
};

// Where points are in a part: each at into x + at, x about their middle.
struct CoarseView {
    Mat3 into;
    Vec3 at;
};

using CoarseRanked = std::vector<std::pair<double, CoarseView>>;

CoarsePoints coarse_points(const std::vector<CoarsePoint>& points);

// How far apart places are at which points are tried in a part [m].
double coarse_cell(const CoarsePart& part);

// Cost of points on a part with their uncertainty [nats]; stops beyond the limit.
double coarse_score(const CoarsePart& part, const CoarsePoints& points, const CoarseView& view, double most, double limit);

// The best of views that are even over all attitudes and over where the points are in the box of a part, best first.
std::vector<CoarseView> coarse_starts(const CoarsePart& part, const CoarsePoints& points, const CoarseEffort& effort);

// Those of some views from which steps are made, with their scores on a part, best first.
CoarseRanked coarse_ranked(const CoarsePart& part, const CoarsePoints& points, const std::vector<CoarseView>& views,
                           const CoarseEffort& effort);

// The best poses of a part that views lead to, best first.
std::vector<CoarsePose> coarse_poses(const CoarsePart& part, const CoarsePoints& points, CoarseRanked found,
                                     const CoarseEffort& effort);

}  // namespace tanteo
