// Comparison of an observed convex outline on a table with that of a part in a stable pose.
#pragma once
#include <array>
#include <vector>

#include "vec.hpp"

namespace tanteo {

constexpr int DIRECTIONS = 32;  // directions along which an outline is measured, from x towards y

// Outline in a camera image, projected onto the table.
struct ObservedOutline {
    std::array<double, DIRECTIONS> reach{};  // extent along each direction, from the middle [m]
    double middle[2] = {0, 0};
    Vec3 eye;            // centre of the camera, z above the table
    double sd = 1;       // standard deviation of an extent [m]
    double shadow = 0.4; // standard deviation of a shadow's length over the height of the part
    double most = 1e9;   // largest cost

    double from_eye(int k) const;  // extent along a direction, from the point below the camera
};

struct OutlineFit {
    double cost = 1e300;  // sum of squares in standard deviations
    Pose pose;            // pose of the part in the frame of the table
};

// The best yaw and position of a part on the table; `down` is the downward direction in the part frame.
OutlineFit fit_outline(const std::vector<Vec3>& points, const Vec3& down, const ObservedOutline& observed);

}  // namespace tanteo
