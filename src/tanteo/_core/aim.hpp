// How the direction of a sensor, and a normal that it felt, weigh a surface.
#pragma once
#include <algorithm>

#include "likelihood.hpp"
#include "normal.hpp"

namespace tanteo {

constexpr double GRAZING = 0.02;     // least cosine of incidence: a beam along a face does not measure it
constexpr double LOOKS_AWAY = 1e-6;  // density of a beam that met a face from behind
constexpr double CLEARLY = 0.1;       // cosine from which a face looks away from a side that is about known: not beside it
constexpr double BEHIND = 2e-22;     // of a sensed normal that points into the part

// Density of a sensor that came along d, by the normal n of what it met.
inline double aimed(const Vec3& n, const Vec3& d) {
    const double cosine = -dot(n, d);
    return cosine > 0 ? std::max(cosine, GRAZING) : LOOKS_AWAY;
}

// Density of a point on a surface of that normal (part), beside what its distance says: by the direction d of the sensor,
// or even by area, on the side that is known.
inline double met(const Point& point, const Vec3& n, const Vec3& d, double per_area) {
    if (point.directed) return aimed(n, d);
    return point.sided && dot(n, d) > CLEARLY ? LOOKS_AWAY * per_area : per_area;
}

// Density of a sensed normal m about that of the surface, n, by its tilts to e[0] and e[1]: as uncertain as the sensor
// is, and as the surface turns, by its bends, where the point may be.
inline double tilt_density(const Vec3* e, const double* bend, const Vec3& n, const Mat3& C, const Vec3& m,
                           double normal_variance, Hit& hit) {
    hit.along = dot(n, m);
    hit.tilted = 1;
    double log = -2 * HALF_LOG_TWO_PI;
    for (int i = 0; i < 2; ++i) {
        hit.e[i] = e[i];
        hit.bend[i] = bend[i];
        double variance = normal_variance;
        if (bend[i] != 0) variance += bend[i] * bend[i] * dot(e[i], C * e[i]);
        hit.per_tilt[i] = 1 / std::sqrt(variance);
        hit.tilt[i] = dot(e[i], m) * hit.per_tilt[i];
        log -= 0.5 * hit.tilt[i] * hit.tilt[i];
    }
    const double density = hit.per_tilt[0] * hit.per_tilt[1] * fast_exp(log);
    return hit.along > 0 ? density : BEHIND * density;
}

}  // namespace tanteo
