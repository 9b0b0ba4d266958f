// The pose at which a part's edges meet those of an image best.
#include <cmath>
#include <vector>

#include "image_frame.hpp"

namespace tanteo {

namespace {

// sin t / t, (1 - cos t) / t^2 and (t - sin t) / t^3, and the third of the inverse: (1 - a / (2 b)) / t^2
struct Terms {
    double a, b, c, inverse;
    explicit Terms(double t) {
        const double t2 = t * t;
        if (t < 1e-2) {
            a = 1 - t2 / 6 * (1 - t2 / 20 * (1 - t2 / 42));
            b = 0.5 - t2 / 24 * (1 - t2 / 30 * (1 - t2 / 56));
            c = 1.0 / 6 - t2 / 120 * (1 - t2 / 42 * (1 - t2 / 72));
            inverse = (1 + t2 / 60 * (1 + t2 / 42)) / 12;
        } else {
            const double half = std::sin(0.5 * t) / t;
            a = std::sin(t) / t;
            b = 2 * half * half;
            c = (t - std::sin(t)) / (t2 * t);
            inverse = (1 - a / (2 * b)) / t2;
        }
    }
};

Pose after(const Pose& T, const Vec3& v, const Vec3& w) {  // T exp([v, w])
    const Terms k(norm(w));
    const Vec3 wv = cross(w, v);
    return {T.R * rotation(w), T.R * (v + k.b * wv + k.c * cross(w, wv)) + T.t};
}

void twist(const Pose& from, const Pose& to, Vec3& v, Vec3& w) {  // log(from^-1 to)
    w = rotation_vector(transposed(from.R) * to.R);
    const Vec3 p = into_part(from, to.t), wp = cross(w, p);
    v = p - 0.5 * wp + Terms(norm(w)).inverse * cross(w, wp);
}

Pose about(const Pose& T, const Vec3& middle) { return {T.R, T.R * middle + T.t}; }

// Information (lower triangle) and gradient of the offsets under a redescending weight (Tukey 1960), for shifts by a
// length and turns by a radian.
struct Pull {
    double A[36] = {0}, g[6] = {0};
    void add(const EdgeMet& met, double length, double reach, const EdgeErrors& errors) {
        const double far = met.offset / (1.01 * reach), robust = (1 - far * far) * (1 - far * far);
        const double blur = 0.25 * reach, sd2 = met.sd * met.sd + errors.bias * errors.bias + blur * blur;
        const double w = robust * met.span / errors.correlation / sd2;
        double J[6];
        for (int i = 0; i < 6; ++i) J[i] = met.slope[i] * (i < 3 ? length : 1);
        for (int i = 0; i < 6; ++i) {
            for (int j = 0; j <= i; ++j) A[6 * i + j] += w * J[i] * J[j];
            g[i] += w * J[i] * met.offset;
        }
    }
    void add_prior(const double* prior, const double* off) {
        for (int i = 0; i < 6; ++i)
            for (int j = 0; j < 6; ++j) {
                A[6 * i + j] += prior[6 * i + j];
                g[i] -= prior[6 * i + j] * off[j];
            }
    }
    // The step is left in g; directions that nothing resists stay where they are.
    bool solve() {
        double trace = 0, size = 0;
        for (int i = 0; i < 6; ++i) trace += A[7 * i];
        for (int i = 0; i < 6; ++i) A[7 * i] += 1e-6 * trace + 1e-9;
        if (!cholesky(A, 6)) return false;
        solve_cholesky(A, 6, g);
        for (const double s : g) size += s * s;
        const double share = std::min(1.0, 0.3 / std::max(std::sqrt(size), 1e-12));
        for (double& s : g) s *= share;
        return true;
    }
};

}  // namespace

Pose refined(const EdgeFrame& frame, const Lens& lens, const EdgePoints& points, const Pose& pose, const Pose& start,
             const double* prior, const std::vector<Round>& rounds, const EdgeErrors& errors) {
    const size_t N = frame.size();
    const double length = frame.diagonal;
    const Pose held = about(start, frame.middle);
    Pose T = about(pose, frame.middle);
    std::vector<char> shown(N), rims(N);
    for (const Round& round : rounds) {
        if (round.asked) frame.see({T.R, T.t - T.R * frame.middle}, true, shown.data(), rims.data());
        Pull pull;
        for (size_t k = 0; k < N; ++k) {
            if (!shown[k]) continue;
            EdgeSample sample = frame.samples[k];
            sample.at = sample.at - frame.middle;
            const EdgeMet met = meet_edge(lens, points, sample, T, true, frame.diagonal, round.reach);
            if (met.point >= 0) pull.add(met, length, round.reach, errors);
        }
        Vec3 v, w;
        twist(held, T, v, w);
        const double off[6] = {v.x / length, v.y / length, v.z / length, w.x, w.y, w.z};
        pull.add_prior(prior, off);
        if (!pull.solve()) break;
        T = after(T, length * load(pull.g), load(pull.g + 3));
    }
    return {T.R, T.t - T.R * frame.middle};
}

}  // namespace tanteo
