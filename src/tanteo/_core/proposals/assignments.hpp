// Poses that put points on faces, by a tree search over the assignments of points to faces (the interpretation tree of
// Grimson and Lozano-Perez 1984), within a normal density of the pose.
#pragma once
#include <vector>

#include "shape/shape.hpp"
#include "solve/problem.hpp"

namespace tanteo {

// A normal density of the pose: information of small motions of the part about the shape's centre.
struct PoseRegion {
    Pose mean;
    double information[36] = {};
};

struct AssignmentLimits {
    double gate = 4;     // deviation beyond which a point is on no face [standard deviations]
    double cost = 40;    // largest sum of squares of a pose, of the region and of the points
    double gap = 28;     // largest sum of squares over the least
    double noise = 1;    // factor on the standard deviations of the points
    int outliers = 0;    // number of points that may be on no face
    int nodes = 1000;    // number of assignments of some of the points after which the search ends
    int keep = 40;       // number of poses
};

struct AssignedPose {
    Pose pose;
    double score;  // log density and half the log of the volume, without constants
};

struct AssignedPoses {
    std::vector<AssignedPose> best;  // best first
    int nodes = 0;
    bool complete = true;  // whether all assignments within the limits were tried
};

// Each node assigns the point that has the fewest possible faces, given the pose by the points before it; the pose and its
// covariance follow by Gauss-Newton steps. A node ends if its sum of squares is too large or a point has no face.
AssignedPoses assigned_poses(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                             const PoseRegion& region, const AssignmentLimits& limits);

}  // namespace tanteo
