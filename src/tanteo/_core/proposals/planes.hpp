// Sensed planes on the planar faces of a part: the best that any pose can do, without the part itself.
#pragma once
#include <vector>

#include "vec.hpp"

namespace tanteo {

constexpr double SDS = 4;       // within which angles agree
constexpr double MADE = 0.004;  // and so much more [rad]: made and meshed faces differ from the drawing

// How far two normals whose tilts are known so well may be from the angle that they have.
inline double agreement(double first, double second) { return SDS * std::hypot(first, second) + MADE; }

struct SensedPlane {
    Vec3 normal, at;      // outward where the side is known; a point of it, of the surface
    double sd = 0;        // of its height there [m]
    double tilt = 0;      // of its normal [rad]
    double span = 0;      // how far it was felt around there [m]
    double most = 8;      // cost without a face [nats]
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

}  // namespace tanteo
