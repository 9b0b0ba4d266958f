#include "solve/sample.hpp"

#include <cmath>

#include "normal.hpp"

namespace tanteo {

constexpr double FAR = 25;          // standard deviations beyond which a component is negligible
constexpr double NEGLIGIBLE = 1e6;  // squared standard deviations at which it is 1e-27 of its peak

Mixture::Mixture(std::vector<MixtureComponent> components_, int owners_, double freedom_, const Vec3& centre_)
    : components(std::move(components_)), owners(owners_), freedom(freedom_), centre(centre_) {
    const double log = std::lgamma(0.5 * (freedom + 6)) - std::lgamma(0.5 * freedom) - 3 * std::log(freedom * PI);
    for (const MixtureComponent& c : components) {
        weights.push_back(std::exp(c.log_weight + log));
        middles.push_back(c.base.R * centre + c.base.t);
        // the scale matrix is L L' with L the inverse of c.inverse; its trace by columns of L
        double L[36] = {0}, shift = 0, turn = 0;
        for (int k = 0; k < 6; ++k)
            for (int i = k; i < 6; ++i) {
                double s = i == k;
                for (int j = k; j < i; ++j) s -= c.inverse[6 * i + j] * L[6 * j + k];
                L[6 * i + k] = s / c.inverse[7 * i];
                (i < 3 ? shift : turn) += L[6 * i + k] * L[6 * i + k];
            }
        for (int i = 0; i < 6; ++i) (i < 3 ? shift : turn) += c.mean[i] * c.mean[i];
        reach_shift.push_back(FAR * FAR * shift);
        reach_turn.push_back(FAR * FAR * turn);
    }
}

double Mixture::log_density(const Pose& pose, double* shares) const {
    double total = 0;
    const Vec3 middle = pose.R * centre + pose.t;
    for (int k = 0; k < owners; ++k) shares[k] = 0;
    for (size_t k = 0; k < components.size(); ++k) {
        const MixtureComponent& c = components[k];
        if (squared(middle - middles[k]) > reach_shift[k]) continue;
        double turn = 0;  // 8 sin^2(angle / 2)
        for (int i = 0; i < 9; ++i) turn += (pose.R.m[i] - c.base.R.m[i]) * (pose.R.m[i] - c.base.R.m[i]);
        if (turn > 2 * reach_turn[k]) continue;
        Vec3 v, w;
        difference(c.base, pose, centre, v, w);
        const double offset[6] = {v.x, v.y, v.z, w.x, w.y, w.z}, angle = norm(w);
        double x[6], q = 0;
        for (int i = 0; i < 6 && q < NEGLIGIBLE; ++i) {
            double s = offset[i] - c.mean[i];
            if (!c.bend.empty())
                for (int k = 0, at = 21 * i; k < 6; ++k)
                    for (int l = k; l < 6; ++l, ++at) s -= c.bend[at] * offset[k] * offset[l];
            x[i] = s;
            s = 0;
            for (int k = 0; k <= i; ++k) s += c.inverse[6 * i + k] * x[k];
            q += s * s;
        }
        if (q >= NEGLIGIBLE) continue;
        // density of turns in the tangent space relative to the invariant measure
        const double jacobian = angle < 1e-3 ? 1 : angle * angle / std::max(2 * (1 - std::cos(angle)), 1e-12);
        const double density = weights[k] * std::exp(-0.5 * (freedom + 6) * std::log1p(q / freedom)) * jacobian;
        total += density;
        shares[c.owner] += density;
    }
    if (total > 0)
        for (int k = 0; k < owners; ++k) shares[k] /= total;
    return std::log(total);
}

}  // namespace tanteo
