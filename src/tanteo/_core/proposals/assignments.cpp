// The tree search: possible faces of each point under the uncertain pose of a node, and the pose after one more assignment.
#include "proposals/assignments.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "factors/on_surface.hpp"
#include "solve/maximize.hpp"

namespace tanteo {

namespace {

constexpr int MOST_STEPS = 4;       // Gauss-Newton steps of a node
constexpr double CONVERGED = 0.01;  // gain of a step below which the next one changes nothing that matters
constexpr double SAME_SIDE = 0.8;   // cosine between normals of a round surface that one candidate represents

struct Point {
    const OnSurface* factor;
    double shared;  // variance by the shared errors, as if each point had its own [m^2]
};

struct Candidate {
    int flat;
    double cost;  // what the assignment adds to the sum of squares
};

struct Residual {
    double distance, variance;
    Vec3 normal;
    double curvature;  // of an exact round surface [1/m]
};

struct Node {
    Pose pose;
    std::array<double, 36> L{};  // Cholesky factor of the information
    double cost = 0, turned = 0;  // sum of squares; variance of the turn [rad^2]
};

// Position of a point in the part frame, and its covariance by the uncertain pose.
struct Position {
    Vec3 p;
    Mat3 S;
    double trace = 0, noise = 0;  // traces of this covariance, and of that of the measurement
    double bent = 0;              // variance by the square of the turn, which the linear covariance omits
};

// Distance of a place in the plane of a flat from its outline; zero inside.
double outside(const Shape& shape, const Flat& flat, double x, double y) {
    bool inside = false;
    double least = 1e300;
    for (int k = 0; k < flat.edges; ++k) {
        const OutlineEdge& e = shape.outlines[flat.first_edge + k];
        const double ax = x - e.x, ay = y - e.y, along = std::clamp(ax * e.dx + ay * e.dy, 0.0, e.length);
        const double bx = ax - along * e.dx, by = ay - along * e.dy;
        least = std::min(least, bx * bx + by * by);
        if ((e.y > y) != (e.y + e.length * e.dy > y) && ax < ay / e.dy * e.dx) inside = !inside;
    }
    return inside ? 0 : std::sqrt(least);
}

class Tree {
  public:
    Tree(const Shape& shape, const Problem& problem, const std::vector<int>& rows, const PoseRegion& region,
         const AssignmentLimits& limits)
        : shape(shape), region(region), limits(limits), limit(limits.cost) {
        for (const int j : rows) {
            const auto* factor = dynamic_cast<const OnSurface*>(problem.factors[j].get());
            if (!factor) continue;
            double shared = 0;
            for (int k = 0; k < 3 * problem.shared; ++k) shared += problem.place_jacobian(j)[k] * problem.place_jacobian(j)[k];
            points.push_back({factor, shared / 3});
        }
        on.assign(points.size(), FREE);
    }

    AssignedPoses run() {
        Node root{region.mean};
        std::copy_n(region.information, 36, root.L.begin());
        if (points.empty() || !cholesky(root.L.data(), 6)) return out;
        measure_turn(root);
        visit(root, points.size(), limits.outliers);
        std::stable_sort(out.best.begin(), out.best.end(), [](const auto& a, const auto& b) { return a.score > b.score; });
        if (out.best.size() > static_cast<size_t>(limits.keep)) out.best.resize(limits.keep);
        return out;
    }

  private:
    static constexpr int FREE = -1, OUTLIER = -2;
    const Shape& shape;
    const PoseRegion& region;
    const AssignmentLimits& limits;
    std::vector<Point> points;
    std::vector<int> on;  // flat of each point
    double limit;
    AssignedPoses out;

    // The variance of the turn: the squared norm of the last columns of the inverse factor.
    static void measure_turn(Node& node) {
        node.turned = 0;
        for (int c = 3; c < 6; ++c) {
            double e[6] = {};
            for (int k = c; k < 6; ++k) {
                double sum = k == c;
                for (int m = c; m < k; ++m) sum -= node.L[6 * k + m] * e[m];
                e[k] = sum / node.L[7 * k];
                node.turned += e[k] * e[k];
            }
        }
    }

    double noise_of(const Point& point, double device) const {
        return limits.noise * limits.noise * device + point.factor->extra + point.shared;
    }

    // The distance from the exact surface near a flat, or from its plane while the point is at another side of the surface.
    Residual residual_of(const Point& point, const Flat& flat, const Mat3& R, const Vec3& p) const {
        Residual r{dot(flat.normal, p) - flat.offset, 0, flat.normal, 0};
        if (flat.profile >= 0) {
            const Profile::At at = shape.profiles[flat.profile].at(p, true);
            r.curvature = std::max(std::fabs(at.bend[0]), std::fabs(at.bend[1]));
            if (dot(at.normal, flat.normal) > SAME_SIDE) r.distance = at.distance, r.normal = at.normal;
        }
        r.distance -= point.factor->radius;
        const Vec3 n = R * r.normal;
        r.variance = noise_of(point, dot(n, point.factor->cov * n));
        return r;
    }

    // The pose by the region and all assigned points, from that of the node.
    bool solve(Node& node) const {
        const auto equations = [&] {
            NormalEquations<6> at;
            Vec3 v, w;
            difference(region.mean, node.pose, shape.centre, v, w);
            const double x[6] = {v.x, v.y, v.z, w.x, w.y, w.z};
            for (int i = 0; i < 6; ++i) {
                double sum = 0;
                for (int k = 0; k < 6; ++k) sum += region.information[6 * i + k] * x[k];
                at.gradient[i] -= sum;
                at.cost += 0.5 * sum * x[i];
                for (int k = 0; k <= i; ++k) at.information[6 * i + k] += region.information[6 * i + k];
            }
            for (size_t j = 0; j < points.size(); ++j) {
                if (on[j] < 0) continue;
                const Vec3 p = into_part(node.pose, points[j].factor->at);
                const Residual r = residual_of(points[j], shape.flats[on[j]], node.pose.R, p);
                const Vec3 &n = r.normal, turn = cross(n, p - shape.centre);
                const double J[6] = {-n.x, -n.y, -n.z, turn.x, turn.y, turn.z};
                at.add(J, r.distance, 1 / r.variance);
            }
            node.cost = 2 * at.cost;
            return at;
        };
        auto at = equations();
        bool found = false;
        const auto undamped = [](int, double, double) { return 0.0; };
        maximize(at, MOST_STEPS, {}, undamped, [&](double* step, double predicted, const double* L) {
            std::copy_n(L, 36, node.L.begin());
            found = true;
            if (predicted < CONVERGED) return Attempt::LAST;
            node.pose = moved(node.pose, load(step), load(step + 3), shape.centre);
            at = equations();
            return Attempt::TAKEN;
        });
        if (found) measure_turn(node);
        return found;
    }

    Position position_of(const Node& node, const Point& point) const {
        Position at;
        at.p = into_part(node.pose, point.factor->at);
        const Vec3 y = at.p - shape.centre;
        const double J[3][6] = {{-1, 0, 0, 0, -y.z, y.y}, {0, -1, 0, y.z, 0, -y.x}, {0, 0, -1, -y.y, y.x, 0}};
        double A[3][6];
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 6; ++k) {
                double sum = J[i][k];
                for (int m = 0; m < k; ++m) sum -= node.L[6 * k + m] * A[i][m];
                A[i][k] = sum / node.L[7 * k];
            }
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k)
                for (int m = 0; m < 6; ++m) at.S(i, k) += A[i][m] * A[k][m];
        // a turn w moves a point by up to w^2 / 2 times its lever, or that of the points from which the pose follows
        const double bend = 0.5 * limits.gate * node.turned * (norm(y) + shape.diagonal);
        at.bent = bend * bend;
        at.trace = at.S(0, 0) + at.S(1, 1) + at.S(2, 2);
        const Mat3& C = point.factor->cov;
        at.noise = noise_of(point, C(0, 0) + C(1, 1) + C(2, 2)) + at.bent;
        return at;
    }

    // What an assignment adds to the sum of squares; infinite if the point cannot be inside of the outline of the flat.
    double cost_of(const Flat& flat, const Position& at, const Residual& r) const {
        const Vec3 Sn = at.S * r.normal;
        const double gate = limits.gate, across = dot(r.normal, Sn) + r.variance + at.bent;
        const double left = std::max(at.trace - dot(Sn, Sn) / across, 0.0), beside = gate * std::sqrt(left);
        // how far a round surface is from its tangent plane where the point may be
        const double sag = r.curvature > 0 ? 0.5 * r.curvature * std::pow(std::min(beside, 0.6 / r.curvature), 2) : 0;
        const double cost = r.distance * r.distance / (across + sag * sag);
        if (cost > gate * gate) return INFINITY;
        const Vec3 q = at.p - (r.distance / across) * Sn - flat.origin;
        const double slack = gate * std::sqrt(left + at.noise) + (flat.profile >= 0 ? flat.sagitta : 0);
        const double x = dot(q, flat.u), y = dot(q, flat.v);
        if (x < flat.lo[0] - slack || x > flat.hi[0] + slack || y < flat.lo[1] - slack || y > flat.hi[1] + slack) return INFINITY;
        return outside(shape, flat, x, y) <= slack ? cost : INFINITY;
    }

    // The faces on which a point may be, most probable first.
    std::vector<Candidate> candidates(const Node& node, const Point& point) const {
        std::vector<Candidate> found;
        const OnSurface& factor = *point.factor;
        const Position at = position_of(node, point);
        const double gate = limits.gate, turn = gate * std::sqrt(node.turned);
        const double tilt = gate * std::sqrt(node.turned + factor.direction_sd * factor.direction_sd);
        const Vec3 d = transposed_times(node.pose.R, factor.inward), m = transposed_times(node.pose.R, factor.direction);
        const double reach = gate * std::sqrt(at.trace + at.noise) + factor.radius;
        shape.flats_near(at.p, reach, [](const Place&) { return false; }, [&](int which) {
            const Flat& flat = shape.flats[which];
            for (const Candidate& one : found) {
                const Flat& other = shape.flats[one.flat];
                if (flat.profile >= 0 && other.profile == flat.profile && dot(other.normal, flat.normal) > SAME_SIDE) return;
            }
            const Residual r = residual_of(point, flat, node.pose.R, at.p);
            if (factor.sided && dot(r.normal, d) > turn) return;
            if (factor.oriented && tilt < 1 && dot(r.normal, m) < std::cos(tilt)) return;
            const double cost = cost_of(flat, at, r);
            if (node.cost + cost <= limit) found.push_back({which, cost});
        });
        std::sort(found.begin(), found.end(), [](const Candidate& a, const Candidate& b) { return a.cost < b.cost; });
        return found;
    }

    // Whether the assigned points may still be on their faces: the pose is better known than when they were assigned.
    bool is_possible(const Node& node) const {
        for (size_t j = 0; j < points.size(); ++j) {
            if (on[j] < 0 || shape.flats[on[j]].profile >= 0) continue;  // it may be at another facet of a round surface
            const Position at = position_of(node, points[j]);
            const Flat& flat = shape.flats[on[j]];
            if (!std::isfinite(cost_of(flat, at, residual_of(points[j], flat, node.pose.R, at.p)))) return false;
        }
        return true;
    }

    void add_pose(const Node& node) {
        double log_det = 0;
        for (int k = 0; k < 6; ++k) log_det += std::log(node.L[7 * k]);
        out.best.push_back({node.pose, -0.5 * node.cost - log_det});
        limit = std::min(limit, node.cost + limits.gap);
    }

    void visit(const Node& node, size_t left, int outliers) {
        if (!left) return add_pose(node);
        std::vector<Candidate> chosen;
        size_t which = points.size();
        for (size_t j = 0; j < points.size(); ++j) {
            if (on[j] != FREE) continue;
            std::vector<Candidate> some = candidates(node, points[j]);
            if (which < points.size() && some.size() >= chosen.size()) continue;
            which = j;
            chosen = std::move(some);
            if (chosen.empty()) break;
        }
        for (const Candidate& one : chosen) {
            if (node.cost + one.cost > limit) break;
            if (out.nodes >= limits.nodes) out.complete = false;
            if (!out.complete) break;
            ++out.nodes;
            on[which] = one.flat;
            Node next = node;
            if (solve(next) && next.cost <= limit && is_possible(next)) visit(next, left - 1, outliers);
        }
        if (outliers > 0 && out.complete) {
            on[which] = OUTLIER;
            visit(node, left - 1, outliers - 1);
        }
        on[which] = FREE;
    }
};

}  // namespace

AssignedPoses assigned_poses(const Shape& shape, const Problem& problem, const std::vector<int>& rows,
                             const PoseRegion& region, const AssignmentLimits& limits) {
    return Tree(shape, problem, rows, region, limits).run();
}

}  // namespace tanteo
