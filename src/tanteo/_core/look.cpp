// What of the part a point may have met, and how dense it is there: faces here, edges and corners in sharp.cpp.
#include <cstring>

#include "aim.hpp"
#include "likelihood.hpp"
#include "share.hpp"

namespace tanteo {

namespace {

constexpr double BESIDE = 1e-3;    // least share of the noise on a face that keeps a ball off another
constexpr double ROUGH_REACH = 4;  // standard deviations of blurred noise beyond which nothing is seen
constexpr double IN_FRONT = 4;     // material so many standard deviations before a hit contradicts a beam
constexpr double SMALL = 0.5;      // size in standard deviations up to which flats of a face are one place
constexpr double LARGE = 8;        // beyond it they are not tried as one: they would have to add next to nothing
constexpr double BENT = 0.05;      // by how much their mean normal may be shorter than 1 where it counts
constexpr double BALL = 0.5, ROUGH_BALL = 2;  // radii in standard deviations from which a tip may touch edges

struct Plane {  // that touches the surface near a point
    Vec3 normal;
    double distance;
    bool round;
    Profile::At at;
};

// The plane of a flat, or the one that touches the round surface behind it, at the place of the flat next to p.
Plane plane_at(const Shape& shape, const Flat& flat, const Vec3& p, bool with_bends) {
    Plane plane;
    plane.normal = flat.normal;
    plane.distance = dot(flat.normal, p) - flat.offset;
    plane.round = false;
    if (flat.profile < 0) return plane;
    const Profile& profile = shape.profiles[flat.profile];
    const Vec3 off = p - flat.origin;
    const double x = dot(off, flat.u), y = dot(off, flat.v);
    const double dx = std::clamp(x, flat.lo[0], flat.hi[0]) - x, dy = std::clamp(y, flat.lo[1], flat.hi[1]) - y;
    const Vec3 shift = dx * flat.u + dy * flat.v;
    const Profile::At at = profile.at(p + shift, with_bends);
    if (!(dot(at.normal, flat.normal) >= profile.alike)) return plane;
    plane.normal = at.normal;
    plane.distance = at.distance - dot(at.normal, shift);
    plane.round = true;
    plane.at = at;
    return plane;
}

// How the share of a hit follows the point, if its place in the plane moves by du and dv.
inline void follow_share(Share& share, const Whitening& W, const Vec3& du, const Vec3& dv, Hit& hit) {
    hit.slope = {};
    hit.stiff = {};
    if (!(share.value < 1 - 1e-9)) return;
    hit.spread = -(share.xx + share.yy) / share.value;
    log_share(share);
    const Vec3 x = W.a * du, y = W.b * du + W.c * dv;
    hit.slope = share.gx * x + share.gy * y;
    add_outer(hit.stiff, share.xx, x, x);
    add_outer(hit.stiff, share.xy, x, y);
    add_outer(hit.stiff, share.xy, y, x);
    add_outer(hit.stiff, share.yy, y, y);
}

}  // namespace

// Everything of the part that point j may have met.
void Likelihood::look(const State& state, int j, bool with_slope) {
    const Point& point = problem.points[j];
    const Mat3& R = state.pose.R;
    Seen& s = seen[j];
    Vec3 world = point.at;
    if (problem.shared) {
        const double* G = problem.gain(j);
        for (int i = 0; i < 3; ++i)
            for (int d = 0; d < problem.shared; ++d) world[i] += G[i * problem.shared + d] * state.z[d];
    }
    s.in_part = into_part(state.pose, world);
    s.first = static_cast<int>(hits.size());
    const double scale = problem.scale_sd > 0 ? std::exp(2 * problem.scale_sd * state.z[problem.shared]) : 1.0;
    Mat3 C = point.cov;
    for (double& c : C.m) c *= scale;
    for (int i = 0; i < 3; ++i) C(i, i) += point.extra + blur * blur;
    if (!point.isotropic) C = turned_into(R, C);
    if (point.kind == Kind::EDGE) {
        look_at_edges(point, j, C);
    } else if (point.kind == Kind::CORNER) {
        look_at_corners(point, j, C);
    } else if (point.amid()) {
        look_at_axes(point, j, R, C);
    } else {
        look_at_faces(point, j, R, C, with_slope);
    }
    s.count = static_cast<int>(hits.size()) - s.first;
    s.density = 0;
    for (int k = s.first; k < s.first + s.count; ++k) s.density += hits[k].weight;
    if (s.density > 0 && point.reach > 0 && point.directed) {
        const Vec3 d = transposed_times(R, point.direction);
        if (blocked(point, s.in_part, d, std::sqrt(dot(d, C * d)))) s.density = 0;
    }
    if (!(s.density > 0)) {
        hits.resize(s.first);
        s.count = 0;
        s.density = 0;
    }
}

// Faces: a density of the distance from the plane that touches the surface, times the share of the noise in that plane,
// given the distance, that falls inside the outline.
void Likelihood::look_at_faces(const Point& point, int j, const Mat3& R, const Mat3& C, bool with_slope) {
    const Vec3& p = seen[j].in_part;
    const double widest = std::sqrt(point.isotropic ? C(0, 0) : C(0, 0) + C(1, 1) + C(2, 2));
    const Vec3 d = point.sided ? transposed_times(R, point.direction) : Vec3{};
    const Vec3 m = point.oriented ? transposed_times(R, point.normal) : Vec3{};
    const double per_area = 1 / shape.area;
    const bool ball = point.radius > (blur > 0 ? ROUGH_BALL : BALL) * widest;
    const bool kept_off = ball && blur == 0;  // by other faces: blurred noise does not discriminate them
    ball_sees.clear();
    faces_near.clear();
    const double nothing = NOTHING * problem.mean_rate;
    const double normal_variance = point.normal_sd * point.normal_sd + blur_turn * blur_turn;
    const double reach = blur > 0 ? ROUGH_REACH : REACH;
    const double least = kept_off || point.oriented ? 0 : point.isotropic ? widest : blur;
    const auto done = [&](const Place& place) {
        return place.size < LARGE * least && meet_place(point, p, d, C, reach, least, seen[j].first, place);
    };
    shape.flats_near(p, reach * widest + point.radius, done, [&](int which) {
        if (done(shape.places[which])) return;
        const Flat& flat = shape.flats[which];
        const Plane plane = plane_at(shape, flat, p, point.oriented);
        const Vec3& n = plane.normal;
        Vec3 Cn = C(0, 0) * n;
        double variance = C(0, 0);
        if (!point.isotropic) {
            Cn = C * n;
            variance = dot(n, Cn);
        }
        const double per_sd = 1 / std::sqrt(variance);
        const double r = (plane.distance - point.radius) * per_sd;
        const bool inside = kept_off && r < 0 && plane.distance > -point.radius;  // of a face: it may not touch another
        if (std::fabs(r) > reach && !inside) return;
        double weight = met(point, n, d, per_area);
        weight *= per_sd * fast_exp(-0.5 * r * r - HALF_LOG_TWO_PI - point.log_outlier);
        Hit hit;
        hit.tilted = 0;
        if (point.oriented) {
            const Vec3 axes[2] = {flat.u, flat.v};
            const double flat_bend[2] = {0, 0};
            weight *= plane.round ? tilt_density(plane.at.e, plane.at.bend, n, C, m, normal_variance, hit)
                                  : tilt_density(axes, flat_bend, n, C, m, normal_variance, hit);
        }
        if (!(weight >= nothing) && !inside) return;
        double ku = 0, kv = 0;  // how the place in the plane follows the distance
        Whitening W{per_sd, 0, per_sd, widest, true};
        if (!point.isotropic || plane.round) {
            const double Cu = dot(flat.u, Cn), Cv = dot(flat.v, Cn);
            ku = Cu / variance;
            kv = Cv / variance;
            W = whitening_of(dot(flat.u, C * flat.u) - ku * Cu, dot(flat.u, C * flat.v) - ku * Cv,
                             dot(flat.v, C * flat.v) - kv * Cv);
        }
        const Vec3 off = p - flat.origin;
        const double gap = plane.distance - point.radius;
        Share share = share_of(shape, flat, dot(off, flat.u) - ku * gap, dot(off, flat.v) - kv * gap, W, with_slope);
        hit.weight = weight * share.value;
        BallSees sees;
        if (kept_off) {
            const double u = 0.5 * (flat.lo[0] + flat.hi[0]), v = 0.5 * (flat.lo[1] + flat.hi[1]);
            const Vec3 middle = flat.origin + u * flat.u + v * flat.v;
            sees = {which, flat.face, plane.round, n, middle, gap, share.value};
            if (share.value > BESIDE) faces_near.push_back(sees);
        }
        if (!(hit.weight >= nothing) || std::fabs(r) > reach) return;
        hit.distance = gap;
        hit.per_sd = per_sd;
        hit.normal = n;
        hit.face = flat.face;
        if (with_slope) follow_share(share, W, flat.u - ku * n, flat.v - kv * n, hit);
        if (kept_off) ball_sees.push_back(sees);
        hits.push_back(hit);
    });
    if (!ball) return;
    const double per_sd = 1 / (point.isotropic ? widest : widest / std::sqrt(3.0));
    look_over_edges({point, p, d, m, C, per_sd, normal_variance});
    if (kept_off) keep_outside(seen[j].first);
}

// Flats that are small beside the noise as one normal density: with their own spread it has the same first moments, so
// that it is off by the fourth power of their size. False where that is too much, or where their normals differ too much.
bool Likelihood::meet_place(const Point& point, const Vec3& p, const Vec3& d, const Mat3& C, double reach, double sd,
                            int first, const Place& place) {
    const double length = norm(place.normal), bent = 1 - length, size = place.size / sd;
    const bool turns = point.radius > 0 || point.sided;  // it counts where they look
    if (place.face < 0 || (turns ? bent > BENT : !(length > 0))) return false;
    const Vec3 n = (1 / length) * place.normal;
    const double turn = std::sqrt(2 * std::max(bent, 0.0));  // of the normals, about
    if (turns && (point.radius * turn > place.size || (point.sided && std::fabs(dot(n, d)) < 2 * turn))) return false;
    Mat3 S = C;
    for (int i = 0; i < 9; ++i) S.m[i] += place.spread.m[i];
    const Vec3 off = p - place.middle - point.radius * n, Sn = S * n;
    double L[9];
    std::memcpy(L, S.m, sizeof L);
    if (!cholesky(L, 3)) return false;
    double pull[3] = {off.x, off.y, off.z};
    solve_cholesky(L, 3, pull);
    const double q = dot(off, load(pull));
    if (q > reach * reach) return true;
    Hit hit;
    hit.weight = met(point, place.normal, d, 1 / shape.area) * place.area / (L[0] * L[4] * L[8]) *
                 fast_exp(-0.5 * q - 3 * HALF_LOG_TWO_PI - point.log_outlier);
    if (size > SMALL) {
        double seen_so_far = 0;
        for (size_t k = first; k < hits.size(); ++k) seen_so_far += hits[k].weight;
        const double times = size * size / (SMALL * SMALL);
        if (hit.weight * times * times > seen_so_far) return false;
    }
    if (!(hit.weight >= NOTHING * problem.mean_rate)) return true;
    hit.per_sd = 1 / std::sqrt(dot(n, Sn));
    hit.distance = dot(n, off);
    hit.normal = n;
    hit.face = place.face;
    hit.tilted = 0;
    const double r = hit.distance * hit.per_sd;
    hit.slope = (r * hit.per_sd) * n - load(pull);  // what is not along the normal
    hit.spread = q - r * r - 2;
    for (int k = 0; k < 3; ++k) {
        double column[3] = {0, 0, 0};
        column[k] = 1;
        solve_cholesky(L, 3, column);
        for (int i = 0; i < 3; ++i) hit.stiff(i, k) = column[i];
    }
    add_outer(hit.stiff, -hit.per_sd * hit.per_sd, n, n);
    hits.push_back(hit);
    return true;
}

// Whether the free-space ray of a beam runs through the part, also a little beside it.
bool Likelihood::blocked(const Point& point, const Vec3& p, const Vec3& d, double sd) const {
    const double free = point.reach - IN_FRONT * sd - 0.01 * shape.diagonal;
    if (free <= 0) return false;
    const Vec3 start = p - point.reach * d;
    if (shape.cast(start, d, free) > free) return false;
    const Vec3 u = any_across(d), v = cross(d, u);
    for (const Vec3& aside : {u, v, -u, -v})
        if (shape.cast(start + IN_FRONT * sd * aside, d, free) > free) return false;
    return true;
}

}  // namespace tanteo
