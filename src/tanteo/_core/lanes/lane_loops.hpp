// The loops over lanes. A file defines LANES and includes this one; nothing of the standard library is used (lane_math.hpp).
#include "lanes/lane_kernels.hpp"
#include "lanes/lane_math.hpp"

namespace tanteo {
namespace {

#if LANES == 1
using V = double;
#else
typedef double V __attribute__((vector_size(8 * LANES)));
typedef unsigned long long VBits __attribute__((vector_size(8 * LANES)));
template <>
struct LaneBits<V> {
    using type = VBits;
};
#endif

inline V load_lanes(const double* from) {
    V v;
    std::memcpy(&v, from, sizeof v);
    return v;
}
inline void store_lanes(const V& v, double* to) { std::memcpy(to, &v, sizeof v); }

void exponentials(double* x, size_t count) {
    for (size_t k = 0; k < count; k += LANES) store_lanes(fast_exp<V>(load_lanes(x + k)), x + k);
}

// Owen's T for h >= 0 and 0 <= a <= 1: Gauss-Legendre, 10 nodes, error below 1e-11.
inline V owen_small(const V& h, const V& a) {
    constexpr double x[10] = {0.013046735741414139961, 0.067468316655507744634, 0.160295215850487796883,
                              0.283302302935376404600, 0.425562830509184394558, 0.574437169490815605442,
                              0.716697697064623595400, 0.839704784149512203117, 0.932531683344492255366,
                              0.986953264258585860039};
    constexpr double w[10] = {0.033335672154344068796, 0.074725674575290296572, 0.109543181257991021998,
                              0.134633359654998177545, 0.147762112357376435086, 0.147762112357376435086,
                              0.134633359654998177545, 0.109543181257991021998, 0.074725674575290296572,
                              0.033335672154344068796};
    const V c = -0.5 * h * h;
    V sum{};
    for (int k = 0; k < 10; ++k) {
        const V e = 1.0 + (a * x[k]) * (a * x[k]);
        sum = sum + w[k] * fast_exp<V>(c * e) / e;
    }
    return a * sum * 0.15915494309189533577;
}

// The probability of the wedge at the origin between a line at distance h >= 0 from its foot on, and the ray to the point t
// along it (Owen's T of h and t / h), odd in t. Also returns the mass below t.
inline V wedge(const V& h, const V& below_h, const V& t, V& below_t) {
    const V at = absolute(t), far = select(at > h, at, h), near = select(at > h, h, at);
    const V small = owen_small(far, near / select(far > 0.0, far, V{} + 1.0)), q = normal_below<V>(at);
    const V T = select(at > h, 0.5 * (below_h + q) - below_h * q - small, small);
    below_t = select(t < 0.0, 1.0 - q, q);
    return select(t < 0.0, -T, T);
}

// Gauss-Legendre with N nodes x and weights w on the unit interval.
template <int N>
void gauss_edges(const EdgeArrays& edges, size_t count, bool with_slope, const double (&x)[N], const double (&w)[N]) {
    for (size_t k = 0; k < count; k += LANES) {
        const V h = load_lanes(edges.h + k), first = load_lanes(edges.first + k), last = load_lanes(edges.last + k);
        const V length = last - first;
        V wedge{}, along{};
        for (int i = 0; i < N; ++i) {
            const V t = first + length * x[i], s = h * h + t * t, e = w[i] * fast_exp<V>(-0.5 * s);
            wedge = wedge + e / s;
            along = along + e;
        }
        const V per = length * 0.15915494309189533577;
        store_lanes(h * per * wedge, edges.wedge + k);
        if (!with_slope) continue;
        store_lanes(per * along, edges.along + k);
        store_lanes(normal_density<V>(h) * (normal_density<V>(last) - normal_density<V>(first)), edges.ends + k);
    }
}

// A short edge needs few nodes: the error is below 1e-10 with 4 nodes if it is shorter than half a standard deviation and
// than 0.3 of its distance, and below 2e-11 with 8 if it is shorter than its distance.
void tiny_edges(const EdgeArrays& edges, size_t count, bool with_slope) {
    constexpr double x[4] = {0.06943184420297371239, 0.33000947820757186760, 0.66999052179242813240, 0.93056815579702628761};
    constexpr double w[4] = {0.17392742256872692869, 0.32607257743127307131, 0.32607257743127307131, 0.17392742256872692869};
    gauss_edges<4>(edges, count, with_slope, x, w);
}
void short_edges(const EdgeArrays& edges, size_t count, bool with_slope) {
    constexpr double x[8] = {0.01985507175123188416, 0.10166676129318663020, 0.23723379504183550709, 0.40828267875217509753,
                             0.59171732124782490247, 0.76276620495816449291, 0.89833323870681336980, 0.98014492824876811584};
    constexpr double w[8] = {0.05061426814518812958, 0.11119051722668723528, 0.15685332293894364367, 0.18134189168918099148,
                             0.18134189168918099148, 0.15685332293894364367, 0.11119051722668723528, 0.05061426814518812958};
    gauss_edges<8>(edges, count, with_slope, x, w);
}

void whole_edges(const EdgeArrays& edges, size_t count, bool with_slope) {
    for (size_t k = 0; k < count; k += LANES) {
        const V h = load_lanes(edges.h + k);
        store_lanes(normal_below<V>(-h), edges.wedge + k);
        if (!with_slope) continue;
        store_lanes(normal_density<V>(h), edges.along + k);
        store_lanes(V{}, edges.ends + k);
    }
}

void edges_with_one_end(const EdgeArrays& edges, size_t count, bool with_slope) {
    for (size_t k = 0; k < count; k += LANES) {
        const V h = load_lanes(edges.h + k), first = load_lanes(edges.first + k), below_h = normal_below<V>(h);
        V below;
        const V T = wedge(h, below_h, first, below);
        store_lanes(0.5 * (1.0 - below_h) - T, edges.wedge + k);
        if (!with_slope) continue;
        const V density = normal_density<V>(h);
        store_lanes(density * (1.0 - below), edges.along + k);
        store_lanes(-(density * normal_density<V>(first)), edges.ends + k);
    }
}

void edges_with_two_ends(const EdgeArrays& edges, size_t count, bool with_slope) {
    for (size_t k = 0; k < count; k += LANES) {
        const V h = load_lanes(edges.h + k), first = load_lanes(edges.first + k), last = load_lanes(edges.last + k);
        const V below_h = normal_below<V>(h);
        V below_first, below_last;
        const V from = wedge(h, below_h, first, below_first), to = wedge(h, below_h, last, below_last);
        store_lanes(to - from, edges.wedge + k);
        if (!with_slope) continue;
        const V density = normal_density<V>(h);
        store_lanes(density * (below_last - below_first), edges.along + k);
        store_lanes(density * (normal_density<V>(last) - normal_density<V>(first)), edges.ends + k);
    }
}

#if LANES == 1
using F = float;
using I = int;
constexpr int FLOATS = 1;
inline float chosen_of(int chosen, float a, float b) { return chosen ? a : b; }
inline int chosen_of(int chosen, int a, int b) { return chosen ? a : b; }
#else
typedef float F __attribute__((vector_size(8 * LANES)));
typedef int I __attribute__((vector_size(8 * LANES)));
constexpr int FLOATS = 2 * LANES;
const int INDICES[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
template <class T>
inline T chosen_of(const I& chosen, const T& a, const T& b) {
    return select(chosen, a, b);
}
#endif

template <class T, class Number>
inline T load_many(const Number* from) {
    T v;
    std::memcpy(&v, from, sizeof v);
    return v;
}

// Sets the triangle where it is nearer than those before, for the rays from `first` to `end`.
void cover(const RayArrays& rays, int first, int end, const SeenTriangle& triangle) {
    const auto &a = triangle.sides[0], &b = triangle.sides[1], &c = triangle.sides[2], &d = triangle.near;
    for (int k = first; k < end; k += FLOATS) {
        const F x = load_many<F>(rays.x + k), y = load_many<F>(rays.y + k), before = load_many<F>(rays.nearest + k);
        const I known = load_many<I>(rays.who + k);
        const F depth = d[2] + d[0] * x + d[1] * y;
        I hit = (a[2] + a[0] * x + a[1] * y <= 0) & (b[2] + b[0] * x + b[1] * y <= 0) & (c[2] + c[0] * x + c[1] * y <= 0) &
                (depth > before);
#if LANES > 1
        hit &= load_many<I>(INDICES) < end - k;
#endif
        const F nearest = chosen_of(hit, depth, before);
        const I who = chosen_of(hit, I{} + triangle.number, known);
        std::memcpy(rays.nearest + k, &nearest, sizeof nearest);
        std::memcpy(rays.who + k, &who, sizeof who);
    }
}

#if LANES == 1
using S = uint16_t;
#else
typedef uint16_t S __attribute__((vector_size(8 * LANES)));
#endif
constexpr size_t SHORTS = sizeof(S) / sizeof(uint16_t);

// Sums of N lanes each, from the first of so many offsets on.
template <int N>
inline void sum_under(const uint16_t* from, const int64_t* offsets, size_t count, uint16_t* sums) {
    S all[N]{};
    for (size_t k = 0; k < count; ++k)
        for (int n = 0; n < N; ++n) all[n] += load_many<S>(from + offsets[k] + n * SHORTS);
    std::memcpy(sums, all, sizeof all);
}

void sums_under(const uint16_t* from, const int64_t* offsets, size_t count, size_t cells, uint16_t* sums) {
    size_t n = 0;
    for (; n + 3 * SHORTS < cells; n += 4 * SHORTS) sum_under<4>(from + n, offsets, count, sums + n);
    for (; n < cells; n += SHORTS) sum_under<1>(from + n, offsets, count, sums + n);
}

constexpr LaneKernels KERNELS{LANES, exponentials, {tiny_edges, short_edges, whole_edges, edges_with_one_end, edges_with_two_ends},
                              cover, sums_under};

}  // namespace
}  // namespace tanteo
