// Geometry of a part for the likelihood: flat pieces with outlines, the exact round surfaces that they approximate, edges,
// corners.
#pragma once
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "shape/bvh.hpp"
#include "bindings/array.hpp"
#include "vec.hpp"

namespace tanteo {

// A cylinder, cone, sphere or torus: a line or circle rotated about an axis. min_cosine: least cosine between its normal and
// that of a facet.
struct Profile {
    Vec3 point, axis;
    double offset = 0, slope = 0, radius = 0, sign = 1, min_cosine = 1;

    struct At {
        double distance;  // signed, positive outside the material
        Vec3 normal;      // gradient of the distance
        Vec3 e[2];        // the gradient's derivative is the sum of bend[i] e[i] e[i]'
        double bend[2];
    };
    At at(const Vec3& p, bool with_bends) const;
};

struct OutlineEdge {  // edge of the outline of a flat, in its plane; the inside is on the left
    double x, y, dx, dy, length;
    int first_bin, unused = 0;  // no padding, so that the bytes of a shape are reproducible
};

// Coplanar triangles of one face.
struct Flat {
    Vec3 normal, origin, u, v;
    double offset = 0, area = 0;
    double sagitta = 0;  // largest distance of the exact round surface from the flat
    double lo[2] = {1e300, 1e300}, hi[2] = {-1e300, -1e300};
    double bin_lo = 0, bin_step = 1;  // bins of outline edges by y
    int face = 0, profile = -1;
    int first_edge = 0, edges = 0;  // rows in Shape::outlines
    int first_bin = 0, bins = 0;    // rows in Shape::bin_start, which has one more
};

// Facet cluster: flats of one face, which are a normal density about their middle if the noise is much wider.
struct Place {
    Vec3 middle, normal;  // means by area; the mean normal is shorter than 1 if the flats differ in direction
    Mat3 spread;          // covariance of the positions of the flats
    double area = 0, size = 0;
    int face = -1, unused = 0;  // face: -1 for several
};

struct ConvexEdge {  // between two flats, which a ball can touch
    Vec3 a, direction, normal[2], inward[2];
    double length;
    int face, unused = 0;
    int tip[2] = {-1, -1};  // vertices at its ends at which all edges are convex, which a ball can touch; otherwise -1
};

struct Segment {  // a straight sharp edge of the part
    Vec3 a, direction;
    double length;
};

// A landmark of the part for sensed centres: the axis of a hole or boss from end to end, or without length a point with an
// axis (the centre of a sphere, the apex of a cone). kind: code of the kind of factor (factors/registry.hpp); least, most:
// range of its sizes; weight: its fraction among all landmarks of its kind.
struct RoundAxis {
    Vec3 a, direction;
    double length, least, most, weight;
    double least_other = 0, most_other = 0;  // range of a second size
    int hole, number, kind, unused = 0;
};

struct Closest {
    double squared = 1e300;
    Vec3 point;
    int triangle = -1;
};

struct ShapeNumbers {
    Vec3 centre;
    double area = 0, edge_length = 0, diagonal = 0;
    Vec3 grid_origin;
    double grid_step = 1;
    int grid_shape[3] = {0, 0, 0}, unused = 0;
};

// Input of a shape. Triangles are rows of three vertices, each with its face, and with its profile or -1. Areas are those of
// the faces that the triangles represent; empty: those of the triangles.
struct Solid {
    std::vector<Vec3> vertices;
    std::vector<int> triangles, faces, profile_rows;
    std::vector<Profile> profiles;
    std::vector<Segment> edges;
    std::vector<RoundAxis> axes;
    std::vector<Vec3> corners, hull, samples, sample_normals;
    Vec3 centre;
    std::vector<double> areas;
};

class Shape : public ShapeNumbers {
  public:
    Shape(Solid solid, int cells);
    // from the bytes of a shape; the caller keeps them alive as long as the shape
    Shape(const unsigned char* bytes, size_t size);
    // number of bytes of the shape, and the bytes themselves: written to `out`, which may be aligned to any address
    size_t size() const;
    void write(unsigned char* out) const;

    Closest closest(const Vec3& p) const;
    Closest closest_about(const Vec3& p) const;  // on the triangle nearest to the nearest node of the grid
    // first triangle that a ray hits: distance (1e300 for none) and triangle; faster if `guess` is that triangle
    double cast(const Vec3& origin, const Vec3& direction, double reach, int* triangle = nullptr, int guess = -1) const;
    // the triangles beyond the three sides of each triangle, the first from its first to its second corner; -1 for none
    const std::vector<int>& neighbours() const;
    double hit_at(int triangle, const Vec3& origin, const Vec3& direction) const;  // distance; 1e300 for no hit
    // calls visit(triangle) for all triangles that rays within `beside` of a ray may hit within a reach
    template <class Visit>
    void triangles_about(const Vec3& origin, const Vec3& direction, double reach, double beside, Visit&& visit) const {
        triangle_tree.cast(origin, direction, reach, [&](int t, double nearest) { visit(t); return nearest; }, beside);
    }
    // box about all triangles
    const Box& bounds() const { return triangle_tree.nodes[0].box; }
    // calls visit(triangle) for triangles in accepted boxes
    template <class Accept, class Visit>
    void triangles_where(Accept&& accept, Visit&& visit) const {
        triangle_tree.where(accept, visit);
    }
    // The number of an axis as an element: below those of edges and corners.
    int number_of(const RoundAxis& axis) const {
        return -2 - static_cast<int>(edges.size() + corners.size()) - axis.number;
    }
    // The fraction of an element among all of its kind: faces by area, edges by length, corners by number.
    double measure_of(int element) const {
        const size_t at = static_cast<size_t>(-2 - element);
        if (element >= 0) return face_area[element] / area;
        if (at < edges.size()) return edges[at].length / edge_length;
        return 1.0 / std::max<size_t>(corners.size(), 1);
    }
    // unsigned distance to the surface from the grid; rough outside of it
    double field(const Vec3& p, int* flat = nullptr) const;

    // calls visit(flat) for flats near a point; skips clusters for which done(place) is true
    template <class Done, class Visit>
    void flats_near(const Vec3& p, double reach, Done&& done, Visit&& visit) const {
        const auto seen = [&](int node) { return done(places[flats.size() + node]); };
        flat_tree.near(p, reach, seen, visit);
    }
    template <class Visit>
    void convex_edges_near(const Vec3& p, double reach, Visit&& visit) const {
        edge_tree.near(p, reach, [](int) { return false; }, visit);
    }

    Array<Vec3> vertices;
    Array<int> triangles, faces, flat_of;
    Array<Vec3> normals;
    Array<Profile> profiles;
    Array<Flat> flats;
    Array<Place> places;  // cluster of each flat, then of each node of the tree of flats
    Array<OutlineEdge> outlines;
    Array<int> bin_start, bin_edges;  // edges of an outline, relative to its first, bin by bin
    Array<ConvexEdge> convex_edges;
    Array<Segment> edges;
    Array<RoundAxis> axes;
    Array<int> face_round;  // whether each face is curved
    Array<Vec3> corners, hull;
    Array<double> face_area;
    Array<Vec3> samples, sample_normals;  // uniform samples of the surface

  private:
    struct Cell {
        size_t node;
        double f[3], away;
    };
    Cell cell_of(const Vec3& p) const;
    Closest closest(const Vec3& p, int guess) const;
    Closest closest_of(const Vec3& p, int triangle) const;
    int near_triangle(const Vec3& p) const;
    template <class Self, class Visit>
    static void each_array(Self& shape, Visit&& visit);

    struct Neighbours {
        std::once_flag once;
        std::vector<int> rows;
    };
    std::unique_ptr<Neighbours> beyond = std::make_unique<Neighbours>();  // found at their first use
    Bvh triangle_tree, flat_tree, edge_tree;
    Array<float> grid;
    Array<int> grid_triangle;  // nearest triangle to each node

    void make_flats(const std::vector<int>& profile_rows, std::vector<Flat>& made);
    void make_outlines(std::vector<Flat>& made);
    void make_bins(std::vector<Flat>& made, std::vector<OutlineEdge>& lines);
    void make_places();
    void make_convex_edges();
    void make_grid(int cells);
};

double point_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c, Vec3& q);

}  // namespace tanteo
