// Seeds of poses from sensed planes, with their uncertainty, independent of the part.
#pragma once
#include <vector>

#include "proposals/lines.hpp"

namespace tanteo {

struct PlaneBase {
    struct Known {
        double variance, tilt2;  // variances of a plane's height [m^2] and normal [rad^2]
        double near, reach;      // least cosine to the normal of a face; largest distance beyond the face [m]
    };
    bool walls;                // whether the base is the first line and two points on walls along it; otherwise three lines
    int first, second, third;  // the third is -1 if there is none
    double low, high;          // range of the cosine between the first two lines
    Mat3 frame;                // world to the axes of these lines
    Mat3 covariance;           // covariance of the attitude by all lines in the world [rad^2]
    double spread;             // variance of a turn [rad^2]
    std::vector<double> near;  // least cosine at which each line is along a direction
    std::vector<Known> planes;
};

// Bases from triples of planes, each once, the last one of a triple -1 if there is no third; and from triples of a plane and
// two points that may be on the walls of two cylinders across it.
std::vector<PlaneBase> plane_bases(const std::vector<SensedPlane>& sensed, const std::vector<SensedLine>& lines,
                                   const std::vector<int>& triples, const std::vector<int>& walls);

Vec3 middle_of(const std::vector<SensedPlane>& sensed);

// Right-handed axes as columns: along the first, and across it and the second.
Mat3 axes(const Vec3& first, const Vec3& second);

}  // namespace tanteo
