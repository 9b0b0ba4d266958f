// A shared error that acts on one side only, such as stock: its amount is a smooth function of a standard normal state.
#pragma once
#include <algorithm>
#include <cmath>

#include "normal.hpp"

namespace tanteo {

// The amount over its scale is h(u) = Phi(u) up to u = 1 and its tangent above: even from none to Phi(1), normal above, so
// that an amount of one scale is exceeded with a probability of 0.05. Mean and standard deviation of h are those of
// ONE_SIDED in sensors/error_states.py.
constexpr double ONE_SIDED_MEAN = 0.5075741599817282, ONE_SIDED_SD = 0.3025337999776922;
constexpr double KNEE = 1, AT_KNEE = 0.8413447460685429, RATE_AT_KNEE = 0.24197072451914337;

struct Effect {
    double value = 0, slope = 1;  // the standardized amount (h - mean) / sd, and its derivative by the state
};

inline Effect one_sided(double u) {
    const bool above = u > KNEE;
    const double h = above ? AT_KNEE + RATE_AT_KNEE * (u - KNEE) : 0.5 * std::erfc(-u / std::sqrt(2.0));
    const double rate = above ? RATE_AT_KNEE : std::exp(-0.5 * u * u) / std::sqrt(2 * PI);
    return {(h - ONE_SIDED_MEAN) / ONE_SIDED_SD, rate / ONE_SIDED_SD};
}

// The state after a step that is linear in the amount: readings are linear in it, so one step fits them. A step beyond none
// is linear in the state.
inline double stepped_amount(double u, double step) {
    constexpr double LEAST = 1e-6;  // least amount over its scale that such a step reaches
    const Effect from = one_sided(u);
    const double h = ONE_SIDED_MEAN + ONE_SIDED_SD * (from.value + from.slope * step);
    if (!(h > LEAST)) return u + step;
    if (h >= AT_KNEE) return KNEE + (h - AT_KNEE) / RATE_AT_KNEE;
    double at = std::min(u, KNEE);  // Newton's method for log Phi(at) = log h, which is concave: monotone after one step
    for (int k = 0; k < 6; ++k) {
        const double below = 0.5 * std::erfc(-at / std::sqrt(2.0)), rate = std::exp(-0.5 * at * at) / std::sqrt(2 * PI);
        at += std::log(h / below) * below / rate;
    }
    return at;
}

}  // namespace tanteo
