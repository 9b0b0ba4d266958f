#include "likelihood.hpp"

#include <cstring>

#include "normal.hpp"

namespace tanteo {

namespace {

constexpr double REACH = 6;          // standard deviations beyond which nothing is seen
constexpr double GRAZING = 0.02;     // least cosine of incidence: a beam along a face does not measure it
constexpr double LOOKS_AWAY = 1e-6;  // density of a beam that met a face from behind
constexpr double BEHIND = 2e-22;     // of a sensed normal that points into the part
constexpr double IN_FRONT = 4;       // material so many standard deviations before a hit contradicts a beam
constexpr double NOTHING = 1e-9;     // of the rate of outliers: a density that does not matter
constexpr double SEEN = 5;           // standard deviations beyond which an outline does not matter

struct Whitening {  // of the noise in a plane: W (x - mean) has unit covariance
    double a, b, c;  // lower triangle
    double widest;
    bool even;  // the same in all directions
};

struct Share {
    double value = 0, gx = 0, gy = 0, xx = 0, xy = 0, yy = 0;
};

// How much of a normal density about (x, y) lies in a flat: the winding number, less what lies beyond the outline.
Share share_of(const Shape& shape, const Flat& flat, double x, double y, const Whitening& W, bool with_slope) {
    Share share;
    const double reach = SEEN * W.widest;
    const bool near_x = x >= flat.lo[0] - reach && x <= flat.hi[0] + reach;
    const bool near_y = y >= flat.lo[1] - reach && y <= flat.hi[1] + reach;
    if (!near_x || !near_y) return share;  // nan is not near either
    double beyond = 0;
    int winding = 0;
    const int* starts = shape.bin_start.data() + flat.first_bin;
    const OutlineEdge* outline = shape.outlines.data() + flat.first_edge;
    const auto bin = [&](double v) {
        return static_cast<int>(std::clamp((v - flat.bin_lo) / flat.bin_step, 0.0, flat.bins - 1.0));
    };
    const int begin = bin(y - reach), end = bin(y + reach);
    for (int k = begin; k <= end; ++k)
        for (int i = starts[k]; i < starts[k + 1]; ++i) {
            const OutlineEdge& e = outline[shape.bin_edges[i]];
            if (k != std::max(e.first_bin, begin)) continue;  // seen in an earlier bin
            const double rx = e.x - x, ry = e.y - y, y1 = ry + e.dy * e.length;
            const double left = rx * e.dy - ry * e.dx;  // of the point from the edge, where it is inside
            // a point right on an edge is taken a little to the right of it, and above: inside for one of two flats
            const bool inside = left != 0 ? left > 0 : e.dy < 0 || (e.dy == 0 && e.dx > 0);
            if ((ry <= 0) != (y1 <= 0))  // crosses the line through the point to the right of it
                winding += y1 > 0 ? inside : -!inside;
            const double ax = W.a * rx, ay = W.b * rx + W.c * ry;
            double dx = e.dx, dy = e.dy, stretch = W.a;
            if (!W.even) {
                dx = W.a * e.dx;
                dy = W.b * e.dx + W.c * e.dy;
                stretch = std::sqrt(dx * dx + dy * dy);
                dx /= stretch;
                dy /= stretch;
            }
            const double h = ax * dy - ay * dx;
            if (std::fabs(h) > SEEN) continue;
            const double t1 = ax * dx + ay * dy, t2 = t1 + e.length * stretch;
            if (t1 > SEEN || t2 < -SEEN) continue;
            const double ah = std::fabs(h);
            const bool whole = t1 < -SEEN && t2 > SEEN;
            const double wedges = whole ? normal_below(-ah) : wedge(ah, t2) - wedge(ah, t1);
            beyond += inside ? wedges : -wedges;
            if (!with_slope) continue;
            const double m = normal_density(h) * (whole ? 1 : normal_below(t2) - normal_below(t1));
            share.gx -= dy * m;  // the inside is to the left: (-dy, dx)
            share.gy += dx * m;
            share.xx += dy * dy * h * m;
            share.xy -= dx * dy * h * m;
            share.yy += dx * dx * h * m;
        }
    share.value = std::clamp(winding - beyond, 0.0, 1.0);
    return share;
}

// Of a share: the gradient of its log, and its information, never negative, in the frame of the flat.
void log_share(Share& s) {
    const double inverse = 1 / s.value;
    s.gx *= inverse;
    s.gy *= inverse;
    const double xx = s.xx * inverse + s.gx * s.gx, xy = s.xy * inverse + s.gx * s.gy, yy = s.yy * inverse + s.gy * s.gy;
    const double mean = 0.5 * (xx + yy), spread = std::hypot(0.5 * (xx - yy), xy);
    const double l1 = std::max(mean + spread, 0.0), l2 = std::max(mean - spread, 0.0);
    if (!(spread > 0)) {
        s.xx = s.yy = l1;
        s.xy = 0;
        return;
    }
    const double c = 0.5 * (xx - yy) / spread, d = xy / spread;  // cosine and sine of twice the angle
    s.xx = 0.5 * (l1 + l2) + 0.5 * (l1 - l2) * c;
    s.yy = 0.5 * (l1 + l2) - 0.5 * (l1 - l2) * c;
    s.xy = 0.5 * (l1 - l2) * d;
}

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

Whitening whitening_of(double xx, double xy, double yy) {
    const double l = std::sqrt(std::max(xx, 1e-300)), m = xy / l;
    const double k = std::sqrt(std::max(yy - m * m, 1e-12 * (xx + yy) + 1e-300));
    return {1 / l, -m / (l * k), 1 / k, std::sqrt(0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy)), false};
}

}  // namespace

double Likelihood::at(const State& state, bool with_slope) {
    const int n = static_cast<int>(problem.points.size()), K = problem.size();
    hits.clear();
    seen.resize(n);
    for (int j = 0; j < n; ++j) look(state, j, with_slope);
    if (with_slope) {
        gradient.assign(K, 0.0);
        information.assign(static_cast<size_t>(K) * K, 0.0);
    }
    double log = combine();
    if (with_slope) add_points(state);
    log += add_rays(state);
    log += add_priors(state, with_slope);
    return log;
}

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

void Likelihood::look_at_faces(const Point& point, int j, const Mat3& R, const Mat3& C, bool with_slope) {
    const Vec3& p = seen[j].in_part;
    const double widest = std::sqrt(point.isotropic ? C(0, 0) : C(0, 0) + C(1, 1) + C(2, 2));
    const Vec3 d = point.directed ? transposed_times(R, point.direction) : Vec3{};
    const Vec3 m = point.oriented ? transposed_times(R, point.normal) : Vec3{};
    const double per_area = 1 / shape.area;
    const bool ball = point.radius > 0.5 * widest;
    double deepest = 0;
    const double nothing = NOTHING * problem.mean_rate;
    shape.flats_near(p, REACH * widest + point.radius, [&](int which) {
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
        const bool inside_ball = ball && r < -3 && plane.distance > -point.radius;
        if (std::fabs(r) > REACH && !inside_ball) return;
        double weight = per_area;
        if (point.directed) {
            const double cosine = -dot(n, d);
            weight = cosine > 0 ? std::max(cosine, GRAZING) : LOOKS_AWAY;
        }
        weight *= per_sd * fast_exp(-0.5 * r * r - HALF_LOG_TWO_PI - point.log_outlier);
        Hit hit;
        hit.tilted = 0;
        if (point.oriented) {
            hit.along = dot(n, m);
            hit.tilted = 1;
            hit.e[0] = plane.round ? plane.at.e[0] : flat.u;
            hit.e[1] = plane.round ? plane.at.e[1] : flat.v;
            double log = 0;
            for (int i = 0; i < 2; ++i) {
                hit.bend[i] = plane.round ? plane.at.bend[i] : 0;
                double var = point.normal_sd * point.normal_sd + blur_turn * blur_turn;
                if (hit.bend[i] != 0) var += hit.bend[i] * hit.bend[i] * dot(hit.e[i], C * hit.e[i]);
                hit.per_tilt[i] = 1 / std::sqrt(var);
                hit.tilt[i] = dot(hit.e[i], m) * hit.per_tilt[i];
                log -= 0.5 * hit.tilt[i] * hit.tilt[i];
            }
            weight *= hit.per_tilt[0] * hit.per_tilt[1] * fast_exp(log - 2 * HALF_LOG_TWO_PI);
            if (hit.along <= 0) weight *= BEHIND;
        }
        if (!(weight >= nothing) && !inside_ball) return;
        double ku = 0, kv = 0;
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
        if (inside_ball && share.value > 0.5) deepest = std::min(deepest, r + 3);
        hit.weight = weight * share.value;
        if (!(hit.weight >= nothing) || std::fabs(r) > REACH) return;
        hit.distance = gap;
        hit.per_sd = per_sd;
        hit.normal = n;
        hit.face = flat.face;
        if (with_slope) {
            hit.slope = {};
            hit.stiff = {};
            if (share.value < 1 - 1e-9) {
                hit.spread = -(share.xx + share.yy) / share.value;
                log_share(share);
                const Vec3 du = flat.u - ku * n, dv = flat.v - kv * n;
                const Vec3 x = W.a * du, y = W.b * du + W.c * dv;  // how the whitened place moves with the point
                hit.slope = share.gx * x + share.gy * y;
                add_outer(hit.stiff, share.xx, x, x);
                add_outer(hit.stiff, share.xy, x, y);
                add_outer(hit.stiff, share.xy, y, x);
                add_outer(hit.stiff, share.yy, y, y);
            }
        }
        hits.push_back(hit);
    });
    if (ball) look_over_edges(point, j, point.isotropic ? C(0, 0) : widest * widest / 3);
    if (deepest < 0) {  // the ball would be inside of another face
        const double factor = fast_exp(-0.5 * deepest * deepest);
        for (size_t k = seen[j].first; k < hits.size(); ++k) hits[k].weight *= factor;
    }
}

// A ball that touches a convex edge: its centre is on a cylinder about the edge, between the two faces.
void Likelihood::look_over_edges(const Point& point, int j, double variance) {
    const Vec3& p = seen[j].in_part;
    const double sd = std::sqrt(variance), per_sd = 1 / sd, nothing = NOTHING * problem.mean_rate;
    shape.convex_edges_near(p, REACH * sd + point.radius, [&](int which) {
        const ConvexEdge& e = shape.convex_edges[which];
        const Vec3 off = p - e.a;
        const double t = dot(off, e.direction);
        const Vec3 out = off - t * e.direction;
        const double far = norm(out), r = (far - point.radius) * per_sd;
        if (std::fabs(r) > REACH || far < 1e-12) return;
        const double h0 = -dot(out, e.inward[0]) * per_sd, h1 = -dot(out, e.inward[1]) * per_sd;
        if (dot(out, e.normal[0]) < 0 && dot(out, e.normal[1]) < 0) return;
        const double along = normal_below(t * per_sd) - normal_below((t - e.length) * per_sd);
        const double share = normal_below(h0) * normal_below(h1) * along;
        const double weight = share * per_sd / shape.area * fast_exp(-0.5 * r * r - HALF_LOG_TWO_PI - point.log_outlier);
        if (!(weight >= nothing)) return;
        Hit hit;
        hit.weight = weight;
        hit.distance = far - point.radius;
        hit.per_sd = per_sd;
        hit.normal = (1 / far) * out;
        hit.face = e.face;
        hit.tilted = 0;
        hit.slope = (-per_sd * normal_density(h0) / std::max(normal_below(h0), 1e-300)) * e.inward[0];
        hit.slope += (-per_sd * normal_density(h1) / std::max(normal_below(h1), 1e-300)) * e.inward[1];
        hit.slope += ((normal_density(t * per_sd) - normal_density((t - e.length) * per_sd)) * per_sd /
                      std::max(along, 1e-300)) * e.direction;
        hit.stiff = {};
        hits.push_back(hit);
    });
}

// A point that was sensed on a straight edge: normal about the edge, even along it.
void Likelihood::look_at_edges(const Point& point, int j, const Mat3& C) {
    const Vec3& p = seen[j].in_part;
    const double nothing = NOTHING * problem.mean_rate;
    for (size_t k = 0; k < shape.edges.size(); ++k) {
        const Segment& e = shape.edges[k];
        const Vec3 off = p - e.a, u = any_across(e.direction), v = cross(e.direction, u);
        const double uu = dot(u, C * u), uv = dot(u, C * v), vv = dot(v, C * v), det = uu * vv - uv * uv;
        const double x = dot(off, u), y = dot(off, v);
        Mat3 info;
        add_outer(info, vv / det, u, u);
        add_outer(info, -uv / det, u, v);
        add_outer(info, -uv / det, v, u);
        add_outer(info, uu / det, v, v);
        const double q = (vv * x * x - 2 * uv * x * y + uu * y * y) / det;
        if (q > REACH * REACH) continue;
        const double sd = std::sqrt(dot(e.direction, C * e.direction)), t = dot(off, e.direction);
        const double along = normal_below(t / sd) - normal_below((t - e.length) / sd);
        const double weight =
            along / shape.edge_length / std::sqrt(det) * fast_exp(-0.5 * q - 2 * HALF_LOG_TWO_PI - point.log_outlier);
        if (!(weight >= nothing)) continue;
        Hit hit;
        hit.weight = weight;
        hit.distance = std::hypot(x, y);
        hit.per_sd = hit.distance > 0 ? std::sqrt(q) / hit.distance : 1 / std::sqrt(uu);
        hit.normal = {};  // all of it is in slope and stiff
        hit.face = -2 - static_cast<int>(k);
        hit.tilted = 0;
        const double near = normal_density(t / sd), far = normal_density((t - e.length) / sd);
        hit.slope = -(info * off) + ((near - far) / sd / std::max(along, 1e-300)) * e.direction;
        hit.spread = (far * (t - e.length) - near * t) / sd / std::max(along, 1e-300);
        hit.stiff = info;
        hits.push_back(hit);
    }
}

void Likelihood::look_at_corners(const Point& point, int j, const Mat3& C) {
    const Vec3& p = seen[j].in_part;
    double L[9];
    std::memcpy(L, C.m, sizeof L);
    if (!cholesky(L, 3)) return;
    const double log_det = std::log(L[0] * L[4] * L[8]), nothing = NOTHING * problem.mean_rate;
    Mat3 info;
    for (int i = 0; i < 3; ++i) {
        double column[3] = {0, 0, 0};
        column[i] = 1;
        solve_cholesky(L, 3, column);
        for (int k = 0; k < 3; ++k) info(k, i) = column[k];
    }
    for (size_t k = 0; k < shape.corners.size(); ++k) {
        const Vec3 off = p - shape.corners[k], pull = info * off;
        const double q = dot(off, pull);
        if (q > REACH * REACH) continue;
        Hit hit;
        hit.weight = fast_exp(-0.5 * q - 3 * HALF_LOG_TWO_PI - log_det - point.log_outlier) / shape.corners.size();
        if (!(hit.weight >= nothing)) continue;
        hit.distance = norm(off);
        hit.per_sd = hit.distance > 0 ? std::sqrt(q) / hit.distance : 0;
        hit.normal = {};
        hit.face = -2 - static_cast<int>(shape.edges.size() + k);
        hit.tilted = 0;
        hit.slope = -pull;
        hit.stiff = info;
        hits.push_back(hit);
    }
}

// Whether the free path of a beam runs through the part, also a little beside it.
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

// All points together, the outlier rate integrated out; afterwards each hit has its share.
double Likelihood::combine() {
    const int n = static_cast<int>(problem.points.size()), nodes = static_cast<int>(problem.rates.size());
    double base = 0;
    for (const Point& point : problem.points) base += point.log_outlier;
    node_log.assign(nodes, 0.0);
    views.resize(problem.groups.size());
    for (size_t g = 0; g < views.size(); ++g) view_group(g);
    for (int k = 0; k < nodes; ++k) {
        const double rate = problem.rates[k];
        double product = 1, log = 0;
        for (int j = 0; j < n; ++j) {
            if (problem.points[j].group >= 0) continue;
            product *= (1 - rate) * seen[j].density + rate;
            if (product < 1e-200 || product > 1e200) {
                log += std::log(product);
                product = 1;
            }
        }
        for (size_t g = 0; g < problem.groups.size(); ++g) log += log_group(g, rate);
        node_log[k] = log + std::log(product) + std::log(problem.rate_weights[k]);
    }
    double top = -1e300, sum = 0;
    for (const double log : node_log) top = std::max(top, log);
    for (double& log : node_log) sum += log = std::exp(log - top);
    hit_share.assign(hits.size(), 0.0);
    for (int j = 0; j < n; ++j) {
        Seen& s = seen[j];
        s.belongs = 0;
        if (problem.points[j].group >= 0 || !s.count) continue;
        for (int k = 0; k < nodes; ++k) {
            const double on = (1 - problem.rates[k]) * s.density;
            s.belongs += node_log[k] / sum * on / (on + problem.rates[k]);
        }
        for (int k = s.first; k < s.first + s.count; ++k) hit_share[k] = s.belongs * hits[k].weight / s.density;
    }
    for (size_t g = 0; g < views.size(); ++g) {
        views[g].weights.assign(views[g].on_face.size() + problem.groups[g].size(), 0.0);
        for (int k = 0; k < nodes; ++k) share_group(g, problem.rates[k], node_log[k] / sum);
        share_hits(g);
    }
    return base + top + std::log(sum);
}

// Points that share one face: which faces they may have met, how probable each is beforehand, and how dense each point
// is on each of them. A point may contradict its label as often as it is an outlier.
void Likelihood::view_group(size_t g) {
    const std::vector<int>& rows = problem.groups[g];
    GroupView& view = views[g];
    view.faces.clear();
    view.log_prior.clear();
    view.factor.clear();
    bool by_area = false;
    for (const int j : rows) {
        const Point& point = problem.points[j];
        by_area = by_area || (point.kind == Kind::FACE && !point.directed);
        for (int k = seen[j].first; k < seen[j].first + seen[j].count; ++k)
            if (std::find(view.faces.begin(), view.faces.end(), hits[k].face) == view.faces.end())
                view.faces.push_back(hits[k].face);
    }
    const size_t F = view.faces.size();
    for (const int face : view.faces) {  // its share of all faces, edges or corners
        const size_t at = static_cast<size_t>(-2 - face);
        double share = 1.0 / std::max<size_t>(shape.corners.size(), 1);
        if (face >= 0)
            share = shape.face_area[face] / shape.area;
        else if (at < shape.edges.size())
            share = shape.edges[at].length / shape.edge_length;
        view.log_prior.push_back(face >= 0 && !by_area ? 0.0 : std::log(share));
        view.factor.push_back(1 / share);  // a density over all of them is that much larger over this one
    }
    view.on_face.assign(rows.size() * F, 0.0);
    for (size_t r = 0; r < rows.size(); ++r) {
        const Point& point = problem.points[rows[r]];
        const bool aimed = point.kind == Kind::FACE && point.directed;  // of which the face has no measure
        for (int k = seen[rows[r]].first; k < seen[rows[r]].first + seen[rows[r]].count; ++k) {
            const size_t f = std::find(view.faces.begin(), view.faces.end(), hits[k].face) - view.faces.begin();
            view.on_face[r * F + f] += hits[k].weight * (aimed ? 1.0 : view.factor[f]);
        }
    }
}

// Log density of the points of a group: the sum over faces of the product, and that the label means nothing.
double Likelihood::log_group(size_t g, double rate) {
    const std::vector<int>& rows = problem.groups[g];
    GroupView& view = views[g];
    const size_t F = view.faces.size();
    const double slip = problem.mean_rate;
    view.logs.assign(F + 1, 0.0);
    double top = -1e300, sum = 0;
    for (size_t f = 0; f <= F; ++f) {
        double log = f < F ? view.log_prior[f] : 0;
        for (size_t r = 0; r < rows.size(); ++r)
            log += std::log(labelled_density(view, r, f, seen[rows[r]].density, rate, slip));
        view.logs[f] = log;
        top = std::max(top, log);
    }
    for (double& log : view.logs) sum += log = std::exp(log - top);
    for (double& log : view.logs) log /= sum;  // now the probability of each face
    return top + std::log(sum);
}

// Density of a labelled point over that of an outlier if the label's face is this one; beyond the last: if it means
// nothing.
double Likelihood::labelled_density(const GroupView& view, size_t r, size_t f, double density, double rate, double slip) {
    const double on = f < view.faces.size() ? (1 - slip) * view.on_face[r * view.faces.size() + f] : 0.0;
    return (1 - rate) * (on + slip * density) + rate;
}

// Adds what a rate of that weight makes of each face's points: first by face, then whatever the face.
void Likelihood::share_group(size_t g, double rate, double weight) {
    log_group(g, rate);
    const std::vector<int>& rows = problem.groups[g];
    GroupView& view = views[g];
    const size_t F = view.faces.size();
    const double slip = problem.mean_rate;
    for (size_t r = 0; r < rows.size(); ++r)
        for (size_t f = 0; f <= F; ++f) {
            const double share =
                weight * view.logs[f] * (1 - rate) / labelled_density(view, r, f, seen[rows[r]].density, rate, slip);
            if (f < F) view.weights[r * F + f] += share * (1 - slip);
            view.weights[rows.size() * F + r] += share * slip;
        }
}

void Likelihood::share_hits(size_t g) {
    const std::vector<int>& rows = problem.groups[g];
    const GroupView& view = views[g];
    const size_t F = view.faces.size();
    for (size_t r = 0; r < rows.size(); ++r) {
        const Point& point = problem.points[rows[r]];
        const bool aimed = point.kind == Kind::FACE && point.directed;
        Seen& s = seen[rows[r]];
        for (int k = s.first; k < s.first + s.count; ++k) {
            const size_t f = std::find(view.faces.begin(), view.faces.end(), hits[k].face) - view.faces.begin();
            const double own = view.weights[r * F + f] * (aimed ? 1.0 : view.factor[f]);
            hit_share[k] = hits[k].weight * (own + view.weights[rows.size() * F + r]);
            s.belongs += hit_share[k];
        }
    }
}

// Gradient and information of all points: of each hit by the point and its normal, then by the states.
void Likelihood::add_points(const State& state) {
    const int n = static_cast<int>(problem.points.size()), D = problem.shared, K = problem.size();
    double J[3][MOST_STATES], BJ[6][MOST_STATES];
    for (int j = 0; j < n; ++j) {
        const Seen& s = seen[j];
        if (!s.count) continue;
        const Point& point = problem.points[j];
        Vec3 gp, gw;      // gradient by the point, and by the attitude through the normal
        Mat3 pp, pw, ww;  // information
        double by_scale = 0, of_scale = 0;
        for (int k = s.first; k < s.first + s.count; ++k) {
            const Hit& h = hits[k];
            const double w = hit_share[k];
            if (w < 1e-12) continue;
            const double r = h.distance * h.per_sd;
            const bool face = h.face >= 0;
            if (face) {
                gp += (-w * r * h.per_sd) * h.normal;
                add_outer(pp, w * h.per_sd * h.per_sd, h.normal, h.normal);
            }
            gp += w * h.slope;
            for (int i = 0; i < 9; ++i) pp.m[i] += w * h.stiff.m[i];
            const double scaled = 1 - (point.extra + blur * blur) * h.per_sd * h.per_sd;  // share of the variance
            by_scale += w * scaled * (r * r - (face ? 1 : point.kind == Kind::EDGE ? 2 : 3) + h.spread);
            of_scale += 2 * w * scaled * scaled;
            if (!h.tilted) continue;
            const Vec3 m = transposed_times(state.pose.R, point.normal);
            for (int i = 0; i < 2; ++i) {
                const Vec3 by_p = (-h.bend[i] * h.along * h.per_tilt[i]) * h.e[i];
                const Vec3 by_w = h.per_tilt[i] * cross(h.e[i], m);
                gp += (-w * h.tilt[i]) * by_p;
                gw += (-w * h.tilt[i]) * by_w;
                add_outer(pp, w, by_p, by_p);
                add_outer(pw, w, by_p, by_w);
                add_outer(ww, w, by_w, by_w);
            }
        }
        // the point moves by J: -v + y x w + R' G z
        const Vec3 y = s.in_part - shape.centre;
        const double H[9] = {0, -y.z, y.y, y.z, 0, -y.x, -y.y, y.x, 0};
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 3; ++k) {
                J[i][k] = i == k ? -1 : 0;
                J[i][3 + k] = H[3 * i + k];
            }
        if (D) {
            const double* G = problem.gain(j);
            for (int d = 0; d < D; ++d) {
                const Vec3 g = transposed_times(state.pose.R, {G[d], G[D + d], G[2 * D + d]});
                for (int i = 0; i < 3; ++i) J[i][6 + d] = g[i];
            }
        }
        const int P = 6 + D;
        for (int k = 0; k < P; ++k) {
            gradient[k] += gp.x * J[0][k] + gp.y * J[1][k] + gp.z * J[2][k];
            for (int i = 0; i < 3; ++i) {
                BJ[i][k] = pp(i, 0) * J[0][k] + pp(i, 1) * J[1][k] + pp(i, 2) * J[2][k];
                BJ[3 + i][k] = pw(0, i) * J[0][k] + pw(1, i) * J[1][k] + pw(2, i) * J[2][k];
            }
        }
        if (point.oriented)
            for (int k = 0; k < 3; ++k) {
                gradient[3 + k] += gw[k];
                for (int i = 0; i < 3; ++i) {
                    BJ[i][3 + k] += pw(i, k);
                    BJ[3 + i][3 + k] += ww(i, k);
                }
            }
        for (int a = 0; a < P; ++a)
            for (int b = 0; b <= a; ++b) {
                double sum = J[0][a] * BJ[0][b] + J[1][a] * BJ[1][b] + J[2][a] * BJ[2][b];
                if (point.oriented && a >= 3 && a < 6) sum += BJ[a][b];
                information[a * K + b] += sum;
            }
        if (problem.scale_sd > 0) {
            gradient[K - 1] += problem.scale_sd * by_scale;
            information[K * K - 1] += problem.scale_sd * problem.scale_sd * of_scale;
        }
    }
}

// Paths on which nothing was met; no gradient: a pose is in their way or it is not.
double Likelihood::add_rays(const State& state) {
    double log = 0;
    const int D = problem.shared;
    for (size_t k = 0; k < problem.rays.size(); ++k) {
        const FreeRay& ray = problem.rays[k];
        Vec3 origin = ray.origin, direction = ray.direction;
        for (int d = 0; d < D; ++d)
            for (int i = 0; i < 3; ++i) {
                origin[i] += problem.ray_shifts[(k * 3 + i) * D + d] * state.z[d];
                direction[i] += problem.ray_turns[(k * 3 + i) * D + d] * state.z[d];
            }
        const Vec3 start = into_part(state.pose, origin), along = transposed_times(state.pose.R, unit(direction));
        const double end = ray.length - 0.01 * shape.diagonal;
        const auto passes = [&](const Vec3& d) {
            int triangle = -1;
            if (shape.cast(start, d, end, &triangle) >= end) return true;
            return std::fabs(dot(shape.normals[triangle], d)) < ray.least_cosine - 1e-12;
        };
        double passed = passes(along) ? 1 : 0;
        if (passed == 0 && ray.slope > 0) {  // a cone: rays of equal moments with the disc, the middle one counts half
            const Vec3 u = any_across(along), v = cross(along, u);
            for (const Vec3& aside : {u, v, -u, -v})
                if (passes(unit(along + 2 * ray.slope * aside))) passed += 0.125;
        }
        log += std::log(problem.mean_rate + (1 - 2 * problem.mean_rate) * passed);
    }
    return log;
}

namespace {

// log of a rigid motion: xi with exp(xi) = (R, t), and how it follows a small motion from the right.
void log_motion(const Mat3& R, const Vec3& t, double xi[6], double J[36]) {
    const Vec3 w = rotation_vector(R);
    const double t2 = squared(w), angle = std::sqrt(t2);
    // V^-1 = I - W / 2 + c W^2
    const double c = angle < 1e-3 ? 1.0 / 12 + t2 / 720
                                  : (1 - 0.5 * angle * std::cos(0.5 * angle) / std::max(std::sin(0.5 * angle), 1e-300)) / t2;
    const Vec3 wt = cross(w, t), v = t - 0.5 * wt + c * cross(w, wt);
    store(v, xi);
    store(w, xi + 3);
    double ad[36] = {0}, power[36], next[36];
    const double hat_w[9] = {0, -w.z, w.y, w.z, 0, -w.x, -w.y, w.x, 0};
    const double hat_v[9] = {0, -v.z, v.y, v.z, 0, -v.x, -v.y, v.x, 0};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            ad[6 * i + j] = ad[6 * (3 + i) + 3 + j] = hat_w[3 * i + j];
            ad[6 * i + 3 + j] = hat_v[3 * i + j];
        }
    const double series[9] = {1, 0.5, 1.0 / 12, 0, -1.0 / 720, 0, 1.0 / 30240, 0, -1.0 / 1209600};  // Bernoulli
    for (int i = 0; i < 36; ++i) power[i] = J[i] = i % 7 == 0 ? 1 : 0;
    for (int k = 1; k < 9; ++k) {
        for (int i = 0; i < 6; ++i)
            for (int j = 0; j < 6; ++j) {
                next[6 * i + j] = 0;
                for (int l = 0; l < 6; ++l) next[6 * i + j] += power[6 * i + l] * ad[6 * l + j];
            }
        std::memcpy(power, next, sizeof power);
        for (int i = 0; i < 36; ++i) J[i] += series[k] * power[i];
    }
}

}  // namespace

// Shared errors and noise scale are unit normal; the pose has a mixture of normal densities; the part stands on a table.
double Likelihood::add_priors(const State& state, bool with_slope) {
    const int K = problem.size();
    double log = 0;
    for (int k = 6; k < K; ++k) {
        log -= 0.5 * state.z[k - 6] * state.z[k - 6];
        if (!with_slope) continue;
        gradient[k] -= state.z[k - 6];
        information[k * K + k] += 1;
    }
    const auto add = [&](double share, const double* r, const double* rows, int count) {  // rows by v, w at the centre
        for (int i = 0; i < count; ++i)
            for (int a = 0; a < 6; ++a) {
                gradient[a] -= share * r[i] * rows[6 * i + a];
                for (int b = 0; b <= a; ++b) information[a * K + b] += share * rows[6 * i + a] * rows[6 * i + b];
            }
    };
    if (!problem.priors.empty()) {
        const size_t count = problem.priors.size();
        std::vector<double> logs(count), r(6 * count), rows(with_slope ? 36 * count : 0);
        double top = -1e300, sum = 0;
        for (size_t k = 0; k < count; ++k) {
            const PosePrior& prior = problem.priors[k];
            double xi[6], J[36];
            log_motion(transposed(prior.mean.R) * state.pose.R,
                       transposed_times(prior.mean.R, state.pose.t - prior.mean.t), xi, J);
            double q = 0;
            for (int i = 0; i < 6; ++i) {
                double& ri = r[6 * k + i];
                for (int a = 0; a < 6; ++a) ri += prior.root[6 * i + a] * xi[a];
                q += ri * ri;
            }
            logs[k] = prior.log_weight - 0.5 * q;
            top = std::max(top, logs[k]);
            if (!with_slope) continue;
            // a motion (v, w) about the centre c is (v + c x w, w) about the origin
            const Vec3& c = shape.centre;
            const double hat[9] = {0, -c.z, c.y, c.z, 0, -c.x, -c.y, c.x, 0};
            for (int i = 0; i < 6; ++i) {
                double LJ[6] = {0};
                for (int a = 0; a < 6; ++a)
                    for (int b = 0; b < 6; ++b) LJ[b] += prior.root[6 * i + a] * J[6 * a + b];
                double* row = &rows[36 * k + 6 * i];
                for (int b = 0; b < 3; ++b) {
                    row[b] = LJ[b];
                    row[3 + b] = LJ[3 + b];
                    for (int a = 0; a < 3; ++a) row[3 + b] += LJ[a] * hat[3 * a + b];
                }
            }
        }
        for (const double l : logs) sum += std::exp(l - top);
        log += top + std::log(sum);
        if (with_slope)
            for (size_t k = 0; k < count; ++k) {
                const double share = std::exp(logs[k] - top) / sum;
                if (share > 1e-9) add(share, &r[6 * k], &rows[36 * k], 6);
            }
    }
    if (problem.has_table) {
        const Vec3 n = transposed_times(state.pose.R, problem.table.normal);
        double least = 1e300;
        Vec3 lowest;
        for (const Vec3& v : shape.hull) {
            const double height = dot(n, v);
            if (height < least) {
                least = height;
                lowest = v;
            }
        }
        const double gap = least + dot(state.pose.t - problem.table.point, problem.table.normal);
        const double r = gap / problem.table.sd;
        log -= 0.5 * r * r;
        if (with_slope) {
            double row[6];
            store((1 / problem.table.sd) * n, row);
            store((1 / problem.table.sd) * cross(lowest - shape.centre, n), row + 3);
            add(1, &r, row, 1);
        }
    }
    return log;
}

}  // namespace tanteo
