// Parts of which only a few places and a coarse field of distances are known: how well can points be of each?
#pragma once
#include <cstdint>
#include <vector>

#include "vec.hpp"

namespace tanteo {

struct CoarsePoint {
    Vec3 at, normal;  // normal: zero where none was sensed
    double sd = 0, tilt = 1, radius = 0;  // radius: how far it is from the surface, as the centre of a ball
    bool oriented = false;
};

struct CoarsePlace {
    Vec3 at, normal;
};

// Signed distances at the nodes of a grid about a part, in steps of `unit`.
struct CoarseField {
    const int8_t* levels = nullptr;
    Vec3 origin;
    double step = 1, unit = 1;
    int shape[3] = {1, 1, 1};

    double nearest(const Vec3& p) const;                // at the node next to a point; farther outside, farther
    double linear(const Vec3& p, Vec3& gradient) const;  // between nodes
};

struct CoarsePart {
    CoarseField field;
    const CoarsePlace* places = nullptr;
    int count = 0;
    double spacing = 0;  // between places [m]
    Vec3 centre;
};

struct CoarseEffort {
    int spins = 24;      // about a line, where no normal says how
    int pairs = 400;     // of places for each pair of points, about
    int refine = 10;     // poses that are refined
    int keep = 4;        // and handed out
    double error = 0.2;  // of the field, in steps of its grid
    double tilt = 0.3;   // of its gradient [rad]
    double most = 8;     // nats that a point costs at most: it may be an outlier
};

struct CoarsePose {
    Pose pose;
    double cost = 1e300;
};

// The best poses of a part, best first: from pairs of places as far apart as two points, or from some poses.
std::vector<CoarsePose> coarse_poses(const CoarsePart& part, const std::vector<CoarsePoint>& points,
                                     const std::vector<int>& pairs, const std::vector<Pose>& starts,
                                     const CoarseEffort& effort);

}  // namespace tanteo
