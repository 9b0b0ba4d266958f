// The normal distribution in one and two dimensions, and its mass in wedges, from which that of a polygon follows.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>

namespace tanteo {

constexpr double PI = 3.14159265358979323846;
constexpr double HALF_LOG_TWO_PI = 0.91893853320467274178;

// exp to 1e-15, without a branch, so that loops over it are vectorised; arguments below -708 give 0.
inline double fast_exp(double x) {
    x = x < -708 ? -708 : (x > 708 ? 708 : x);
    const double magic = 6755399441055744.0;  // 1.5 * 2^52: the sum's last bits are the rounded number
    const double shifted = x * 1.4426950408889634074 + magic, k = shifted - magic;
    const double r = (x - k * 6.93145751953125e-1) - k * 1.42860682030941723212e-6;
    double p = 1.0 / 479001600;
    p = p * r + 1.0 / 39916800;
    p = p * r + 1.0 / 3628800;
    p = p * r + 1.0 / 362880;
    p = p * r + 1.0 / 40320;
    p = p * r + 1.0 / 5040;
    p = p * r + 1.0 / 720;
    p = p * r + 1.0 / 120;
    p = p * r + 1.0 / 24;
    p = p * r + 1.0 / 6;
    p = p * r + 0.5;
    p = p * r + 1;
    p = p * r + 1;
    uint64_t bits;
    std::memcpy(&bits, &shifted, 8);
    bits = (bits + 1023) << 52;
    double scale;
    std::memcpy(&scale, &bits, 8);
    return p * scale;
}

inline double normal_density(double x) { return 0.39894228040143267794 * fast_exp(-0.5 * x * x); }
inline double normal_below(double x) { return 0.5 * std::erfc(-x * 0.70710678118654752440); }

// Owen's T for h >= 0 and 0 <= a <= 1: Gauss-Legendre, 10 nodes, error below 1e-11.
inline double owen_small(double h, double a) {
    static const double x[10] = {0.013046735741414139961, 0.067468316655507744634, 0.160295215850487796883,
                                 0.283302302935376404600, 0.425562830509184394558, 0.574437169490815605442,
                                 0.716697697064623595400, 0.839704784149512203117, 0.932531683344492255366,
                                 0.986953264258585860039};
    static const double w[10] = {0.033335672154344068796, 0.074725674575290296572, 0.109543181257991021998,
                                 0.134633359654998177545, 0.147762112357376435086, 0.147762112357376435086,
                                 0.134633359654998177545, 0.109543181257991021998, 0.074725674575290296572,
                                 0.033335672154344068796};
    double e[10], sum = 0;
    const double c = -0.5 * h * h;
    for (int k = 0; k < 10; ++k) e[k] = 1 + (a * x[k]) * (a * x[k]);
    for (int k = 0; k < 10; ++k) sum += w[k] * fast_exp(c * e[k]) / e[k];
    return a * sum * 0.15915494309189533577;
}

// The probability of the wedge at the origin between a line at distance h >= 0 from its foot on, and the ray to the
// point t along it (Owen's T of h and t / h), odd in t.
inline double wedge(double h, double t) {
    const double at = std::fabs(t);
    double T;
    if (at <= h) {
        T = h > 0 ? owen_small(h, at / h) : 0.0;
    } else {
        const double p = normal_below(h), q = normal_below(at);
        T = 0.5 * (p + q) - p * q - owen_small(at, h / at);
    }
    return t < 0 ? -T : T;
}

// Integrals over an edge at the distance h >= 0, from t1 to t2 along its line.
struct EdgeIntegrals {
    double wedge;  // probability of the wedge between the edge and infinity, at the origin
    double along;  // integral of the density along the edge
};

// Gauss-Legendre with N nodes x and weights w on the unit interval.
template <int N>
inline EdgeIntegrals integrate_edge(double h, double t1, double length, const double (&x)[N], const double (&w)[N]) {
    double s[N], e[N], wedge = 0, along = 0;
    for (int k = 0; k < N; ++k) {
        const double t = t1 + length * x[k];
        s[k] = h * h + t * t;
        e[k] = w[k] * fast_exp(-0.5 * s[k]);
    }
    for (int k = 0; k < N; ++k) wedge += e[k] / s[k], along += e[k];
    const double per = length * 0.15915494309189533577;
    return {h * per * wedge, per * along};
}

constexpr double ENDLESS = 5;  // standard deviations along its line beyond which an edge has no end; the error is below 4e-7

// A short edge needs few nodes: the error is below 1e-10 with 4 nodes, and below 2e-11 with 8.
inline EdgeIntegrals edge_integrals(double h, double t1, double t2, bool with_along) {
    static const double x4[4] = {0.06943184420297371239, 0.33000947820757186760, 0.66999052179242813240,
                                 0.93056815579702628761};
    static const double w4[4] = {0.17392742256872692869, 0.32607257743127307131, 0.32607257743127307131,
                                 0.17392742256872692869};
    static const double x8[8] = {0.01985507175123188416, 0.10166676129318663020, 0.23723379504183550709,
                                 0.40828267875217509753, 0.59171732124782490247, 0.76276620495816449291,
                                 0.89833323870681336980, 0.98014492824876811584};
    static const double w8[8] = {0.05061426814518812958, 0.11119051722668723528, 0.15685332293894364367,
                                 0.18134189168918099148, 0.18134189168918099148, 0.15685332293894364367,
                                 0.11119051722668723528, 0.05061426814518812958};
    const double length = t2 - t1;
    if (length < 0.5 && length < 0.3 * h) return integrate_edge(h, t1, length, x4, w4);
    if (length < h) return integrate_edge(h, t1, length, x8, w8);
    const double endless = t1 < -ENDLESS || t2 > ENDLESS ? 0.5 * normal_below(-h) : 0;
    const double first = t1 < -ENDLESS ? -endless : wedge(h, t1), last = t2 > ENDLESS ? endless : wedge(h, t2);
    if (!with_along) return {last - first, 0};
    const double below_first = t1 < -ENDLESS ? 0 : normal_below(t1), below_last = t2 > ENDLESS ? 1 : normal_below(t2);
    return {last - first, normal_density(h) * (below_last - below_first)};
}

}  // namespace tanteo
