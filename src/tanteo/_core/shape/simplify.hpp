// Coarser copies of a mesh whose deviation from it is bounded.
#pragma once
#include <vector>

#include "vec.hpp"

namespace tanteo {

// Removes vertices by half-edge collapses: a copy has some of the vertices and none new. Each removed vertex is assigned
// to a triangle of the copy on its own face and is within the tolerance of it, so copies of thin walls keep both sides.
// Normals of the copy differ from those of the same face at the vertices that a triangle replaces by at most the tilt.
// A vertex between two faces moves along their border only, and is within the tolerance of the new border. Vertices of
// three faces, at the border of the surface, or of a place that is no manifold stay.
// Beside vertices, where edges of the two surfaces cross, they may be up to two tolerances apart.
class Simplifier {
  public:
    Simplifier(const std::vector<Vec3>& vertices, const int* triangles, const int* faces, size_t count);
    // Removes vertices until few more can be removed.
    void simplify(double tolerance, double tilt);

    std::vector<int> triangles, rows;  // three vertices of each triangle, and the original triangle from which it came

  private:
    struct Side {  // of the ring of a vertex, in the direction of its triangle
        int from, to, triangle;
    };
    struct Border {  // of a vertex between two faces: the second face with its normal, and the next vertices along the border
        int face = -1, ends[2] = {-1, -1};
        Vec3 normal;
        std::vector<int> removed[2] = {};  // vertices that were removed between it and each end
    };
    const std::vector<Vec3>& vertices;
    const int* faces;                // of the original triangles
    std::vector<Vec3> normals;       // at the vertices of the original mesh, of their first face
    std::vector<int> face_at, border_at;  // first face of each vertex; its row in `borders`, or -1
    std::vector<Border> borders;
    std::vector<char> fixed;         // vertices that stay
    std::vector<int> first, after;   // removed vertices of each triangle, as a chain: the first, and the one after each
    std::vector<int> start, at_vertex;  // triangles at each vertex
    std::vector<char> failed, touched;
    std::vector<int> stamp;
    int stamped = 0;
    std::vector<Side> ring;
    std::vector<int> chain, owner;  // removed vertices of a ring, and the new triangle of each

    void connect();
    bool find_ring(int u);
    bool is_linked(int u, int v);
    // normal of the original surface at a vertex on a face; null if it is not known
    const Vec3* normal_of(int vertex, int face) const;
    bool find_ends(int u);
    bool keeps_border(int u, int k, double limit) const;
    bool can_move(int u, int v, double limit, double cosine);
    void move(int u, int v);
    void move_border(int u);
    size_t pass(double tolerance, double cosine);
};

}  // namespace tanteo
