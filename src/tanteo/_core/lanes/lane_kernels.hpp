// The arithmetic that runs in lanes, compiled once for each width and chosen when the program starts.
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tanteo {

constexpr size_t WIDEST_LANES = 8;  // arrays of the kernels have a multiple of this size
constexpr size_t SPARE_SHORTS = 16 * WIDEST_LANES;

// The pieces of an edge in the plane of a standard normal density, by what is to be integrated. An end of an edge further
// than ENDLESS from the foot of the perpendicular is at infinity.
enum class EdgeKind { TINY, SHORT, WHOLE, ONE_END, TWO_ENDS };
constexpr int EDGE_KINDS = 5;
constexpr double ENDLESS = 5;  // standard deviations; the error is below 4e-7

// Edges of one kind: distances h >= 0 of their lines, and ends along these. An edge with one end goes to +infinity.
struct EdgeArrays {
    const double *h, *first, *last;
    double *wedge;  // probability of the wedge between the edge and infinity, at the origin
    double *along;  // integral of the density along the edge
    double *ends;   // density at the last end less that at the first one
};

// Rays from one origin through places (x, y) of a plane: one over the depth of the nearest triangle, and its number. The
// arrays have WIDEST_LANES * 2 elements more than rays.
struct RayArrays {
    const float *x, *y;
    float* nearest;
    int* who;
};

// A triangle seen from there: coefficients of x, y and 1 of its sides, negative inside, and of one over its depth.
struct SeenTriangle {
    float sides[3][3], near[3];
    int number;
};

struct LaneKernels {
    int width;
    void (*exponentials)(double* x, size_t count);
    void (*edges[EDGE_KINDS])(const EdgeArrays& edges, size_t count, bool with_slope);  // wedges alone without the slope
    void (*cover)(const RayArrays& rays, int first, int end, const SeenTriangle& triangle);
    // Sums of a table at so many offsets from each of so many consecutive cells, modulo 2^16. Table and sums have SPARE_SHORTS
    // elements more than are used.
    void (*sums_under)(const uint16_t* from, const int64_t* offsets, size_t count, size_t cells, uint16_t* sums);
};

// The kernels in use: the widest that the processor has, unless another width was set. Results do not depend on it.
const LaneKernels& lane_kernels();
std::vector<int> lane_widths();
bool set_lane_width(int width);  // false if there are no kernels of this width

extern const LaneKernels KERNELS_1;
#if defined(__GNUC__)
extern const LaneKernels KERNELS_2;
#endif
#if defined(TANTEO_X86_64)
extern const LaneKernels KERNELS_4, KERNELS_8;
#endif

}  // namespace tanteo
