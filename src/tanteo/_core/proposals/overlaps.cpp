#include "proposals/overlaps.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numeric>

namespace tanteo {

namespace {

constexpr float FAR = -80.0f;      // log of a negligible overlap
constexpr float NOTHING = 1e-30f;  // least argument of a logarithm

// The two functions of the inner loop are plain arithmetic, so that compilers vectorize it.

inline float exp_below_zero(float x) {
    const float y = x * 1.44269504f;
    const int32_t whole = static_cast<int32_t>(y - 0.5f);
    const float f = y - static_cast<float>(whole);
    const float p =
        1.0f + f * (0.693147180f + f * (0.240226507f + f * (0.0555041087f + f * (0.00961812911f + f * 0.00133335581f))));
    const int32_t bits = (whole + 127) << 23;
    float scale;
    std::memcpy(&scale, &bits, sizeof scale);
    return p * scale;
}

inline float inverse_root(float x) {
    int32_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    bits = 0x5f3759df - (bits >> 1);
    float y;
    std::memcpy(&y, &bits, sizeof y);
    for (int k = 0; k < 3; ++k) y *= 1.5f - 0.5f * x * y * y;  // Newton
    return y;
}

float dot(const float* a, const float* b, size_t n) {
    float lane[8] = {0};
    size_t k = 0;
    for (; k + 8 <= n; k += 8)
        for (int i = 0; i < 8; ++i) lane[i] += a[k + i] * b[k + i];
    float sum = 0;
    for (; k < n; ++k) sum += a[k] * b[k];
    for (const float one : lane) sum += one;
    return sum;
}

void add(float* sums, const float* a, float factor, size_t n) {
    for (size_t k = 0; k < n; ++k) sums[k] += factor * a[k];
}

}  // namespace

Overlaps::Overlaps(const std::vector<int>& groups) : order(groups.size()), group(groups) {
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return groups[a] < groups[b]; });
}

double Overlaps::information(const double* weights, const double* means, const double* variances) {
    w.clear(), m.clear(), v.clear(), root.clear(), end.clear();
    double least = 1e300, middle = 0, total = 0;
    for (const int s : order)
        if (weights[s] > 0) {
            least = std::min(least, variances[s]);
            middle += weights[s] * means[s];
            total += weights[s];
        }
    if (!(total > 0)) return 0;
    middle /= total;
    const double scale = 1 / std::sqrt(least);
    int last = -1;
    size_t first = 0;
    for (const int s : order) {
        if (!(weights[s] > 0)) continue;
        if (group[s] != last) {
            std::fill(end.begin() + first, end.end(), w.size());
            last = group[s];
            first = w.size();
        }
        const double variance = variances[s] * scale * scale;
        w.push_back(static_cast<float>(weights[s]));
        m.push_back(static_cast<float>((means[s] - middle) * scale));
        v.push_back(static_cast<float>(variance));
        root.push_back(static_cast<float>(std::sqrt(std::sqrt(variance)) * std::sqrt(std::sqrt(2.0))));
        end.push_back(0);
    }
    const size_t n = w.size();
    std::fill(end.begin() + first, end.end(), n);
    all = w;
    own = w;
    pair.resize(n);
    for (size_t i = 0; i + 1 < n; ++i) {
        const float mi = m[i], vi = v[i], ri = root[i];
        const size_t rest = n - i - 1, same = end[i] - i - 1;
        const float *mj = &m[i + 1], *vj = &v[i + 1], *rj = &root[i + 1];
        float* k = pair.data();
        for (size_t j = 0; j < rest; ++j) {
            const float y = inverse_root(vj[j] + vi), gap = (mj[j] - mi) * y;
            k[j] = exp_below_zero(std::max(-0.25f * gap * gap, FAR)) * y * rj[j] * ri;
        }
        add(&all[i + 1], k, w[i], rest);
        add(&own[i + 1], k, w[i], same);
        all[i] += dot(k, &w[i + 1], rest);
        own[i] += dot(k, &w[i + 1], same);
    }
    double out = 0;
    for (size_t i = 0; i < n;) {
        double of_group = 0;
        for (size_t j = i; j < end[i]; ++j) of_group += w[j];
        for (const size_t stop = end[i]; i < stop; ++i)
            out += w[i] * std::log((std::max(own[i], NOTHING) / of_group) / (std::max(all[i], NOTHING) / total));
    }
    return out;
}

}  // namespace tanteo
