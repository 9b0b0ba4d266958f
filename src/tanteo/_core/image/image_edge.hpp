// Samples of a part's edges in an image: their positions, the matched edge points, and the derivatives by the pose.
#pragma once
#include <cstdint>
#include <vector>

#include "vec.hpp"

namespace tanteo {

struct Lens {  // focal lengths and centre [px], OpenCV's k1 k2 p1 p2 k3 k4 k5 k6
    double fx, fy, cx, cy, k[8];
};

struct Pixel {
    double x, y;
};

// Pixel of a point in the camera frame; nan if the point is not in front of the camera.
Pixel project(const Lens& lens, const Vec3& p);

// The direction channel of a normal of either sign.
class Channels {
  public:
    explicit Channels(int64_t count);
    int64_t of(double nx, double ny) const;
    int64_t count() const { return static_cast<int64_t>(borders.size()); }

  private:
    std::vector<Pixel> borders;  // unit vectors between adjacent channels, from 0 to a half turn
};

struct EdgePoints {  // edge points of an image, and the nearest to each pixel by direction: channels x rows x columns
    const int32_t* nearest;
    int64_t count, rows, columns;
    const double *pixels, *sds;
    Channels channels;
};

struct EdgeSample {  // sample of an edge of the part: position, direction, represented length [m]
    Vec3 at, along;
    double length;
};

struct EdgeMatch {
    double x = 0, y = 0;      // pixel
    double nx = 0, ny = 0;    // normal of the edge in the image
    double span = 0;          // length in the image [px]
    double offset = 0, sd = 1;  // offset of the edge point along the normal, and its sd [px]
    double slope[6] = {0};    // offset(T exp(xi)) = offset - slope xi
    int32_t point = -1;       // index of the edge point; -1 if none is within reach
    bool inside = false;
};

// Matches a sample at a pose of the camera, if it is visible. A direction with less than a pixel across the part is ignored.
EdgeMatch match_edge(const Lens& lens, const EdgePoints& points, const EdgeSample& sample, const Pose& pose, bool shown,
                     double diagonal, double reach);

struct EdgePlace {  // sample in the image: position, normal, width, distance of its match, index of its edge
    double x, y, nx, ny, width, off;
    int group;
};

// Whether each matched sample explains its edge of the image: no other edge of the part matches the same place with the same
// direction (cosine of normals) from nearer. Two samples match one place within the wider of their widths.
std::vector<char> foremost(const std::vector<EdgePlace>& all, double cosine);

// Whether each sample has another edge of the part within a gap, or its own edge with another direction.
std::vector<char> ambiguous_places(const std::vector<EdgePlace>& all, double gap, double cosine);

}  // namespace tanteo
