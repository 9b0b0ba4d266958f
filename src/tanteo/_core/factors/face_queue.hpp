// Faces near measurements whose densities wait for the arithmetic in lanes (truncated_normal.hpp). A factor adds its faces in
// begin() and takes them in evaluate(), so that the lanes have the faces of all factors of one or more poses.
#pragma once
#include <vector>

#include "factors/factor.hpp"
#include "factors/truncated_normal.hpp"

namespace tanteo {

struct PendingFace {
    Component component;  // without the mass; weight is the density over that of the mass's exponent
    Whitening W;
    double ku = 0, kv = 0;  // regression of the position in the plane on the distance
    int flat = -1, mass = -1;
    bool round = false, reached = false;  // reached: whether the density is not negligible by the distance alone
};

class FaceQueue {
  public:
    struct Block {  // of one factor
        size_t first_face = 0, faces = 0, first_cluster = 0, clusters = 0;
        double weight = 0, pending = 0;               // of the counted faces and clusters; most of faces without a mass
        size_t counted = 0, bounded = 0, summed = 0;  // faces with a mass, faces in `pending`, clusters that count
    };
    MassQueue masses;
    std::vector<Component> clusters;  // facet clusters, which have no outline
    std::vector<Block> blocks;
    size_t taken = 0;  // number of blocks that evaluate() has taken

    void clear(bool with_slope) {
        masses.clear(with_slope);
        clusters.clear();
        blocks.clear();
        filled = taken = 0;
    }
    size_t count() const { return filled; }
    const PendingFace& face(size_t k) const { return faces[k]; }
    // The next face, which counts after keep(). Its memory is used again, since faces are large.
    PendingFace& next() {
        if (filled == faces.size()) faces.emplace_back();
        Component& c = faces[filled].component;
        c.slope = {};
        c.stiff = {};
        c.spread = 0;
        c.tilted = false;
        return faces[filled];
    }
    void keep() { ++filled; }
    // Whether the faces and clusters of the last factor have a density of at least `least`. Each face is counted once.
    bool exceeds(double least) {
        Block& own = blocks.back();
        for (; own.summed < clusters.size() - own.first_cluster; ++own.summed)
            own.weight += clusters[own.first_cluster + own.summed].weight;
        if (least <= own.weight) return true;
        const size_t all = count() - own.first_face;
        for (; own.bounded < all; ++own.bounded) {  // a mass is at most one
            const PendingFace& one = faces[own.first_face + own.bounded];
            own.pending += one.component.weight * masses.density(one.mass);
        }
        if (own.counted == all || !(least <= own.weight + own.pending)) return false;
        masses.run();
        for (; own.counted < all; ++own.counted) own.weight += weight_of(faces[own.first_face + own.counted]);
        own.pending = 0;
        return least <= own.weight;
    }
    double weight_of(const PendingFace& face) const {  // after masses.run()
        return face.component.weight * masses.exponential(face.mass) * masses.mass(face.mass).value;
    }

  private:
    std::vector<PendingFace> faces;
    size_t filled = 0;
};

}  // namespace tanteo
