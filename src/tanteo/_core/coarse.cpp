#include "coarse.hpp"

#include <algorithm>
#include <cmath>

namespace tanteo {

namespace {

constexpr double PI = 3.14159265358979323846;
constexpr int ROUNDS = 7;          // of refinement, from coarse to fine
constexpr double CLEAR = 0.3;      // of both normals across a line, together, from which they say how it is turned

struct Axes {  // a line and two directions across it
    Vec3 e, y, z;
    explicit Axes(const Vec3& along) : e(along), y(any_across(along)), z(cross(along, y)) {}
};

Mat3 attitude(const Axes& world, const Axes& part, double c, double s) {
    Mat3 R;
    const Vec3 y = c * part.y + s * part.z, z = -s * part.y + c * part.z;
    add_outer(R, 1, world.e, part.e);
    add_outer(R, 1, world.y, y);
    add_outer(R, 1, world.z, z);
    return R;
}

// Nats of points at a pose, roughly; stops beyond the limit.
double rough(const CoarsePart& part, const std::vector<CoarsePoint>& points, const Pose& pose, double per, double most,
             double limit) {
    double sum = 0;
    for (const CoarsePoint& point : points) {
        const double d = part.field.nearest(into_part(pose, point.at)) - point.radius;
        sum += std::min(d * d * per, most);
        if (sum > limit) break;
    }
    return sum;
}

struct Step {
    double A[36] = {}, b[6] = {};
};

// Nats of points at a pose, and what Gauss and Newton make of them where a step is asked for.
double nats(const CoarsePart& part, const std::vector<CoarsePoint>& points, const Pose& pose, double sd, double tilt,
            double most, Step* step) {
    double sum = 0;
    for (const CoarsePoint& point : points) {
        Vec3 g;
        const Vec3 p = into_part(pose, point.at);
        const double d = part.field.linear(p, g) - point.radius, per = 1 / (sd * sd + point.sd * point.sd), size = norm(g);
        double cost = 0.5 * d * d * per;
        if (point.oriented && size > 0.1) {
            const double turn = 1 - dot(transposed_times(pose.R, point.normal), g) / size;
            cost += turn / (tilt * tilt + point.tilt * point.tilt);
        }
        sum += std::min(cost, most);
        if (!step || cost > 2 * most) continue;
        const double weight = per / (1 + cost / most);
        // the point stays, the part moves: d changes by -g (v + w x (p - c))
        const Vec3 turned = cross(p - part.centre, g);
        const double J[6] = {-g.x, -g.y, -g.z, -turned.x, -turned.y, -turned.z};
        for (int i = 0; i < 6; ++i) {
            step->b[i] -= weight * J[i] * d;
            for (int k = 0; k <= i; ++k) step->A[6 * i + k] += weight * J[i] * J[k];
        }
    }
    return sum;
}

CoarsePose refined(const CoarsePart& part, const std::vector<CoarsePoint>& points, Pose pose, const CoarseEffort& effort) {
    const double end = effort.error * part.field.step, begin = std::max(0.5 * part.spacing, end), reach = part.spacing;
    for (int round = 0; round < ROUNDS; ++round) {
        const double sd = end + (begin - end) * (ROUNDS - 1 - round) / (ROUNDS - 1);
        Step step;
        nats(part, points, pose, sd, effort.tilt, effort.most, &step);
        const double size = 3 * reach;
        for (int i = 0; i < 3; ++i) step.A[7 * i] += 1 / (reach * reach);
        for (int i = 3; i < 6; ++i) step.A[7 * i] += size * size / (reach * reach);
        if (!cholesky(step.A, 6)) break;
        solve_cholesky(step.A, 6, step.b);
        pose = moved(pose, {step.b[0], step.b[1], step.b[2]}, {step.b[3], step.b[4], step.b[5]}, part.centre);
    }
    return {pose, nats(part, points, pose, end, effort.tilt, effort.most, nullptr)};
}

// The spin that turns two normals of places best to those of points; false where they say little.
bool spin_of(const Axes& world, const Axes& there, const CoarsePoint& P, const CoarsePoint& Q, const CoarsePlace& a,
             const CoarsePlace& b, double& angle) {
    double c = 0, s = 0;
    for (int w = 0; w < 2; ++w) {
        const Vec3 &m = w ? Q.normal : P.normal, &g = w ? b.normal : a.normal;
        const double my = dot(m, world.y), mz = dot(m, world.z), gy = dot(g, there.y), gz = dot(g, there.z);
        c += my * gy + mz * gz;
        s += my * gz - mz * gy;
    }
    angle = std::atan2(s, c);
    return std::hypot(c, s) > CLEAR;
}

// Best pose of each first place, over all pairs of points.
class Search {
  public:
    Search(const CoarsePart& part, const std::vector<CoarsePoint>& points, const CoarseEffort& effort)
        : part(part), points(points), effort(effort), best(part.count),
          per(0.5 / (0.25 * part.spacing * part.spacing + 0.1 * part.field.step * part.field.step)) {}

    void pair(const CoarsePoint& P, const CoarsePoint& Q) {
        const double gap = norm(Q.at - P.at);
        if (!(gap > 0)) return;
        const Axes world((1 / gap) * (Q.at - P.at));
        std::vector<std::pair<int, int>> alike;
        for (int a = 0; a < part.count; ++a)
            for (int b = 0; b < part.count; ++b)
                if (a != b && fits(P, Q, world, gap, a, b)) alike.push_back({a, b});
        const size_t every = std::max<size_t>(1, alike.size() / std::max(effort.pairs, 1));
        for (size_t k = 0; k < alike.size(); k += every) spun(P, Q, world, alike[k].first, alike[k].second);
    }

    std::vector<CoarsePose> found() const {
        std::vector<CoarsePose> all(best);
        std::sort(all.begin(), all.end(), [](const CoarsePose& a, const CoarsePose& b) { return a.cost < b.cost; });
        while (!all.empty() && all.back().cost >= 1e300) all.pop_back();
        if (static_cast<int>(all.size()) > effort.refine) all.resize(effort.refine);
        return all;
    }

  private:
    const CoarsePart& part;
    const std::vector<CoarsePoint>& points;
    const CoarseEffort& effort;
    std::vector<CoarsePose> best;
    double per;

    bool fits(const CoarsePoint& P, const CoarsePoint& Q, const Axes& world, double gap, int a, int b) const {
        const Vec3 way = part.places[b].at - part.places[a].at;
        const double d2 = squared(way), within = 0.7 * part.spacing + 3 * (P.sd + Q.sd), low = std::max(gap - within, 0.0);
        if (!(d2 > 0) || d2 < low * low || d2 > (gap + within) * (gap + within)) return false;
        if (!P.oriented || !Q.oriented) return true;
        const Vec3 e = (1 / std::sqrt(d2)) * way, &na = part.places[a].normal, &nb = part.places[b].normal;
        const double off = within / std::max(gap, within);
        return std::fabs(dot(na, e) - dot(P.normal, world.e)) < 0.2 + off &&
               std::fabs(dot(nb, e) - dot(Q.normal, world.e)) < 0.2 + off &&
               std::fabs(dot(na, nb) - dot(P.normal, Q.normal)) < 0.2 + 3 * (P.tilt + Q.tilt);
    }

    void spun(const CoarsePoint& P, const CoarsePoint& Q, const Axes& world, int a, int b) {
        const CoarsePlace &A = part.places[a], &B = part.places[b];
        const Axes there(unit(B.at - A.at));
        double first = 0, step = 2 * PI / effort.spins;
        int spins = effort.spins;
        if (P.oriented && Q.oriented && spin_of(world, there, P, Q, A, B, first)) {
            step = 0.2;
            first -= step;
            spins = 3;
        }
        const Vec3 middle = 0.5 * (P.at + Q.at), inner = 0.5 * (A.at + B.at);
        for (int k = 0; k < spins; ++k) {
            Pose pose;
            pose.R = attitude(world, there, std::cos(first + k * step), std::sin(first + k * step));
            pose.t = middle - pose.R * inner;
            const double cost = rough(part, points, pose, per, effort.most, best[a].cost);
            if (cost < best[a].cost) best[a] = {pose, cost};
        }
    }
};

}  // namespace

double CoarseField::nearest(const Vec3& p) const {
    size_t at = 0;
    double away = 0;
    for (int k = 0; k < 3; ++k) {
        const double l = (p[k] - origin[k]) / step, m = std::clamp(l, 0.0, shape[k] - 1.0);
        away += (l - m) * (l - m);
        at = at * shape[k] + static_cast<size_t>(m + 0.5);
    }
    const double d = unit * levels[at];
    return away > 0 ? d + step * std::sqrt(away) : d;
}

double CoarseField::linear(const Vec3& p, Vec3& gradient) const {
    double f[3], away = 0;
    Vec3 off;
    size_t at = 0;
    for (int k = 0; k < 3; ++k) {
        const double l = (p[k] - origin[k]) / step, m = std::clamp(l, 0.0, shape[k] - 1.0001);
        off[k] = l - m;
        away += off[k] * off[k];
        const int i = static_cast<int>(m);
        f[k] = m - i;
        at = at * shape[k] + i;
    }
    const size_t row = shape[2], plane = row * shape[1];
    const int8_t* g = levels + at;
    const double v000 = g[0], v001 = g[1], v010 = g[row], v011 = g[row + 1], v100 = g[plane], v101 = g[plane + 1],
                 v110 = g[plane + row], v111 = g[plane + row + 1];
    const double z0 = 1 - f[2], y0 = 1 - f[1], x0 = 1 - f[0];
    const double a00 = v000 * z0 + v001 * f[2], a01 = v010 * z0 + v011 * f[2], a10 = v100 * z0 + v101 * f[2],
                 a11 = v110 * z0 + v111 * f[2];
    const double b0 = a00 * y0 + a01 * f[1], b1 = a10 * y0 + a11 * f[1];
    gradient.x = b1 - b0;
    gradient.y = (a01 - a00) * x0 + (a11 - a10) * f[0];
    gradient.z = ((v001 - v000) * y0 + (v011 - v010) * f[1]) * x0 + ((v101 - v100) * y0 + (v111 - v110) * f[1]) * f[0];
    gradient = (unit / step) * gradient;
    const double d = unit * (b0 * x0 + b1 * f[0]);
    if (!(away > 0)) return d;
    const double far = step * std::sqrt(away);
    gradient = (step / far) * off;
    return d + far;
}

std::vector<CoarsePose> coarse_poses(const CoarsePart& part, const std::vector<CoarsePoint>& points,
                                     const std::vector<int>& pairs, const std::vector<Pose>& starts,
                                     const CoarseEffort& effort) {
    std::vector<CoarsePose> begun;
    for (const Pose& pose : starts) begun.push_back({pose, 0});
    if (starts.empty()) {
        Search search(part, points, effort);
        for (size_t k = 0; k + 1 < pairs.size(); k += 2) search.pair(points[pairs[k]], points[pairs[k + 1]]);
        begun = search.found();
    }
    std::vector<CoarsePose> out;
    for (const CoarsePose& one : begun) out.push_back(refined(part, points, one.pose, effort));
    std::sort(out.begin(), out.end(), [](const CoarsePose& a, const CoarsePose& b) { return a.cost < b.cost; });
    if (static_cast<int>(out.size()) > effort.keep) out.resize(effort.keep);
    return out;
}

}  // namespace tanteo
