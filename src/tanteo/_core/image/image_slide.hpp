// Drawings of a part's edges, one for each yaw, slid over an image: where they cost least.
#pragma once
#include <vector>

#include "image/image_frame.hpp"

namespace tanteo {

struct SlideTables {  // on a coarse grid with a margin
    const float* distances;  // to edges: channels x rows x columns [px]
    const bool* bare;        // where bare table is seen: rows x columns
    int64_t rows, columns;
    double cell;     // [px]
    int64_t margin;  // on every side [cells]
    Channels channels;

    // The cell of a place from whose margin to the margin beyond it everything is in the tables; -1 for none.
    int64_t cell_of(const Pixel& place) const;
};

struct SlideRules {
    int samples;            // of edges that are looked up
    double most, penalty;   // share on bare table from which a place is not looked at; what all of it costs [px]
    double apart;           // poses of neighbouring yaws at places nearer than this are one [px]
    size_t keep;
};

struct Slid {
    int yaw, place;
    double cost;  // mean of the distances, and the penalty for what lies on bare table
};

// The best yaw and place, and the next ones that are not their neighbours. The part is drawn at poses, one for each
// yaw, and moved in the image so that its centre is at a place; inner points are asked whether they lie on bare table.
std::vector<Slid> slid(const EdgeFrame& frame, const Lens& lens, const std::vector<Pose>& yaws, const Vec3& centre,
                       const std::vector<Vec3>& inner, const SlideTables& tables, const std::vector<Pixel>& places,
                       const SlideRules& rules);

}  // namespace tanteo
