#include "factors/surface_point.hpp"

#include <algorithm>
#include <cstring>

#include "factors/face_queue.hpp"
#include "factors/registry.hpp"

namespace tanteo {

namespace {

// What chose these numbers: benchmarks/against.py, rows bare, beams, balls; decisions 16, 53, 54.
constexpr double ROUGH_REACH = 4;    // standard deviations of blurred noise beyond which a density is zero
constexpr double GRAZING = 0.02;     // least cosine of incidence: a beam along a face does not measure it
constexpr double FROM_INSIDE = 1e-6; // density factor of a beam that hits a face from inside the part
constexpr double CLEARLY = 0.1;      // cosine from which a face points away from a roughly known side
constexpr double LEAST_MASS = 1e-3;  // least mass of the noise on a face that keeps a ball off another face
constexpr double SMALL = 0.5;        // size of a facet cluster in standard deviations up to which it is one density
constexpr double LARGE = 8;          // size beyond which clusters are not tried: they are accurate only if negligible
constexpr double BENT = 0.05;        // largest shortening of their mean normal if directions matter
constexpr double BALL = 0.5, ROUGH_BALL = 2;  // radii in standard deviations from which a ball touches edges
constexpr double PARALLEL = 1e-3;    // least sine between surfaces, one of which keeps a ball off the other

struct TangentPlane {  // that touches the surface near a point
    Vec3 normal;
    double distance;
    bool round;
    Profile::At at;
};

struct InPlane {  // a point in the coordinates of a flat, and the way from it to the rectangle about the flat
    double x, y, distance, dx, dy;

    bool is_beyond(const Flat& flat, double reach) const {
        return (std::fabs(distance) > reach + flat.sagitta) | (dx * dx + dy * dy > reach * reach);
    }
};

InPlane in_plane(const Flat& flat, const Vec3& p) {
    const Vec3 off = p - flat.origin;
    const double x = dot(off, flat.u), y = dot(off, flat.v);
    return {x, y, dot(flat.normal, p) - flat.offset, std::clamp(x, flat.lo[0], flat.hi[0]) - x,
            std::clamp(y, flat.lo[1], flat.hi[1]) - y};
}

// The plane of a flat, or the tangent plane of the exact round surface that it approximates, at its point nearest to p.
TangentPlane tangent_plane(const Shape& shape, const Flat& flat, const InPlane& place, const Vec3& p, bool with_bends) {
    TangentPlane plane;
    plane.normal = flat.normal;
    plane.distance = place.distance;
    plane.round = false;
    if (flat.profile < 0) return plane;
    const Profile& profile = shape.profiles[flat.profile];
    const Vec3 shift = place.dx * flat.u + place.dy * flat.v;
    const Profile::At at = profile.at(p + shift, with_bends);
    if (!(dot(at.normal, flat.normal) >= profile.min_cosine)) return plane;
    plane.normal = at.normal;
    plane.distance = at.distance - dot(at.normal, shift);
    plane.round = true;
    plane.at = at;
    return plane;
}

// Gradient and curvature of the log truncated mass by the point, whose position in the plane moves by du and dv.
inline void follow_mass(TruncatedMass& mass, const Whitening& W, const Vec3& du, const Vec3& dv, Component& c) {
    c.slope = {};
    c.stiff = {};
    if (!(mass.value < 1 - 1e-9)) return;
    c.spread = -(mass.xx + mass.yy) / mass.value;
    as_log(mass);
    const Vec3 x = W.a * du, y = W.b * du + W.c * dv;
    c.slope = mass.gx * x + mass.gy * y;
    add_outer(c.stiff, mass.xx, x, x);
    add_outer(c.stiff, mass.xy, x, y);
    add_outer(c.stiff, mass.xy, y, x);
    add_outer(c.stiff, mass.yy, y, y);
}

// Mass of the noise on the side of a place to which a direction points; adds its slope.
double mass_beyond(const Vec3& side, const Vec3& place, double per_sd, Vec3& slope) {
    const double h = dot(place, side) * per_sd, mass = normal_below(h);
    slope += (per_sd * normal_density(h) / std::max(mass, 1e-300)) * side;
    return mass;
}

}  // namespace

struct SurfacePoint::Ball {  // a touch with a ball, in the part frame
    const Placement& at;
    Vec3 along;
    double per_sd, normal_variance;
};

struct SurfacePoint::Tip {  // a convex vertex that a ball may touch, with one of its edges
    int vertex, face;
    Vec3 at, away;
};

// Density per measure of the surface for a sensor that came along d to a surface with normal n.
inline double SurfacePoint::incidence_density(const Vec3& n, const Vec3& d, double per_area) const {
    if (directed) {
        const double cosine = -dot(n, d);
        return cosine > 0 ? std::max(cosine, GRAZING) : FROM_INSIDE;
    }
    return sided && dot(n, d) > CLEARLY ? FROM_INSIDE * per_area : per_area;
}

struct SurfacePoint::Extent {  // of the noise of a placement, and what follows for the faces
    double sd, reach, least;  // largest standard deviation; reach in these; sd of the noise for facet clusters, 0 for none
    bool ball, kept_off;      // whether the tip may touch edges, and whether other faces keep it off
    Vec3 along;               // direction of the beam or approach in the part frame
};

SurfacePoint::Extent SurfacePoint::extent_of(const Placement& at) const {
    Extent extent;
    extent.sd = std::sqrt(isotropic ? at.C(0, 0) : at.C(0, 0) + at.C(1, 1) + at.C(2, 2));
    extent.reach = at.blur > 0 ? ROUGH_REACH : REACH;
    extent.ball = radius > (at.blur > 0 ? ROUGH_BALL : BALL) * extent.sd;
    extent.kept_off = extent.ball && at.blur == 0;  // by other faces; blurred noise is too wide for this
    extent.least = extent.kept_off || oriented ? 0 : isotropic ? extent.sd : at.blur;
    if (sided) extent.along = transposed_times(at.R, inward);
    return extent;
}

void SurfacePoint::begin(const Placement& at, FaceQueue& queue) const {
    const Extent extent = extent_of(at);
    queue.blocks.push_back({queue.count(), 0, queue.clusters.size(), 0});
    const auto done = [&](const Place& place) {
        return place.size < LARGE * extent.least && add_facet_cluster(at, extent, place, queue);
    };
    at.shape.flats_near(at.p, extent.reach * extent.sd + radius, done, [&](int which) {
        if (!done(at.shape.places[which])) add_face(at, extent, which, queue);
    });
    FaceQueue::Block& block = queue.blocks.back();
    block.faces = queue.count() - block.first_face;
    block.clusters = queue.clusters.size() - block.first_cluster;
}

void SurfacePoint::evaluate(const Placement& at, Components& out) const {
    const size_t first = out.size();
    const Extent extent = extent_of(at);
    take_faces(at, extent, out);
    if (extent.ball) {
        const double normal_variance = direction_sd * direction_sd + at.blur_turn * at.blur_turn;
        const double per_sd = 1 / (isotropic ? extent.sd : extent.sd / std::sqrt(3.0));
        evaluate_convex_edges({at, extent.along, per_sd, normal_variance}, out);
        if (extent.kept_off) keep_outside(at, first, out);
    }
    if (out.size() > first && is_blocked(at)) out.all.resize(first);
}

// Adds a face unless it is out of reach.
void SurfacePoint::add_face(const Placement& at, const Extent& extent, int which, FaceQueue& queue) const {
    const Shape& shape = at.shape;
    const Vec3& p = at.p;
    const Mat3& C = at.C;
    const Flat& flat = shape.flats[which];
    const InPlane place = in_plane(flat, p);
    if (place.is_beyond(flat, extent.reach * extent.sd + radius)) return;
    const TangentPlane plane = tangent_plane(shape, flat, place, p, oriented);
    const Vec3& n = plane.normal;
    Vec3 Cn;
    double variance = C(0, 0), sd = extent.sd;
    if (!isotropic) {
        Cn = C * n;
        variance = dot(n, Cn);
        sd = std::sqrt(variance);
    }
    const double gap = plane.distance - radius;
    // if the ball overlaps the face, it cannot touch another one
    const bool inside = extent.kept_off && gap < 0 && plane.distance > -radius;
    const bool reached = std::fabs(gap) <= extent.reach * sd;
    if (!reached && !inside) return;
    const double per_sd = 1 / sd, r = gap * per_sd;
    double weight = incidence_density(n, extent.along, 1 / shape.area) * per_sd;
    double exponent = -0.5 * r * r - HALF_LOG_TWO_PI - log_outlier;
    PendingFace& face = queue.next();
    Component& c = face.component;
    if (oriented) {
        const double normal_variance = direction_sd * direction_sd + at.blur_turn * at.blur_turn;
        const Vec3 axes[2] = {flat.u, flat.v};
        const double flat_bend[2] = {0, 0};
        weight *= fast_exp(exponent) *
                  (plane.round ? tilt_density(plane.at.e, plane.at.bend, n, C, at.m, normal_variance, c)
                               : tilt_density(axes, flat_bend, n, C, at.m, normal_variance, c));
        exponent = 0;
        if (!(weight >= at.negligible) && !inside) return;
    }
    face.W = {per_sd, 0, per_sd, extent.sd, true};
    face.ku = face.kv = 0;
    if (!isotropic || plane.round) {
        if (isotropic) Cn = variance * n;
        const double Cu = dot(flat.u, Cn), Cv = dot(flat.v, Cn);
        face.ku = Cu / variance;
        face.kv = Cv / variance;
        face.W = whitening_of(dot(flat.u, C * flat.u) - face.ku * Cu, dot(flat.u, C * flat.v) - face.ku * Cv,
                              dot(flat.v, C * flat.v) - face.kv * Cv);
    }
    face.mass = queue.masses.add(shape, flat, place.x - face.ku * gap, place.y - face.kv * gap, face.W, exponent);
    if (face.mass < 0) return;
    face.flat = which;
    face.round = plane.round;
    face.reached = reached;
    c.weight = weight;
    c.distance = gap;
    c.per_sd = per_sd;
    c.normal = n;
    c.element = flat.face;
    queue.keep();
}

// Appends the facet clusters and faces that begin() added.
void SurfacePoint::take_faces(const Placement& at, const Extent& extent, Components& out) const {
    const FaceQueue& queue = *out.queue;
    const FaceQueue::Block& block = queue.blocks[out.queue->taken++];
    const auto clusters = queue.clusters.begin() + static_cast<std::ptrdiff_t>(block.first_cluster);
    out.all.insert(out.all.end(), clusters, clusters + static_cast<std::ptrdiff_t>(block.clusters));
    out.contacts.clear();
    out.near_faces.clear();
    for (size_t k = block.first_face; k < block.first_face + block.faces; ++k) {
        const PendingFace& face = queue.face(k);
        const Flat& flat = at.shape.flats[face.flat];
        const Vec3& n = face.component.normal;
        TruncatedMass mass = queue.masses.mass(face.mass);
        const double weight = face.component.weight * queue.masses.exponential(face.mass) * mass.value;
        BallContact contact;
        if (extent.kept_off) {
            const double u = 0.5 * (flat.lo[0] + flat.hi[0]), v = 0.5 * (flat.lo[1] + flat.hi[1]);
            const Vec3 middle = flat.origin + u * flat.u + v * flat.v;
            contact = {face.flat, flat.face, face.round, n, middle, face.component.distance, mass.value};
            if (mass.value > LEAST_MASS) out.near_faces.push_back(contact);
        }
        if (!(weight >= at.negligible) || !face.reached) continue;
        out.all.push_back(face.component);
        Component& c = out.all.back();
        c.weight = weight;
        if (at.with_slope) follow_mass(mass, face.W, flat.u - face.ku * n, flat.v - face.kv * n, c);
        if (extent.kept_off) out.contacts.push_back(contact);
    }
}

// Adds flats that are small relative to the noise as one normal density. With the spread of the flats it has the same first
// moments, so that its error is of fourth order in their size. Returns false if that or the spread of normals is too large.
bool SurfacePoint::add_facet_cluster(const Placement& at, const Extent& extent, const Place& place,
                                     FaceQueue& queue) const {
    const Vec3& d = extent.along;
    const double length = norm(place.normal), bent = 1 - length, size = place.size / extent.least;
    const bool turns = radius > 0 || sided;  // their normals matter
    if (place.face < 0 || (turns ? bent > BENT : !(length > 0))) return false;
    const Vec3 n = (1 / length) * place.normal;
    const double turn = std::sqrt(2 * std::max(bent, 0.0));  // approximate spread of the normals [rad]
    if (turns && (radius * turn > place.size || (sided && std::fabs(dot(n, d)) < 2 * turn))) return false;
    Mat3 S = at.C;
    for (int i = 0; i < 9; ++i) S.m[i] += place.spread.m[i];
    const Vec3 off = at.p - place.middle - radius * n, Sn = S * n;
    // a large cluster is accurate only if it is negligible, which it is not near its middle
    const double least_squares = extent.least * extent.least;
    if (size > SMALL && squared(off) < least_squares * 8 * std::log(size / SMALL)) return false;
    double L[9];
    std::memcpy(L, S.m, sizeof L);
    if (!cholesky(L, 3)) return false;
    double pull[3] = {off.x, off.y, off.z};
    solve_cholesky(L, 3, pull);
    const double q = dot(off, load(pull));
    if (q > extent.reach * extent.reach) return true;
    Component c;
    c.weight = incidence_density(place.normal, d, 1 / at.shape.area) * place.area / (L[0] * L[4] * L[8]) *
               fast_exp(-0.5 * q - 3 * HALF_LOG_TWO_PI - log_outlier);
    if (size > SMALL && !is_minor(c.weight, size, queue)) return false;
    if (!(c.weight >= at.negligible)) return true;
    c.per_sd = 1 / std::sqrt(dot(n, Sn));
    c.distance = dot(n, off);
    c.normal = n;
    c.element = place.face;
    const double r = c.distance * c.per_sd;
    c.slope = (r * c.per_sd) * n - load(pull);  // the part that is not along the normal
    c.spread = q - r * r - 2;
    for (int k = 0; k < 3; ++k) {
        double column[3] = {0, 0, 0};
        column[k] = 1;
        solve_cholesky(L, 3, column);
        for (int i = 0; i < 3; ++i) c.stiff(i, k) = column[i];
    }
    add_outer(c.stiff, -c.per_sd * c.per_sd, n, n);
    queue.clusters.push_back(c);
    return true;
}

// Whether the density of a large facet cluster is so small that its error is negligible beside what the factor has so far.
bool SurfacePoint::is_minor(double weight, double size, FaceQueue& queue) const {
    const double times = size * size / (SMALL * SMALL);
    return queue.exceeds(weight * times * times);
}

// A ball that touches one element must not overlap another face in front of it: multiplies by the mass of the noise along
// the element that keeps the ball outside the other face.
void SurfacePoint::keep_outside(const Placement& at, size_t first, Components& out) const {
    const double apart = 1e-9 * at.shape.diagonal;
    for (size_t k = first; k < out.size(); ++k) {
        Component& c = out.all[k];
        const BallContact& own = out.contacts[k - first];
        for (const BallContact& other : out.near_faces) {
            if (other.flat == own.flat || (own.round && other.round && own.face == other.face)) continue;
            if (dot(other.normal, own.on_it - other.on_it) <= apart) continue;
            if (own.flat >= 0 && dot(own.normal, other.on_it - own.on_it) <= apart) continue;
            const double cosine = dot(other.normal, own.normal), sine = std::sqrt(std::max(1 - cosine * cosine, 0.0));
            if (sine < PARALLEL) continue;
            const double per = c.per_sd / sine, u = (other.gap - cosine * own.gap) * per;
            const double outside = 1 - other.mass * normal_below(-u);
            if (outside > 1 - 1e-9) continue;
            const double pull = other.mass * normal_density(u) / std::max(outside, 1e-300);
            const Vec3 by_p = per * (other.normal - cosine * own.normal);
            c.weight *= outside;
            c.slope += pull * by_p;
            add_outer(c.stiff, std::max(pull * (pull + u), 0.0), by_p, by_p);
        }
    }
}

// Adds the contact of a ball with an edge or a vertex: its centre is one radius away along n, which turns along across[i] by
// bend[i]. Mass and slope are those of the noise in the region where no other element is nearer.
void SurfacePoint::add_sharp(const Ball& ball, const BallContact& contact, const Vec3 across[2], const double bend[2],
                             const Vec3& slope, Components& out) const {
    const Placement& at = ball.at;
    const double r = contact.gap * ball.per_sd;
    Component c;
    c.weight = contact.mass * incidence_density(contact.normal, ball.along, 1 / at.shape.area) * ball.per_sd *
               fast_exp(-0.5 * r * r - HALF_LOG_TWO_PI - log_outlier);
    if (oriented) c.weight *= tilt_density(across, bend, contact.normal, at.C, at.m, ball.normal_variance, c);
    if (!(c.weight >= at.negligible)) return;
    c.distance = contact.gap;
    c.per_sd = ball.per_sd;
    c.normal = contact.normal;
    c.element = contact.face;
    c.slope = slope;
    c.stiff = {};
    out.all.push_back(c);
    out.contacts.push_back(contact);
}

// A ball that touches a convex edge: its centre is on a cylinder about the edge, between the two faces.
void SurfacePoint::evaluate_convex_edges(const Ball& ball, Components& out) const {
    const double per_sd = ball.per_sd;
    const Shape& shape = ball.at.shape;
    std::vector<Tip> tips;
    shape.convex_edges_near(ball.at.p, REACH / per_sd + radius, [&](int which) {
        const ConvexEdge& e = shape.convex_edges[which];
        if (e.tip[0] >= 0) tips.push_back({e.tip[0], e.face, e.a, e.direction});
        if (e.tip[1] >= 0) tips.push_back({e.tip[1], e.face, e.a + e.length * e.direction, -e.direction});
        const Vec3 off = ball.at.p - e.a;
        const double t = dot(off, e.direction);
        const Vec3 away = off - t * e.direction;
        const double far = norm(away);
        if (std::fabs(far - radius) * per_sd > REACH || far < 1e-12) return;
        if (dot(away, e.normal[0]) < 0 && dot(away, e.normal[1]) < 0) return;
        const double near = normal_density(t * per_sd), end = normal_density((t - e.length) * per_sd);
        const double along = normal_below(t * per_sd) - normal_below((t - e.length) * per_sd);
        double mass = along;
        Vec3 slope = ((near - end) * per_sd / std::max(along, 1e-300)) * e.direction;
        for (const Vec3& inward_of : e.inward) mass *= mass_beyond(-inward_of, away, per_sd, slope);
        const Vec3 n = (1 / far) * away, across[2] = {e.direction, cross(n, e.direction)};
        const double bend[2] = {0, 1 / far};
        add_sharp(ball, {-1, e.face, false, n, e.a, far - radius, mass}, across, bend, slope, out);
    });
    evaluate_convex_vertices(ball, tips, out);
}

// A ball that touches a convex vertex: its centre is on a sphere about it, on the outer side of all its edges.
void SurfacePoint::evaluate_convex_vertices(const Ball& ball, std::vector<Tip>& tips, Components& out) const {
    const double per_sd = ball.per_sd;
    std::sort(tips.begin(), tips.end(), [](const Tip& a, const Tip& b) { return a.vertex < b.vertex; });
    for (size_t k = 0; k < tips.size();) {
        const Tip& tip = tips[k];
        const Vec3 away = ball.at.p - tip.at;
        const double far = norm(away);
        double mass = 1;
        Vec3 slope;
        for (; k < tips.size() && tips[k].vertex == tip.vertex; ++k) mass *= mass_beyond(-tips[k].away, away, per_sd, slope);
        if (std::fabs(far - radius) * per_sd > REACH || far < 1e-12) continue;
        const Vec3 n = (1 / far) * away, u = any_across(n), across[2] = {u, cross(n, u)};
        const double bend[2] = {1 / far, 1 / far};
        add_sharp(ball, {-1, tip.face, false, n, tip.at, far - radius, mass}, across, bend, slope, out);
    }
}

static const RegisteredKind registered("surface_point", factors_from_columns<SurfacePoint>);

}  // namespace tanteo
