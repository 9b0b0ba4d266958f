// Mass of a normal density in a plane inside an outline, and its derivatives by the mean.
#pragma once
#include <vector>

#include "lanes/lane_kernels.hpp"
#include "normal.hpp"
#include "shape/shape.hpp"

namespace tanteo {

constexpr double OUTLINE_REACH = 5;  // standard deviations beyond which an edge of an outline has no effect

struct Whitening {  // of the noise in a plane: W (x - mean) has unit covariance
    double a, b, c;  // lower triangle
    double widest;
    bool even;  // equal in all directions
};

inline Whitening whitening_of(double xx, double xy, double yy) {
    const double l = std::sqrt(std::max(xx, 1e-300)), m = xy / l;
    const double k = std::sqrt(std::max(yy - m * m, 1e-12 * (xx + yy) + 1e-300));
    return {1 / l, -m / (l * k), 1 / k, std::sqrt(0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy)), false};
}

struct TruncatedMass {  // with gradient and minus second derivative by the whitened mean
    double value = 0, gx = 0, gy = 0, xx = 0, xy = 0, yy = 0;
};

// The masses of normal densities inside outlines, whose arithmetic runs in lanes: add() collects the edges that matter, run()
// integrates the density along them, mass() sums their contributions. Each mass has the density exp(exponent), too.
//
// A mass is the winding number about the mean (x, y), minus the mass beyond each edge within the angle that the edge subtends:
// for an edge at the distance h, with its ends at t1 and t2 along its line, T(h, t2 / h) - T(h, t1 / h) (Owen 1956). The
// gradient is the integral of the density times the inward normal along the outline.
class MassQueue {
  public:
    void clear(bool with_slope);
    // Adds the mass inside the outline of a flat; returns its number, or -1 if it is zero.
    int add(const Shape& shape, const Flat& flat, double x, double y, const Whitening& W, double exponent);
    void run();  // only what was added after the last run
    TruncatedMass mass(int number) const;
    double exponential(int number) const { return exponents[number]; }
    // the same before run(), too
    double density(int number) const {
        const double known = exponents[number];
        return static_cast<size_t>(number) < exponents_done ? known : fast_exp(known);
    }

    // Adds an edge in the whitened plane: its direction, the signed distance of its line, its ends along the line.
    void add_edge(double dx, double dy, double h, double t1, double t2, bool inside);
    struct EdgeIntegrals {  // as in EdgeArrays, for an edge from t1 to t2
        double wedge, along, ends;
    };
    EdgeIntegrals of_edge(size_t k) const {
        const Edge& e = edges[k];
        const Integrals& over = integrals[e.kind];
        return {over.wedge[e.place], over.along[e.place], e.mirrored ? -over.ends[e.place] : over.ends[e.place]};
    }

  private:
    struct Edge {
        double dx, dy, h;  // direction in the whitened plane, and signed distance
        int kind, place;   // of its integrals
        bool inside, mirrored;
    };
    struct Pending {
        int first_edge, edges, winding;
    };
    struct Integrals {  // of the edges of one kind
        std::vector<double> h, first, last, wedge, along, ends;  // longer than count
        size_t count = 0, done = 0;

        void grow();
    };
    bool with_slope = false;
    std::vector<Edge> edges;
    std::vector<Pending> masses;
    std::vector<double> exponents;
    size_t exponents_done = 0;
    Integrals integrals[EDGE_KINDS];
};

// Replaces the derivatives of a mass by those of its log.
inline void as_log(TruncatedMass& s) {
    const double inverse = 1 / s.value;
    s.gx *= inverse;
    s.gy *= inverse;
    s.xx = s.xx * inverse + s.gx * s.gx;
    s.xy = s.xy * inverse + s.gx * s.gy;
    s.yy = s.yy * inverse + s.gy * s.gy;
}

}  // namespace tanteo
