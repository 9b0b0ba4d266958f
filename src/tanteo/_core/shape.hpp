// A part as the likelihood sees it: flat pieces with their outlines, the round surfaces behind them, edges, corners.
#pragma once
#include <cstdint>
#include <vector>

#include "bvh.hpp"
#include "vec.hpp"

namespace tanteo {

// A cylinder, cone, ball or torus: a line or circle turned about an axis.
struct Profile {
    Vec3 point, axis;
    double offset = 0, slope = 0, radius = 0, sign = 1, alike = 1;

    struct At {
        double distance;  // signed, positive outside of the material
        Vec3 normal;      // its gradient
        Vec3 e[2];        // the gradient's derivative is the sum of bend[i] e[i] e[i]'
        double bend[2];
    };
    At at(const Vec3& p, bool with_bends) const;
};

struct OutlineEdge {  // of a flat, in its plane; the inside is on the left
    double x, y, dx, dy, length;
    int first_bin;
};

// Coplanar triangles of one face.
struct Flat {
    Vec3 normal, origin, u, v;
    double offset = 0, area = 0;
    double lo[2] = {1e300, 1e300}, hi[2] = {-1e300, -1e300};
    int face = 0, profile = -1;
    std::vector<OutlineEdge> outline;
    std::vector<std::vector<int>> bins;  // of edges by y
    double bin_lo = 0, bin_step = 1;
};

struct ConvexEdge {  // between two flats: where a ball rolls over
    Vec3 a, direction, normal[2], inward[2];
    double length;
    int face;
};

struct Segment {  // a straight sharp edge of the part
    Vec3 a, direction;
    double length;
};

struct Closest {
    double squared = 1e300;
    Vec3 point;
    int triangle = -1;
};

class Shape {
  public:
    // indices into vertices, faces by triangle, profiles by triangle (-1: none)
    Shape(std::vector<Vec3> vertices, std::vector<int> triangles, std::vector<int> faces, std::vector<int> profile_rows,
          std::vector<Profile> profiles, std::vector<Segment> edges, std::vector<Vec3> corners, const Vec3& centre);

    Closest closest(const Vec3& p) const;
    // first triangle that a ray meets: distance (infinite for none), triangle
    double cast(const Vec3& origin, const Vec3& direction, double reach, int* triangle = nullptr) const;
    // distance to the surface from the grid, not signed; rough far away
    double field(const Vec3& p, int* flat = nullptr) const;

    template <class Visit>
    void flats_near(const Vec3& p, double reach, Visit&& visit) const {
        flat_tree.near(p, reach + sagitta, visit);
    }
    template <class Visit>
    void convex_edges_near(const Vec3& p, double reach, Visit&& visit) const {
        edge_tree.near(p, reach, visit);
    }

    std::vector<Vec3> vertices;
    std::vector<int> triangles, faces, flat_of;
    std::vector<Vec3> normals;
    std::vector<Profile> profiles;
    std::vector<Flat> flats;
    std::vector<ConvexEdge> convex_edges;
    std::vector<Segment> edges;
    std::vector<Vec3> corners, hull;
    std::vector<double> face_area;
    Vec3 centre;
    double area = 0, edge_length = 0, diagonal = 0, sagitta = 0;

    std::vector<Vec3> samples, sample_normals;  // of the surface, even by area
    void build_grid(int cells);

  private:
    struct Cell {
        size_t node;
        double f[3], away;
    };
    Cell cell_of(const Vec3& p) const;
    Closest closest(const Vec3& p, int guess) const;
    Bvh triangle_tree, flat_tree, edge_tree;
    Vec3 grid_origin;
    double grid_step = 1;
    int grid_shape[3] = {0, 0, 0};
    std::vector<float> grid;
    std::vector<int> grid_triangle;  // nearest to each node

    void make_flats(const std::vector<int>& profile_rows);
    void make_outlines();
    void make_convex_edges();
};

double point_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c, Vec3& q);

}  // namespace tanteo
