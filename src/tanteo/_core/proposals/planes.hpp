// Sensed planes, and the faces of a part with which they are compared.
#pragma once
#include <vector>

#include "vec.hpp"

namespace tanteo {

constexpr double SDS = 4;       // standard deviations within which lengths and angles agree
constexpr double MADE = 0.004;  // tolerance of angles [rad]: made and meshed faces differ from the drawing

// Largest deviation of the angle between two normals with these standard deviations [rad].
inline double agreement(double first, double second) { return SDS * std::hypot(first, second) + MADE; }

struct SensedPlane {
    Vec3 normal, at;      // outward if the side is known; a point on it
    double sd = 0;        // standard deviation of its height there [m]
    double tilt = 0;      // standard deviation of its normal [rad]
    double span = 0;      // largest distance of its points from there [m]
    double most = 8;      // cost without a face [nats]
    bool sided = false;
    bool alone = false;   // one point with its normal, which may be on a cylinder
};

struct ModelPlane {
    Vec3 normal, centre;
    double reach = 0;  // distance from the centre to the farthest corner [m]
};

struct ModelRound {  // a cylinder
    Vec3 middle, axis;
    double radius = 0, half = 0, sign = 1;  // half: half of its length [m]; sign 1: normals away from the axis
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
