// Sensed planes on the planar faces of a part: the best that any pose can do, without the part itself.
#pragma once
#include <vector>

#include "vec.hpp"

namespace tanteo {

struct SensedPlane {
    Vec3 normal, at;      // outward where the side is known; a point of it, of the surface
    double sd = 0;        // of its height there [m]
    double tilt = 0;      // of its normal [rad]
    double span = 0;      // how far it was felt around there [m]
    double most = 8;      // nats that it costs if it is of no face
    bool sided = false;
    bool alone = false;   // one point with its normal: of a cylinder, it may be
};

struct ModelPlane {
    Vec3 normal, centre;
    double reach = 0;  // from there to its farthest corner [m]
};

struct ModelRound {  // a cylinder
    Vec3 middle, axis;
    double radius = 0, half = 0, sign = 1;  // half of its length; 1: its normals lead away from the axis
};

struct ModelFaces {
    std::vector<ModelPlane> planes;
    std::vector<ModelRound> rounds;
};

struct PlanePose {
    Pose pose;
    double cost = 1e300;
};

// One sensed plane at a pose: the least it costs, whether it is of a face or cylinder then, the normal of that and how far
// it is from there, in the part.
struct PlaneMatch {
    double cost = 1e300;
    bool found = false;
    Vec3 normal;
    double height = 0;
};
PlaneMatch match_plane(const ModelFaces& faces, const SensedPlane& plane, const Pose& pose);

// Poses that put three of the planes on three faces, and what all of them cost there in nats, best first. Each triple
// has three numbers of sensed planes; the last of them may be of a cylinder where it is one point, or -1 where there is no third. A pose that costs more than the limit is not looked at to its end.
std::vector<PlanePose> plane_poses(const ModelFaces& faces, const std::vector<SensedPlane>& sensed,
                                   const std::vector<int>& triples, double limit, int keep);

}  // namespace tanteo
