// Edges of a part in an image: where they are, which edge points they meet, and how that follows the pose.
#pragma once
#include <cstdint>
#include <vector>

#include "vec.hpp"

namespace tanteo {

struct Lens {  // focal lengths and centre [px], OpenCV's k1 k2 p1 p2 k3 k4 k5 k6
    double fx, fy, cx, cy, k[8];
};

struct EdgePoints {  // of an image, and the nearest to each of its pixels by direction: channels x rows x columns
    const int32_t* nearest;
    int64_t channels, rows, columns;
    const double *pixels, *sds;
    int64_t count;
};

struct EdgeSample {  // of an edge of the part: where it is, its direction, the length that it stands for [m]
    Vec3 at, along;
    double length;
};

struct EdgeMet {
    double x = 0, y = 0;      // pixel
    double nx = 0, ny = 0;    // across the edge
    double span = 0;          // length in the image [px]
    double offset = 0, sd = 1;  // of the edge point along the normal
    double slope[6] = {0};    // offset(T exp(xi)) = offset - slope xi
    int32_t point = -1;       // the edge point; -1 for none within reach
    bool inside = false;
};

// A sample at a pose of the camera, if it is shown; shorter edges than a pixel across the part are none.
EdgeMet meet_edge(const Lens& lens, const EdgePoints& points, const EdgeSample& sample, const Pose& pose, bool shown,
                  double diagonal, double reach);

// Costs of a drawing that is slid to places: the mean of a table under its samples, and a penalty for how much of it
// lies on what is bare; infinite where that is more than a share.
void slide(const float* distances, int64_t count, const float* bare, int64_t bare_count, const int32_t* drawn,
           int64_t samples, const int32_t* inner, int64_t inners, const int32_t* slides, int64_t places, double most,
           double penalty, double* costs);

}  // namespace tanteo
