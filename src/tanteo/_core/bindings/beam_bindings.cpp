// Bindings of beams: their hits on a part at many poses, with the variance of the ranges.
#include <nanobind/stl/tuple.h>

#include <limits>

#include "shape/bundle.hpp"
#include "bindings/conversion.hpp"

namespace tanteo {

namespace {

using namespace nb::literals;

constexpr double GRAZING = 1e-3;  // least cosine of incidence by which derivatives are divided

// Derivative of the range by the pose, part frame, for a ray that hits a plane with normal n at x.
void derivative(const Vec3& x, const Vec3& n, double cosine, double* out) {
    const double per = -1 / std::max(cosine, GRAZING);
    store(per * n, out);
    store(per * cross(x, n), out + 3);
}

// Casts beams from C origins, each with one direction or one for every pose, at S poses. Returns (C, S): ranges, infinite
// for a miss; cosines of incidence; faces, -1 for a miss; and derivatives of the ranges by the pose (C, S, 6).
nb::tuple beams(const Shape& shape, Doubles Ts, Doubles origins, Doubles directions) {
    const std::vector<Pose> at = poses(Ts);
    const std::vector<Vec3> from = vectors(origins, "origins");
    const size_t S = at.size(), C = from.size(), each = directions.ndim() == 3 ? directions.shape(1) : 1;
    if (each != 1 && each != S) refuse("directions", "expected one for each beam, or one for each beam and pose");
    expect(directions, "directions", {C, each, 3});
    std::vector<double> ranges(C * S, std::numeric_limits<double>::infinity()), cosines(C * S), derivatives(6 * C * S);
    std::vector<int32_t> faces(C * S, -1);
    {
        nb::gil_scoped_release release;
        for (size_t c = 0; c < C; ++c) {
            Bundle bundle(shape);
            for (size_t s = 0; s < S; ++s) {
                const Vec3 start = transposed_times(at[s].R, from[c] - at[s].t);
                const Vec3 along = transposed_times(at[s].R, load(directions.data() + 3 * (c * each + (each > 1 ? s : 0))));
                int triangle;
                const double range = bundle.cast(start, along, &triangle);
                if (triangle < 0) continue;
                const size_t row = c * S + s;
                const Vec3& n = shape.normals[triangle];
                ranges[row] = range;
                cosines[row] = std::fabs(dot(n, along));
                faces[row] = shape.faces[triangle];
                derivative(start + range * along, n, cosines[row], &derivatives[6 * row]);
            }
        }
    }
    return nb::make_tuple(array_of(std::move(ranges), {C, S}), array_of(std::move(cosines), {C, S}),
                          array_of(std::move(faces), {C, S}), array_of(std::move(derivatives), {C, S, 6}));
}

double variance(const double* g, const double* A) {  // A is symmetric
    double sum = 0;
    for (int i = 0; i < 6; ++i) {
        double row = 0.5 * A[7 * i] * g[i];
        for (int j = i + 1; j < 6; ++j) row += A[6 * i + j] * g[j];
        sum += 2 * g[i] * row;
    }
    return sum;
}

// Variances of ranges (K, C, S) from derivatives (C, S, 6) and K symmetric covariances of the pose of every sample
// (K, S, 6, 6).
Out spreads(Doubles derivatives, Doubles covariances) {
    const size_t S = derivatives.ndim() == 3 ? derivatives.shape(1) : 0, C = expect(derivatives, "derivatives", {ANY, S, 6});
    const size_t K = expect(covariances, "covariances", {ANY, S, 6, 6});
    std::vector<double> out(K * C * S);
    {
        nb::gil_scoped_release release;
        for (size_t k = 0; k < K; ++k)
            for (size_t c = 0; c < C; ++c)
                for (size_t s = 0; s < S; ++s) {
                    const double* g = derivatives.data() + 6 * (c * S + s);
                    if (g[0] == 0 && g[1] == 0 && g[2] == 0) continue;  // no hit
                    out[(k * C + c) * S + s] = variance(g, covariances.data() + 36 * (k * S + s));
                }
    }
    return array_of(std::move(out), {K, C, S});
}

}  // namespace

void offer_beams(nb::module_& m) {
    m.def("beams", &beams, "shape"_a, "poses"_a, "origins"_a, "directions"_a);
    m.def("spreads", &spreads, "derivatives"_a, "covariances"_a);
}

}  // namespace tanteo
