// Refinement of a pose so that a part's edges match those of an image.
#include <cmath>
#include <vector>

#include "image/image_frame.hpp"
#include "solve/maximize.hpp"

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

// Adds one residual of an edge with a redescending weight (Tukey 1960); shifts in units of a length, turns in radians.
void add_edge(NormalEquations<6>& at, const EdgeMatch& match, double length, double reach, const EdgeErrors& errors) {
    const double far = match.offset / (1.01 * reach), robust = (1 - far * far) * (1 - far * far);
    const double blur = 0.25 * reach, sd2 = match.sd * match.sd + errors.bias * errors.bias + blur * blur;
    double J[6];
    for (int i = 0; i < 6; ++i) J[i] = match.slope[i] * (i < 3 ? length : 1);
    at.add(J, -match.offset, robust * match.span / errors.correlation / sd2);
}

}  // namespace

Pose refined(const EdgeFrame& frame, const Lens& lens, const EdgePoints& points, const Pose& pose, const Pose& start,
             const double* prior, const std::vector<Round>& rounds, const EdgeErrors& errors) {
    const size_t N = frame.size();
    const double length = frame.diagonal;
    const Pose prior_mean = about(start, frame.middle);
    Pose T = about(pose, frame.middle);
    std::shared_ptr<const EdgeView> view;
    const auto equations = [&](int k) {
        const Round& round = rounds[k];
        if (round.visibility || !view) view = frame.view_from(into_part({T.R, T.t - T.R * frame.middle}, {}));
        NormalEquations<6> at;
        for (size_t s = 0; s < N; ++s) {
            if (!view->shown[s]) continue;
            EdgeSample sample = frame.samples[s];
            sample.at = sample.at - frame.middle;
            const EdgeMatch match = match_edge(lens, points, sample, T, true, frame.diagonal, round.reach);
            if (match.point >= 0) add_edge(at, match, length, round.reach, errors);
        }
        Vec3 v, w;
        twist(prior_mean, T, v, w);
        const double off[6] = {v.x / length, v.y / length, v.z / length, w.x, w.y, w.z};
        for (int i = 0; i < 6; ++i)
            for (int j = 0; j < 6; ++j) {
                at.information[6 * i + j] += prior[6 * i + j];
                at.gradient[i] -= prior[6 * i + j] * off[j];
            }
        double trace = 0;  // keeps unconstrained directions fixed
        for (int i = 0; i < 6; ++i) trace += at.information[7 * i];
        for (int i = 0; i < 6; ++i) at.information[7 * i] += 1e-6 * trace + 1e-9;
        return at;
    };
    gauss_newton(static_cast<int>(rounds.size()), equations, [&](const double* step, const double*) {
        const Vec3 v = load(step), w = load(step + 3);
        const double share = std::min(1.0, 0.3 / std::max(std::sqrt(squared(v) + squared(w)), 1e-12));
        T = after(T, length * share * v, share * w);
    });
    return {T.R, T.t - T.R * frame.middle};
}

}  // namespace tanteo
