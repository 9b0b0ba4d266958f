#include "factors/on_surface.hpp"

#include <algorithm>
#include <cmath>

namespace tanteo {

namespace {

constexpr double CLEARLY = 0.1;   // cosine from which a face looks away from a side that is roughly known
constexpr double WRONG_SIDE = 4;  // rough cost of a beam that comes from inside of the part
constexpr double IN_FRONT = 4;    // material so many standard deviations before a point contradicts its beam
constexpr size_t WINDOW = 256;    // samples among which a partner is searched

}  // namespace

bool OnSurface::is_blocked(const Placement& at) const {
    if (!(free_reach > 0 && directed)) return false;
    const Vec3 d = transposed_times(at.R, inward);
    const double sd = std::sqrt(dot(d, at.C * d)), free = free_reach - IN_FRONT * sd - 0.01 * at.shape.diagonal;
    if (free <= 0) return false;
    const Vec3 start = at.p - free_reach * d;
    if (at.shape.cast(start, d, free) > free) return false;
    const Vec3 u = any_across(d), v = cross(d, u);
    for (const Vec3& beside : {u, v, -u, -v})
        if (at.shape.cast(start + IN_FRONT * sd * beside, d, free) > free) return false;
    return true;
}

Sites OnSurface::sites(const Shape& shape) const {
    return Sites(shape.samples, shape.sample_normals, radius, WINDOW);  // samples come in no order: any in a row will do
}

double OnSurface::rough_cost(const Shape& shape, const Pose& pose, double blur, double tilt) const {
    int flat = 0;
    const bool faces = oriented || sided;
    const double f = shape.field(into_part(pose, at), faces ? &flat : nullptr) - radius;
    double cost = f * f * (1 / (blur * blur));
    if (faces) {
        const Vec3 n = pose.R * shape.flats[flat].normal;
        if (oriented) cost += 2 * (1 - dot(n, direction)) * (1 / (tilt * tilt));
        if (sided && dot(n, inward) > CLEARLY) cost += WRONG_SIDE;
    }
    return std::min(cost, ROUGH_CAP);
}

NearestElement OnSurface::nearest(const Shape& shape, const Pose& pose, const Vec3& p, bool coarse) const {
    const Closest closest = coarse ? shape.closest_about(p) : shape.closest(p);
    const Vec3& n = shape.normals[closest.triangle];
    double far = std::sqrt(closest.squared);
    Vec3 g = far > 1e-7 * shape.diagonal ? (1 / far) * (p - closest.point) : n;
    if (dot(g, n) < 0) {
        g = -g;
        far = -far;
    }
    const int flat = shape.flat_of[closest.triangle], profile = flat < 0 ? -1 : shape.flats[flat].profile;
    if (profile >= 0 && dot(g, n) > 0.9) {
        const Profile::At round = shape.profiles[profile].at(p, false);
        if (dot(round.normal, n) > 0.9) {
            far = round.distance;
            g = round.normal;
        }
    }
    NearestElement out;
    out.possible = true;
    out.contradicted = sided && dot(n, transposed_times(pose.R, inward)) > 0;
    out.distance = far - radius;
    out.direction = g;
    if (directed) out.along = std::fabs(dot(g, transposed_times(pose.R, inward)));
    if (oriented) out.normal = n;
    return out;
}

NearestPlace OnSurface::beside(const Shape& shape, const Pose& pose, const Vec3& p) const {
    return nearest_on_surface(*this, shape, pose, p, radius, inward, directed);
}

void OnSurface::fill(const Columns& columns, size_t row) {
    columns.fill(*this, row);
    columns.set_direction(*this, row, columns.vector("normals", row));
    radius = columns.number("radii", row, 0, 1e300);
    inward = columns.vector("directions", row);
    directed = squared(inward) > 0;
    if (!directed) inward = -columns.vector("sides", row);
    sided = squared(inward) > 0;
    free_reach = columns.number("free_reach", row, -1e300, 1e300);
    round_face = columns.number("round_face", row, 0, 1) > 0;
}

}  // namespace tanteo
