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
    double weight_of(const PendingFace& face) const {  // after masses.run()
        return face.component.weight * masses.exponential(face.mass) * masses.mass(face.mass).value;
    }

  private:
    std::vector<PendingFace> faces;
    size_t filled = 0;
};

}  // namespace tanteo
