// Seeds of poses from sensed planes, with their uncertainty, independent of the part.
#pragma once
#include <vector>

#include "proposals/lines.hpp"

namespace tanteo {

struct PlaneBase {
    struct Known {
        double variance, tilt2;  // of a plane's height [m^2], of its normal [rad^2]
        double near, reach;      // cosine up to which the normal of a face agrees; how far it may be beyond the face [m]
    };
    bool walls;                // the first line and two planes, points of walls along it; else three lines
    int first, second, third;  // the third is -1 where there is none
    double low, high;          // cosines between the first two lines
    Mat3 frame;                // of these, from the world
    Mat3 covariance;           // of the attitude by all lines [rad^2], in the world
    double spread;             // variance of a turn [rad^2]
    std::vector<double> near;  // cosine from which on each line is along a direction
    std::vector<Known> planes;
};

// Of triples of planes, each once, the last one of a triple being -1 where there is no third; and of triples of a plane and
// two points that may lie on the walls of two cylinders across it.
std::vector<PlaneBase> plane_bases(const std::vector<SensedPlane>& sensed, const std::vector<SensedLine>& lines,
                                   const std::vector<int>& triples, const std::vector<int>& walls);

Vec3 middle_of(const std::vector<SensedPlane>& sensed);

// Right-handed axes as columns: along the first, and across it and the second.
Mat3 axes(const Vec3& first, const Vec3& second);

}  // namespace tanteo
