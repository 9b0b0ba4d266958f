// Samples of a part's edges in an image: where they are, which edge points they meet, and how that follows the pose.
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

// A point of the camera's frame in the image; no numbers unless it is in front.
Pixel project(const Lens& lens, const Vec3& p);

// Which of the directions that are discriminated a normal has, either sign.
class Channels {
  public:
    explicit Channels(int64_t count);
    int64_t of(double nx, double ny) const;
    int64_t count() const { return static_cast<int64_t>(borders.size()); }

  private:
    std::vector<Pixel> borders;  // unit vectors between neighbours, from 0 to a half turn
};

struct EdgePoints {  // of an image, and the nearest to each of its pixels by direction: channels x rows x columns
    const int32_t* nearest;
    int64_t count, rows, columns;
    const double *pixels, *sds;
    Channels channels;
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

struct EdgePlace {  // of a sample in the image: across it, how wide it is, what it met how far off, which edge it is of
    double x, y, nx, ny, width, off;
    int group;
};

// Which samples that met an edge of the image explain it: those of which no other edge of the part met the same place,
// running the same way, from nearer. Samples met one place within the wider of their widths.
std::vector<char> foremost(const std::vector<EdgePlace>& met, double alike);

// Which samples have another edge of the part within a gap, or their own where it has turned.
std::vector<char> crowded(const std::vector<EdgePlace>& all, double gap, double alike);

}  // namespace tanteo
