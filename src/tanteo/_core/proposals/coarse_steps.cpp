#include <algorithm>
#include <cmath>

#include "proposals/coarse.hpp"
#include "proposals/coarse_into.hpp"
#include "solve/maximize.hpp"

namespace tanteo {

namespace {

constexpr double ERROR = 0.2;      // error of a field, in steps of its grid
constexpr double TILT = 0.3;       // error of its gradient direction [rad]
constexpr float LEAST = 0.1f;      // least length of a gradient with a direction
constexpr int ROUNDS = 5;          // number of steps, from coarse to fine: after the first, a quarter continues
constexpr double TURN = 1.0 / 3;   // largest turn of a step [rad]

// Distances of a block's points in steps of the field, with gradients and positions.
struct FieldValues {
    float d[LANES], gx[LANES], gy[LANES], gz[LANES], x[LANES], y[LANES], z[LANES];
};

// Along one axis: distance beyond the field, the lower node, and the fraction of the step to the next.
struct Axis {
    float off[LANES], part[LANES];
    int node[LANES];
};

inline void along(const float* at, float top, Axis& out) {
    for (int l = 0; l < LANES; ++l) {
        const float inner = std::min(top, std::max(0.0f, at[l]));
        out.off[l] = at[l] - inner;
        out.node[l] = static_cast<int>(inner);
        out.part[l] = inner - out.node[l];
    }
}

inline void evaluate(const CoarseField& field, const CoarseInto& into, const CoarseBlock& b, FieldValues& out) {
    place(into, b, out.x, out.y, out.z);
    Axis X, Y, Z;
    along(out.x, field.shape[0] - 1.0001f, X);
    along(out.y, field.shape[1] - 1.0001f, Y);
    along(out.z, field.shape[2] - 1.0001f, Z);
    const int row = field.shape[2], plane = row * field.shape[1];
    float v[8][LANES];
    for (int l = 0; l < LANES; ++l) {
        const int8_t* g = field.levels + X.node[l] * plane + Y.node[l] * row + Z.node[l];
        v[0][l] = g[0], v[1][l] = g[1], v[2][l] = g[row], v[3][l] = g[row + 1];
        v[4][l] = g[plane], v[5][l] = g[plane + 1], v[6][l] = g[plane + row], v[7][l] = g[plane + row + 1];
    }
    const float unit = static_cast<float>(field.unit / field.step);
    for (int l = 0; l < LANES; ++l) {
        const float fx = X.part[l], fy = Y.part[l], fz = Z.part[l];
        const float z00 = v[1][l] - v[0][l], z01 = v[3][l] - v[2][l], z10 = v[5][l] - v[4][l], z11 = v[7][l] - v[6][l];
        const float a00 = v[0][l] + fz * z00, a01 = v[2][l] + fz * z01, a10 = v[4][l] + fz * z10, a11 = v[6][l] + fz * z11;
        const float b0 = a00 + fy * (a01 - a00), b1 = a10 + fy * (a11 - a10);
        const float far = std::sqrt(X.off[l] * X.off[l] + Y.off[l] * Y.off[l] + Z.off[l] * Z.off[l]);
        const float outside = far > 0 ? 1.0f : 0.0f, inside = (1 - outside) * unit, per = outside / (far + (1 - outside));
        out.d[l] = unit * (b0 + fx * (b1 - b0)) + far - b.radius[l];
        out.gx[l] = inside * (b1 - b0) + per * X.off[l];
        out.gy[l] = inside * ((a01 - a00) + fx * ((a11 - a10) - (a01 - a00))) + per * Y.off[l];
        const float z0 = z00 + fy * (z01 - z00), z1 = z10 + fy * (z11 - z10);
        out.gz[l] = inside * (z0 + fx * (z1 - z0)) + per * Z.off[l];
    }
}

struct Sums {
    float A[21][LANES] = {}, b[6][LANES] = {};
};

// Adds the cost of the normals of a block [nats].
void tilted(const CoarseView& view, const CoarseBlock& b, const FieldValues& values, float* cost) {
    for (int l = 0; l < LANES; ++l) {
        const Vec3 n = view.into * Vec3{b.nx[l], b.ny[l], b.nz[l]};
        const double size = std::sqrt(values.gx[l] * values.gx[l] + values.gy[l] * values.gy[l] + values.gz[l] * values.gz[l]);
        if (b.oriented[l] == 0 || size <= LEAST) continue;
        const double turn = 1 - (n.x * values.gx[l] + n.y * values.gy[l] + n.z * values.gz[l]) / size;
        cost[l] += static_cast<float>(turn / (TILT * TILT + b.tilt2[l]));
    }
}

// Adds a block to the normal equations of small motions of the points: shift u, and turn w about the centre.
inline void gather(const FieldValues& values, const float* weight, const float* centre, Sums& sums) {
    float J[6][LANES];
    for (int l = 0; l < LANES; ++l) {
        const float x = values.x[l] - centre[0], y = values.y[l] - centre[1], z = values.z[l] - centre[2];
        J[0][l] = values.gx[l], J[1][l] = values.gy[l], J[2][l] = values.gz[l];
        J[3][l] = y * values.gz[l] - z * values.gy[l];
        J[4][l] = z * values.gx[l] - x * values.gz[l];
        J[5][l] = x * values.gy[l] - y * values.gx[l];
    }
    for (int i = 0, at = 0; i < 6; ++i) {
        float w[LANES];
        for (int l = 0; l < LANES; ++l) w[l] = weight[l] * J[i][l];
        for (int l = 0; l < LANES; ++l) sums.b[i][l] -= w[l] * values.d[l];
        for (int k = 0; k <= i; ++k, ++at)
            for (int l = 0; l < LANES; ++l) sums.A[at][l] += w[l] * J[k][l];
    }
}

// Keeps the best, in order.
void only(CoarseRanked& found, int count) {
    const auto better = [](const auto& a, const auto& b) { return a.first < b.first; };
    std::stable_sort(found.begin(), found.end(), better);
    if (static_cast<int>(found.size()) > count) found.resize(count);
}

// Refinement on one part, with the points scaled to the steps of its field.
class Steps {
  public:
    Steps(const CoarsePart& part, const CoarsePoints& points, double most)
        : part(part), blocks(points.blocks), oriented(points.oriented), most(static_cast<float>(most)),
          reach(part.spacing / part.field.step) {
        const float per = static_cast<float>(1 / part.field.step);
        for (CoarseBlock& b : blocks)
            for (int l = 0; l < LANES; ++l) {
                b.radius[l] *= per;
                b.var[l] *= per * per;
            }
        const Vec3 c = (1 / part.field.step) * (part.centre - part.field.origin);
        centre[0] = static_cast<float>(c.x), centre[1] = static_cast<float>(c.y), centre[2] = static_cast<float>(c.z);
    }

    // Cost at a pose [nats] with an error of the field, and the normal equations if requested.
    double nats(const CoarseView& view, double sd, Sums* sums) const {
        float sum[LANES] = {};
        const CoarseInto into(part.field, view);
        for (const CoarseBlock& b : blocks) {
            FieldValues values;
            evaluate(part.field, into, b, values);
            float cost[LANES], per[LANES];
            for (int l = 0; l < LANES; ++l) {
                per[l] = b.weight[l] / (static_cast<float>(sd * sd) + b.var[l]);
                cost[l] = 0.5f * values.d[l] * values.d[l] * per[l];
            }
            if (oriented) tilted(view, b, values, cost);
            for (int l = 0; l < LANES; ++l) {
                sum[l] += std::min(cost[l], most);
                per[l] = cost[l] > 2 * most ? 0.0f : per[l] / (1 + cost[l] / most);
            }
            if (sums) gather(values, per, centre, *sums);
        }
        double all = 0;
        for (int l = 0; l < LANES; ++l) all += sum[l];
        return all;
    }

    // Refines a view by Gauss-Newton steps, one for each round from `first`; the error of the field is sd(round).
    template <class Error>
    void fit(CoarseView& view, int first, int count, const Error& sd) const {
        const auto equations = [&](int k) {
            Sums sums;
            nats(view, sd(first + k), &sums);
            NormalEquations<6> at;
            for (int i = 0, next = 0; i < 6; ++i) {
                for (int l = 0; l < LANES; ++l) at.gradient[i] += sums.b[i][l];
                for (int k = 0; k <= i; ++k, ++next)
                    for (int l = 0; l < LANES; ++l) at.information[6 * i + k] += sums.A[next][l];
            }
            at.add_weak_prior(reach, TURN);
            return at;
        };
        gauss_newton(count, equations, [&](const double* step, const double*) {
            const Mat3 R = rotation(load(step + 3));
            view = {R * view.into, R * (view.at - part.centre) + part.centre + part.field.step * load(step)};
        });
    }

  private:
    const CoarsePart& part;
    std::vector<CoarseBlock> blocks;
    bool oriented;
    float most, centre[3];
    double reach;
};

}  // namespace

std::vector<CoarsePose> coarse_poses(const CoarsePart& part, const CoarsePoints& points, CoarseRanked found,
                                     const CoarseEffort& effort) {
    const Steps steps(part, points, effort.most);
    const double begin = std::max(0.5 * part.spacing / part.field.step, ERROR);
    const auto sd_of = [&](int round) { return ERROR + (begin - ERROR) * (ROUNDS - 1 - round) / (ROUNDS - 1); };
    for (auto& [cost, view] : found) {
        steps.fit(view, 0, 1, sd_of);
        cost = steps.nats(view, sd_of(1), nullptr);
    }
    only(found, std::max(effort.stepped / 4, effort.keep));
    for (auto& [cost, view] : found) {
        steps.fit(view, 1, ROUNDS - 1, sd_of);
        cost = steps.nats(view, ERROR, nullptr);
    }
    only(found, effort.keep);
    std::vector<CoarsePose> out;
    for (const auto& [cost, view] : found) {
        const Mat3 R = transposed(view.into);
        out.push_back({{R, points.middle - R * view.at}, cost});
    }
    return out;
}

}  // namespace tanteo
