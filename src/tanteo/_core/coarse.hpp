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
    int shape[3] = {1, 1, 1};
};

struct CoarsePart {
    CoarseField field;
    double spacing = 0;  // of places even over its surface [m]
    Vec3 centre, low, high;
};

struct CoarseEffort {
    int poses = 2000;    // that are scored, about
    int begin = 300;     // of these, that are tried on each part of a kind
    int step = 24;       // of these, from which steps are made
    int go_on = 6;       // of these, with which they go on
    int keep = 4;        // of these, that are handed out
    double most = 8;     // nats that a point costs at most: it may be an outlier
    double cell = 0.7, turn = 1, slack = 1, alike = 1.5;
    int rounds1 = 1, rounds2 = 4;
};

struct CoarsePose {
    Pose pose;
    double cost = 1e300;
};

constexpr int LANES = 8;

// Points side by side, as many as the processor takes at once; what is no point has no weight.
struct CoarseBlock {
    float x[LANES] = {}, y[LANES] = {}, z[LANES] = {}, radius[LANES] = {}, var[LANES] = {}, weight[LANES] = {};
    float nx[LANES] = {}, ny[LANES] = {}, nz[LANES] = {}, tilt2[LANES] = {}, oriented[LANES] = {};
};

// Turns that are even over all attitudes, and how far points reach in a part's axes after each.
struct CoarseTurns {
    double apart = 0;           // of neighbours, about [rad]
    std::vector<Mat3> into;     // of directions of the world into those of the part
    std::vector<float> width[3], middle[3];
};

struct CoarsePoints {
    std::vector<CoarseBlock> blocks;
    bool oriented = false;
    Vec3 centre;
    double reach = 0, noise = 0;
    std::vector<CoarseTurns> turns;  // from few to many
};

CoarsePoints coarse_points(const std::vector<CoarsePoint>& points, int spare, int most_turns);

// Where points are in a part: each at into x + at, x from the middle of all of them.
struct CoarseView {
    Mat3 into;
    Vec3 at;
};

// Nats of points where they are in a part, by the nodes next to them; stops beyond the limit.
double coarse_score(const CoarsePart& part, const CoarsePoints& points, const CoarseView& view,
                    const CoarseEffort& effort, double limit);

// The best of poses that are even over all attitudes and over where the points are in the box of a part, best first.
std::vector<CoarseView> coarse_starts(const CoarsePart& part, const CoarsePoints& points, const CoarseEffort& effort);

using CoarseRanked = std::vector<std::pair<double, CoarseView>>;

// Those of some views from which steps are made, with their scores on a part, best first.
CoarseRanked coarse_ranked(const CoarsePart& part, const CoarsePoints& points, const std::vector<CoarseView>& views,
                           const CoarseEffort& effort);

// The best poses of a part that views lead to, best first.
std::vector<CoarsePose> coarse_poses(const CoarsePart& part, const CoarsePoints& points, CoarseRanked found,
                                     const CoarseEffort& effort);

}  // namespace tanteo
