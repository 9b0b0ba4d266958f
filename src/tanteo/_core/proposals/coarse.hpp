// Coarse evaluation of points on parts by a box and a coarse distance field: costs and initial poses.
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "vec.hpp"

namespace tanteo {

struct CoarsePoint {
    Vec3 at, normal;  // normal: zero if none was sensed
    double sd = 0, tilt = 1, radius = 0;  // radius: distance from the surface of the centre of a ball
    bool oriented = false;
};

// Signed distances at the nodes of a grid around a part, in units of `unit`.
struct CoarseField {
    const int8_t* levels = nullptr;
    Vec3 origin;
    double step = 1, unit = 1;
    int shape[3] = {2, 2, 2};
};

struct CoarsePart {
    CoarseField field;
    double spacing = 0;  // between uniform samples of its surface [m]
    Vec3 centre, low, high;  // low, high: corners of its box
};

struct CoarseEffort {
    int poses = 2000;         // approximate number of poses that are scored for a kind
    int begin = 300;          // number of these that are scored on each part of the kind
    int stepped = 32;         // number of these that are refined
    int keep = 4;             // number of refined poses that are returned
    double most = 8;          // largest cost of a point [nats]: it may be an outlier
};

struct CoarsePose {
    Pose pose;
    double cost = 1e300;
};

constexpr int LANES = 8;

// Block of points for vector instructions, about the middle of all; unused lanes have no weight.
struct CoarseBlock {
    float x[LANES] = {}, y[LANES] = {}, z[LANES] = {}, radius[LANES] = {}, var[LANES] = {}, weight[LANES] = {};
    float nx[LANES] = {}, ny[LANES] = {}, nz[LANES] = {}, tilt2[LANES] = {}, oriented[LANES] = {};
};

// Uniform attitudes, and the extent of the points along a part's axes at each.
struct CoarseTurns {
    double apart = 0;            // approximate distance of adjacent attitudes [rad]
    const Mat3* into = nullptr;  // world to part
    size_t count = 0;            // number of attitudes
    std::vector<float> width[3], middle[3];
};

struct CoarsePoints {
    std::vector<CoarseBlock> blocks;
    std::vector<CoarseTurns> turns;  // from few to many
    Vec3 middle;
    bool oriented = false;
    double reach = 0, noise = 0;  // distance of most from the middle, largest distance from the surface [m]
};

// Placement of points in the part frame: into x + at, with x about their middle.
struct CoarseView {
    Mat3 into;
    Vec3 at;
};

using CoarseRanked = std::vector<std::pair<double, CoarseView>>;

// Points for parts whose positions are at least a cell apart [m].
CoarsePoints coarse_points(const std::vector<CoarsePoint>& points, double cell);

// Distance of adjacent positions at which points are tried in a part [m].
double coarse_cell(const CoarsePart& part);

// Cost of points on a part with their uncertainty [nats]; stops beyond the limit.
double coarse_score(const CoarsePart& part, const CoarsePoints& points, const CoarseView& view, double most, double limit);

// The best of views that are uniform over attitudes and over positions with the points in the box of a part, best first.
std::vector<CoarseView> coarse_starts(const CoarsePart& part, const CoarsePoints& points, const CoarseEffort& effort);

// The views that are refined, with their scores on a part, best first.
CoarseRanked coarse_ranked(const CoarsePart& part, const CoarsePoints& points, const std::vector<CoarseView>& views,
                           const CoarseEffort& effort);

// The best poses of a part that views lead to, best first.
std::vector<CoarsePose> coarse_poses(const CoarsePart& part, const CoarsePoints& points, CoarseRanked found,
                                     const CoarseEffort& effort);

}  // namespace tanteo
