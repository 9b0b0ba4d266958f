#include "solve/sample.hpp"

#include <cmath>

#include "normal.hpp"

namespace tanteo {

constexpr double FAR = 25;  // standard deviations beyond which a component is negligible

Mixture::Mixture(std::vector<MixtureBase> bases_, std::vector<MixtureComponent> components_, double freedom_, const Vec3& centre_)
    : bases(std::move(bases_)), components(std::move(components_)), freedom(freedom_), centre(centre_) {
    const double log = std::lgamma(0.5 * (freedom + 6)) - std::lgamma(0.5 * freedom) - 3 * std::log(freedom * PI);
    reach_shift.assign(bases.size(), 0.0);
    reach_turn.assign(bases.size(), 0.0);
    for (const MixtureComponent& c : components) {
        weights.push_back(std::exp(c.log_weight + log));
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
        reach_shift[c.owner] = std::max(reach_shift[c.owner], FAR * FAR * shift);
        reach_turn[c.owner] = std::max(reach_turn[c.owner], FAR * FAR * turn);
    }
}

double Mixture::log_density(const Pose& pose, double* shares) const {
    double total = 0, from_base[6] = {0}, jacobian = 1;
    int last = -1;
    bool skip = false;
    for (int k = 0; k < owners(); ++k) shares[k] = 0;
    for (size_t k = 0; k < components.size(); ++k) {
        const MixtureComponent& c = components[k];
        if (c.owner != last) {
            last = c.owner;
            const auto& [base, straight, bend] = bases[c.owner];
            double turn = 0;  // 8 sin^2(angle / 2)
            for (int i = 0; i < 9; ++i) turn += (pose.R.m[i] - base.R.m[i]) * (pose.R.m[i] - base.R.m[i]);
            const Vec3 shift = (pose.R * centre + pose.t) - (base.R * centre + base.t);
            skip = squared(shift) > reach_shift[c.owner] || turn > 2 * reach_turn[c.owner];
            if (skip) continue;
            Vec3 v, w;
            difference(base, pose, centre, v, w);
            store(v, from_base);
            store(w, from_base + 3);
            const double angle = norm(w);  // density of turns in the tangent space relative to the invariant measure
            jacobian = angle < 1e-3 ? 1 : angle * angle / std::max(2 * (1 - std::cos(angle)), 1e-12);
            if (!straight) {
                double off[6] = {0};
                for (int i = 0; i < 6; ++i)
                    for (int a = 0; a < 6; ++a)
                        for (int b = 0; b < 6; ++b) off[i] += bend[36 * i + 6 * a + b] * from_base[a] * from_base[b];
                for (int i = 0; i < 6; ++i) from_base[i] -= off[i];
            }
        }
        if (skip) continue;
        double q = 0;
        for (int a = 0; a < 6; ++a) {
            double s = 0;
            for (int b = 0; b <= a; ++b) s += c.inverse[6 * a + b] * (from_base[b] - c.mean[b]);
            q += s * s;
        }
        const double density = weights[k] * std::exp(-0.5 * (freedom + 6) * std::log1p(q / freedom)) * jacobian;
        total += density;
        shares[c.owner] += density;
    }
    if (total > 0)
        for (int k = 0; k < owners(); ++k) shares[k] /= total;
    return std::log(total);
}

}  // namespace tanteo
