// Random placements of three points on the surface of a part, with the weights that make their sums integrals over all poses.
#pragma once
#include <cstdint>
#include <vector>

#include "shape/shape.hpp"
#include "vec.hpp"

namespace tanteo {

// A point in the world: its place, the offset of the surface on which it is (radius of a ball), and the standard deviation of
// its distance from there.
struct TouchedPoint {
    Vec3 at;
    double offset = 0, sd = 0;
};

struct PlacedPose {
    Pose pose;
    double log_weight = 0;  // one over the density of the draw per shift and turn
    int draw = 0;
};

// Places three points for each draw, `points.size() / 3` of them, with their places and noise of this draw; many draws fail. The
// mean over the draws of exp(log_weight) g(pose) estimates the integral of g over all poses at which the points are on the surface.
std::vector<PlacedPose> placements(const Shape& shape, const std::vector<TouchedPoint>& points, uint64_t seed);

}  // namespace tanteo
