#include "proposals/placements.hpp"

#include <cmath>

#include "normal.hpp"
#include "proposals/propose.hpp"

namespace tanteo {

namespace {

double normal_density(double d, double sd) { return std::exp(-0.5 * d * d / (sd * sd)) / (sd * std::sqrt(2 * PI)); }

double random_distance(Random& random, double sd) {
    const double u = std::max(random.uniform(), 1e-9);  // at most REACH standard deviations
    return sd * std::min(std::sqrt(-2 * std::log(u)), REACH) * std::cos(2 * PI * random.uniform());
}

Vec3 direction(Random& random) {
    const double z = 2 * random.uniform() - 1, a = 2 * PI * random.uniform(), r = std::sqrt(std::max(1 - z * z, 0.0));
    return {r * std::cos(a), r * std::sin(a), z};
}

// The triangles of the surface; a point above one along its normal is on it.
struct Surface {
    const Shape& shape;
    std::vector<double> before;   // cumulative probability of each triangle
    std::vector<double> density;  // of a draw per area

    explicit Surface(const Shape& shape_) : shape(shape_) {
        const size_t n = shape.triangles.size() / 3;
        std::vector<double> areas(n), of_face(shape.face_area.size(), 0.0);
        double total = 0, faces = 0, sum = 0;
        for (size_t t = 0; t < n; ++t) {
            areas[t] = 0.5 * norm(cross(corner(t, 1) - corner(t, 0), corner(t, 2) - corner(t, 0)));
            total += areas[t];
            of_face[shape.faces[t]] += areas[t];
        }
        for (const double one : of_face) faces += one > 0;
        for (size_t t = 0; t < n; ++t) {  // half of the draws are even over the area, half over the faces
            density.push_back(0.5 / total + 0.5 / (faces * std::max(of_face[shape.faces[t]], 1e-300)));
            before.push_back(sum += density[t] * areas[t]);
        }
    }
    const Vec3& corner(size_t t, int k) const { return shape.vertices[shape.triangles[3 * t + k]]; }
    // the direction inwards across an edge of a triangle
    Vec3 inward(size_t t, int k) const { return cross(shape.normals[t], corner(t, (k + 1) % 3) - corner(t, k)); }
    double height(size_t t, const Vec3& p) const { return dot(shape.normals[t], p - corner(t, 0)); }
    bool covers(size_t t, const Vec3& p) const {
        for (int k = 0; k < 3; ++k)
            if (dot(inward(t, k), p - corner(t, k)) < 0) return false;
        return true;
    }
    // calls visit(triangle, density of the distance) for all triangles on which a point is
    template <class Visit>
    void on(const Vec3& p, const TouchedPoint& point, Visit&& visit) const {
        const double reach = point.offset + REACH * point.sd;
        shape.triangles_where([&](const Box& box) { return box.squared_distance(p) <= reach * reach; }, [&](int t) {
            const double d = height(t, p) - point.offset;
            if (std::fabs(d) <= REACH * point.sd && covers(t, p)) visit(t, normal_density(d, point.sd));
        });
    }
};

// A circle of the part frame, on which a point turns.
struct Circle {
    Vec3 centre, x, y;
    double radius;
};

struct Crossing {  // of a circle and the surface
    double c = 1, s = 0, weight = 0;
    int face = -1;
};

// Draws of a point on a circle.
class Crossings {
  public:
    std::vector<Crossing> found;  // each with one over the density of the draws per angle

    explicit Crossings(const Surface& surface_) : surface(surface_) {}

    // Draws where a circle crosses the surface at a random distance from it, and returns one over the density of the draws per
    // angle; 0 if it does not cross. Half of the draws are on the face that is touched already, if the circle crosses it: places
    // may be even over the touched faces, so that few small ones are probable.
    double draw(const Circle& circle, const TouchedPoint& point, int touched, Random& random, Crossing& chosen) {
        find(circle, point, random_distance(random, point.sd));
        double total = 0, again = 0;
        for (const Crossing& one : found) {
            total += one.weight;
            if (one.face == touched) again += one.weight;
        }
        if (found.empty()) return 0;
        const bool some = again > 0 && random.uniform() < 0.5;
        double at = (some ? again : total) * random.uniform();
        for (const Crossing& one : found) {
            if (some && one.face != touched) continue;
            chosen = one;
            if ((at -= one.weight) < 0) break;
        }
        return again > 0 ? 1 / (0.5 / total + (chosen.face == touched ? 0.5 / again : 0)) : total;
    }

    // Finds where a circle crosses the surface at a distance from it.
    void find(const Circle& circle, const TouchedPoint& point, double distance) {
        const double off = point.offset + distance, slack = std::fabs(off), r = circle.radius;
        const Vec3 axis = cross(circle.x, circle.y);
        found.clear();
        const auto reached = [&](const Box& box) {
            Vec3 low, far;
            double plane = 0, half = 0;
            for (int k = 0; k < 3; ++k) {
                const double middle = 0.5 * (box.lo[k] + box.hi[k]), size = 0.5 * (box.hi[k] - box.lo[k]) + slack;
                const double away = std::fabs(circle.centre[k] - middle);
                low[k] = std::max(away - size, 0.0);
                far[k] = away + size;
                plane += axis[k] * (middle - circle.centre[k]);
                half += std::fabs(axis[k]) * size;
            }
            return squared(low) <= r * r && squared(far) >= r * r && std::fabs(plane) <= half;
        };
        surface.shape.triangles_where(reached, [&](int t) {
            const Vec3& n = surface.shape.normals[t];
            const double a = dot(n, circle.x), b = dot(n, circle.y), size = std::hypot(a, b);
            const double cosine = (off - surface.height(t, circle.centre)) / (r * size);
            if (!(std::fabs(cosine) < 1)) return;
            const double sine = std::sqrt(1 - cosine * cosine);
            for (const double side : {-1.0, 1.0}) {
                Crossing one{(a * cosine - side * b * sine) / size, (b * cosine + side * a * sine) / size, 0,
                             surface.shape.faces[t]};
                const Vec3 p = circle.centre + (r * one.c) * circle.x + (r * one.s) * circle.y;
                if (!surface.covers(t, p)) continue;
                const Vec3 along = (r * one.c) * circle.y - (r * one.s) * circle.x;  // per angle
                double density = 0;
                surface.on(p, point, [&](int other, double of_distance) {
                    density += of_distance * std::fabs(dot(surface.shape.normals[other], along));
                });
                if (!(density > 0)) continue;
                one.weight = 1 / density;
                found.push_back(one);
            }
        });
    }

  private:
    const Surface& surface;
};

}  // namespace

std::vector<PlacedPose> placements(const Shape& shape, const std::vector<TouchedPoint>& points, uint64_t seed) {
    const Surface surface(shape);
    Crossings crossings(surface);
    std::vector<PlacedPose> out;
    Random random{seed};
    for (size_t draw = 0; 3 * draw + 2 < points.size(); ++draw) {
        const TouchedPoint &P = points[3 * draw], &Q = points[3 * draw + 1], &S = points[3 * draw + 2];
        const double gap = norm(Q.at - P.at);
        const Vec3 E = unit(Q.at - P.at), over = S.at - P.at;
        const double along = dot(over, E), radius = norm(over - along * E);
        if (!(gap > 0) || !(radius > 0)) continue;
        const Vec3 F = unit(over - along * E), G = cross(E, F);
        // the first point: on a triangle, at a random distance from it
        const auto first = std::lower_bound(surface.before.begin(), surface.before.end(), random.uniform() * surface.before.back());
        const size_t t = std::min<size_t>(first - surface.before.begin(), surface.before.size() - 1);
        const double u = std::sqrt(random.uniform()), v = random.uniform();
        const Vec3 on_face = (1 - u) * surface.corner(t, 0) + (u * (1 - v)) * surface.corner(t, 1) + (u * v) * surface.corner(t, 2);
        const Vec3 p = on_face + (P.offset + random_distance(random, P.sd)) * shape.normals[t];
        double density = 0;
        surface.on(p, P, [&](int other, double of_distance) { density += surface.density[other] * of_distance; });
        if (!(density > 0)) continue;
        // the second: where a random great circle about the first crosses the surface
        const Vec3 x = direction(random), y = unit(cross(x, direction(random)));
        Crossing at;
        const double second = crossings.draw({p, x, y, gap}, Q, shape.faces[t], random, at);
        if (!(second > 0)) continue;
        // the third: wherever it crosses the surface as it turns about the line of both
        const Vec3 e = at.c * x + at.s * y, f = any_across(e), g = cross(e, f);
        crossings.find({p + along * e, f, g, radius}, S, random_distance(random, S.sd));
        for (const Crossing& third : crossings.found) {
            const Vec3 f1 = third.c * f + third.s * g;
            PlacedPose one;
            one.draw = static_cast<int>(draw);
            one.pose.R = Mat3{};
            add_outer(one.pose.R, 1, E, e);
            add_outer(one.pose.R, 1, F, f1);
            add_outer(one.pose.R, 1, G, cross(e, f1));
            one.pose.t = P.at - one.pose.R * p;
            // directions are 4 pi, of which a great circle has 2 pi
            one.log_weight = std::log(2 * second * third.weight / density);
            out.push_back(one);
        }
    }
    return out;
}

}  // namespace tanteo
