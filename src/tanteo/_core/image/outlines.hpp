// Convex outlines on a table: how well could a part that lies on one of its faces have an outline that a camera saw?
#pragma once
#include <array>
#include <vector>

#include "vec.hpp"

namespace tanteo {

constexpr int AROUND = 32;  // directions in which an outline is told, from x towards y

// What a camera saw, drawn onto the table by its rays.
struct OutlineSeen {
    std::array<double, AROUND> reach{};  // how far it goes in each direction, from the middle [m]
    double middle[2] = {0, 0};
    Vec3 eye;            // where the camera is, z above the table
    double sd = 1;       // of a reach
    double shadow = 0.4; // standard deviation of a shadow's length, in heights of the part
    double most = 1e9;   // costs beyond this are alike

    double from_eye(int k) const;  // how far it goes in a direction, from below the camera
};

struct OutlineFit {
    double cost = 1e300;  // sum of squares in standard deviations
    Pose pose;            // of the part, in the frame of the table
};

// The best yaw and place of a part on the table; `down` is the direction in its frame that is down.
OutlineFit fit_outline(const std::vector<Vec3>& points, const Vec3& down, const OutlineSeen& seen);

}  // namespace tanteo
