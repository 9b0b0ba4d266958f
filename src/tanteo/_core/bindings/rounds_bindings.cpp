// Bindings of the fit of round features to points, in batches, and of distances from a feature.
#include <nanobind/stl/vector.h>

#include "bindings/conversion.hpp"
#include "parallel.hpp"
#include "solve/rounds.hpp"

namespace tanteo {

using namespace nb::literals;

namespace {

using Numbers = std::vector<int>;

RoundKind kind_of(int number, const char* name) {
    return static_cast<RoundKind>(static_cast<int>(expect(number, name, 0, 3)));
}

Mat3 matrix(const double* p) {
    Mat3 out;
    std::copy(p, p + 9, out.m);
    return out;
}

// Arrays of a batch; an array without data is empty.
struct RoundBatch {
    Doubles points, covs, normals, normal_sds, outward;
    RoundTask all;  // data that all fits share

    RoundTask task(size_t b, Vec3& mean) const {
        RoundTask out = all;
        const size_t n = points.shape(1), first = b * n;
        mean = {};
        for (size_t i = 0; i < n; ++i) mean += (1.0 / n) * load(points.data() + 3 * (first + i));
        for (size_t i = 0; i < n; ++i) {  // about their mean, so that no digits are lost far from the world's origin
            const size_t row = first + i;
            out.points.push_back(load(points.data() + 3 * row) - mean);
            out.covs.push_back(matrix(covs.data() + 9 * row));
            if (normals.size()) {
                const double sd = normal_sds.data()[row];
                out.normals.push_back(load(normals.data() + 3 * row));
                out.normal_sds.push_back(sd > 0 ? sd : INFINITY);
            }
            if (outward.size()) out.outward.push_back(load(outward.data() + 3 * row));
        }
        out.frame_origin = out.frame_origin - mean;
        return out;
    }
};

// Results of a batch.
struct RoundOut {
    size_t n, k, m;  // m: rows of the frame, and one for the size
    std::vector<double> Ts, sizes, P, gains, frame_gains, residuals, standardised, chi2, rivals, conditions;
    std::vector<int32_t> converged;

    RoundOut(size_t B, size_t n_, size_t k_, size_t m_)
        : n(n_), k(k_), m(m_), Ts(16 * B), sizes(B), P(B * m * m), gains(B * n * m * 3),
          frame_gains(B * m * (m - 1)), residuals(B * n * k), standardised(B * n), chi2(B), rivals(B), conditions(B), converged(B) {}

    void put(size_t b, const RoundTask& task, const RoundFit& fit, const Vec3& mean) {
        store_pose({fit.state.R, fit.state.c + mean}, &Ts[16 * b]);
        sizes[b] = fit.state.s;
        chi2[b] = fit.at.chi2;
        rivals[b] = fit.rival;
        conditions[b] = fit.condition;
        converged[b] = fit.converged;
        std::copy(fit.at.e.begin(), fit.at.e.end(), &residuals[b * n * k]);
        put_covariance(b, task, fit);
        put_frame(b, task, fit);
        for (size_t i = 0; i < n; ++i) put_point(b, i, task, fit);
    }

    // Covariance without the contribution of the shared errors.
    void put_covariance(size_t b, const RoundTask& task, const RoundFit& fit) {
        const size_t M = fit.at.M, own = M - task.shared;
        for (size_t i = 0; i < own; ++i)
            for (size_t j = 0; j < own; ++j) {
                double value = fit.whole[i * M + j];
                for (size_t d = own; d < M; ++d) value -= fit.whole[i * M + d] * fit.whole[d * M + j];
                P[(b * m + i) * m + j] = value;
            }
    }

    // Derivative of the feature by an error of the known frame.
    void put_frame(size_t b, const RoundTask& task, const RoundFit& fit) {
        const size_t M = fit.at.M, D = task.shared, own = M - D, rows = m - 1;
        if (!task.framed) return;
        for (size_t u = 0; u < own; ++u)
            for (size_t a = 0; a < rows; ++a) {
                double moved = fit.whole[u * M + a];
                for (size_t d = 0; d < D; ++d) moved -= fit.whole[u * M + own + d] * task.frame_jacobian[a * D + d];
                for (size_t c = 0; c < rows; ++c)
                    frame_gains[(b * m + u) * rows + c] += moved * task.frame_information[a * rows + c];
            }
    }

    // Derivative of the feature by a point, and the residual of the point in standard deviations.
    void put_point(size_t b, size_t i, const RoundTask& task, const RoundFit& fit) {
        const size_t M = fit.at.M, own = M - task.shared;
        const double *h = &fit.at.h[4 * i * M], *W = &fit.at.W[16 * i];
        for (size_t a = 0; a < 4; ++a)
            for (size_t c = 0; c < 4; ++c) {
                if (W[4 * a + c] == 0) continue;
                for (size_t u = 0; u < own; ++u) {
                    double moved = 0;
                    for (size_t v = 0; v < M; ++v) moved -= fit.whole[u * M + v] * h[a * M + v];
                    const Vec3 g = (moved * W[4 * a + c]) * fit.at.G[4 * i + c];
                    for (int x = 0; x < 3; ++x) gains[((b * n + i) * m + u) * 3 + x] += g[x];
                }
            }
        const bool normal = !task.normals.empty() && std::isfinite(task.normal_sds[i]);
        const double count = static_cast<double>(k) + 2 * normal;
        double taken = 0;  // degrees of freedom
        for (size_t a = 0; a < 4; ++a)
            for (size_t c = 0; c < 4; ++c) {
                const double w = W[4 * a + c];
                if (w == 0) continue;
                for (size_t u = 0; u < M; ++u)
                    for (size_t v = 0; v < M; ++v) taken += w * h[a * M + u] * fit.whole[u * M + v] * h[c * M + v];
            }
        standardised[b * n + i] = std::sqrt(count * fit.at.each[i] / std::max(count - taken, 1e-9));
    }
};

void read_frame(const Doubles& frame, const Doubles& information, const Doubles& jacobian, RoundTask& task) {
    if (!frame.size()) return;
    const size_t m = task.rows.size();
    expect(frame, "frame", {4, 4});
    const Pose pose = load_pose(frame.data());
    task.framed = true;
    task.frame_turn = pose.R;
    task.frame_origin = pose.t;
    task.frame_information = doubles(information, "frame_information", {m, m});
    task.frame_jacobian = doubles(jacobian, "frame_jacobian", {m, static_cast<size_t>(task.shared)});
}

nb::tuple fit_rounds(int kind, int surface, Ints rows, Doubles points, Doubles covs, Doubles normals, Doubles normal_sds, Doubles outward, int side, Doubles shared_jacobian, double size, double size_sd, Doubles frame, Doubles frame_information, Doubles frame_jacobian, double limit) {
    const size_t n = points.ndim() == 3 ? points.shape(1) : 0, B = expect(points, "points", {ANY, n, 3});
    if (!n) refuse("points", "expected one or more for each fit");
    expect(covs, "covs", {B, n, 3, 3});
    if (normals.size()) expect(normals, "normals", {B, n, 3});
    expect(normal_sds, "normal_sds", {normals.size() ? B : 0, n});
    if (outward.size()) expect(outward, "outward", {B, n, 3});
    RoundBatch batch{points, covs, normals, normal_sds, outward, {}};
    RoundTask& all = batch.all;
    all.kind = kind_of(kind, "kind");
    all.surface = kind_of(surface, "surface");
    all.rows = expect(rows, "rows", ANY, 0, 5);
    all.side = static_cast<int>(expect(side, "side", -1, 1));
    const size_t D = shared_jacobian.ndim() == 3 ? shared_jacobian.shape(2) : 0;
    all.shared = static_cast<int>(D);
    all.shared_jacobian = doubles(shared_jacobian, "shared_jacobian", {n, 3, D});
    all.sized = expect(size, "size", 0, 1e300) > 0;
    all.size = size;
    all.size_sd = expect(size_sd, "size_sd", 0, 1e300);
    all.limit = expect(limit, "limit", 0, 1e300);
    read_frame(frame, frame_information, frame_jacobian, all);
    const size_t k = all.surface == RoundKind::CIRCLE ? 2 : 1, m = all.rows.size() + 1;
    RoundOut out(B, n, k, m);
    {
        nb::gil_scoped_release release;
        for_all(B, [&] {
            return [&](size_t b) {
                Vec3 mean;
                const RoundTask task = batch.task(b, mean);
                out.put(b, task, fit_round(task), mean);
            };
        });
    }
    return nb::make_tuple(
        array_of(std::move(out.Ts), {B, 4, 4}), array_of(std::move(out.sizes), {B}), array_of(std::move(out.P), {B, m, m}),
        array_of(std::move(out.gains), {B, n, m, 3}), array_of(std::move(out.frame_gains), {B, m, m - 1}),
        array_of(std::move(out.residuals), {B, n, k}), array_of(std::move(out.standardised), {B, n}),
        array_of(std::move(out.chi2), {B}), array_of(std::move(out.rivals), {B}), array_of(std::move(out.converged), {B}),
        array_of(std::move(out.conditions), {B}));
}

// Signed distances of points from a round feature in its frame (n, k), and their derivatives by point and size.
nb::tuple round_distances(int surface, Doubles points, double size) {
    const RoundKind kind = kind_of(surface, "surface");
    const std::vector<Vec3> at = vectors(points, "points");
    expect(size, "size", 1e-300, 1e300);
    const size_t n = at.size(), k = kind == RoundKind::CIRCLE ? 2 : 1;
    std::vector<double> F(n * k), G(3 * n * k), by_size(n * k);
    for (size_t i = 0; i < n; ++i) {
        const RoundDistance d = round_distance(kind, at[i], size);
        for (size_t a = 0; a < k; ++a) {
            F[i * k + a] = d.F[a];
            by_size[i * k + a] = d.by_size[a];
            store(d.G[a], &G[3 * (i * k + a)]);
        }
    }
    return nb::make_tuple(array_of(std::move(F), {n, k}), array_of(std::move(G), {n, k, 3}), array_of(std::move(by_size), {n, k}));
}

// Centre of the algebraic circle of points, projected along z of a rotation.
Out centre_of(Doubles points, Doubles rotation) {
    expect(rotation, "rotation", {3, 3});
    const Vec3 c = circle_centre(vectors(points, "points"), matrix(rotation.data()));
    return array_of(std::vector<double>{c.x, c.y, c.z}, {3});
}

}  // namespace

void offer_rounds(nb::module_& m) {
    m.def("fit_rounds", &fit_rounds, "kind"_a, "surface"_a, "rows"_a, "points"_a, "covs"_a, "normals"_a, "normal_sds"_a,
          "outward"_a, "side"_a, "shared_jacobian"_a, "size"_a, "size_sd"_a, "frame"_a, "frame_information"_a,
          "frame_jacobian"_a, "limit"_a);
    m.def("round_distances", &round_distances, "surface"_a, "points"_a, "size"_a);
    m.def("circle_centre", &centre_of, "points"_a, "rotation"_a);
}

}  // namespace tanteo
