// Search for the positions of least cost of drawings of a part's edges, one for each yaw, over an image.
#pragma once
#include <vector>

#include "image/image_frame.hpp"

namespace tanteo {

struct SlideTables {  // on a coarse grid with a margin
    const float* distances;  // to edges: channels x rows x columns [px]
    int64_t rows, columns;
    double cell;     // [px]
    int64_t margin;  // on every side [cells]
    Channels channels;

    // The cell of a position, if the tables contain its whole margin; -1 otherwise.
    int64_t cell_of(const Pixel& place) const;
};

struct SlideRules {
    int samples;   // number of edge samples
    double apart;  // distance below which poses of adjacent yaws are equal [px]
    size_t keep;
};

struct Slid {
    int yaw, place;
    double cost;  // mean of the distances
};

// The best yaws and positions without adjacent ones. The part is drawn at poses, one for each yaw, and moved in the image so
// that its centre is at a position.
std::vector<Slid> slid(const EdgeFrame& frame, const Lens& lens, const std::vector<Pose>& yaws, const Vec3& centre,
                       const SlideTables& tables, const std::vector<Pixel>& places, const SlideRules& rules);

}  // namespace tanteo
