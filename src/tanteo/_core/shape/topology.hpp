// Connectivity of meshes: equal rows, edges with their triangles, connected components, near points.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "vec.hpp"

namespace tanteo {

// Sets of equal keys, numbered in ascending order of the keys: the first row of each set, and the set of each row.
struct KeySets {
    std::vector<int64_t> first, sets;
    KeySets(const int64_t* keys, size_t count);
};

// Undirected edges in the order of their vertices, the lower one first: number of triangles that have each forwards and
// backwards, and the last of these triangles; -1 for none.
struct EdgeTable {
    std::vector<int64_t> ends, ahead, back, left, right;
    EdgeTable(const int64_t* triangles, size_t count, size_t vertices);
};

// Connected component of each node, numbered by its lowest node.
std::vector<int64_t> components(size_t count, const int64_t* first, const int64_t* second, size_t links);

// Pairs of points closer than a distance, the lower row first.
std::vector<int64_t> near_pairs(const double* points, size_t count, double distance);

// Number of each row of three numbers among the different ones in the order of their first occurrence, which are appended
// to `different`; -0 equals 0.
std::vector<int64_t> welded(const float* rows, size_t count, std::vector<double>& different);
std::vector<int64_t> welded(const double* rows, size_t count, std::vector<double>& different);

// Angle between the normals of the triangles at each pair of rows.
void angles_between(const double* normals, const int64_t* left, const int64_t* right, size_t count, double* angles);

// Length of the longest side of each triangle.
void longest_sides(const double* vertices, const int64_t* triangles, size_t count, double* lengths);

// Middle of each triangle, and the volume of the tetrahedron of each with an origin, positive in front of the origin.
void middles_and_volumes(const double* vertices, const int64_t* triangles, size_t count, const double* origin,
                         double* middles, double* volumes);

// Unit normals, zero for a triangle without area, and areas.
void triangle_geometry(const double* vertices, const int64_t* triangles, size_t count, double* normals, double* areas);

}  // namespace tanteo
