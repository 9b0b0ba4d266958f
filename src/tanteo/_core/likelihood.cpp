// All measurements together: outliers, labels, then gradient and information. What a point may have met is in look.cpp
// and sharp.cpp, rays and priors are in prior.cpp; docs/engine.md has the formulas.
#include "likelihood.hpp"

#include <cmath>

namespace tanteo {

constexpr double LEAST_CURVED = 0.25;  // of what is expected: steps of the noise scale are no longer then

double Likelihood::at(const State& state, bool with_slope) {
    const int n = static_cast<int>(problem.points.size()), K = problem.size();
    hits.clear();
    seen.resize(n);
    for (int j = 0; j < n; ++j)
        if (left_out(j))
            seen[j] = {};
        else
            look(state, j, with_slope);
    if (with_slope) {
        gradient.assign(K, 0.0);
        information.assign(static_cast<size_t>(K) * K, 0.0);
    }
    double log = log_points = combine();
    if (with_slope) {
        add_points(state);
        if (problem.scale_sd > 0 && blur == 0) of_points = information;
    }
    log += add_rays(state);
    log += add_priors(state, with_slope);
    const Slope slope{shape.centre, K, gradient.data(), information.data()};
    for (const auto& term : problem.terms) log += term->add(state, with_slope ? &slope : nullptr);
    return log;
}

// All points together, the outlier rate of those without label integrated out; afterwards each hit has its share. A label counts where nothing
// is blurred: a face that is only near must not be shut out while a maximum is on its way.
double Likelihood::combine() {
    const bool labels = blur == 0;
    const size_t groups = labels ? problem.groups.size() : 0;
    const int n = static_cast<int>(problem.points.size()), nodes = static_cast<int>(problem.rates.size());
    double base = 0;
    for (const Point& point : problem.points) base += point.log_outlier;
    node_log.assign(nodes, 0.0);
    views.resize(groups);
    for (size_t g = 0; g < views.size(); ++g) view_group(g);
    for (int k = 0; k < nodes; ++k) {
        const double rate = problem.rates[k];
        double product = 1, log = 0;
        for (int j = 0; j < n; ++j) {
            if (left_out(j) || (labels && problem.points[j].group >= 0)) continue;
            product *= (1 - rate) * seen[j].density + rate + problem.points[j].furniture;
            if (product < 1e-200 || product > 1e200) {
                log += std::log(product);
                product = 1;
            }
        }
        node_log[k] = log + std::log(product) + std::log(problem.rate_weights[k]);
    }
    double top = -1e300, sum = 0;
    for (const double log : node_log) top = std::max(top, log);
    for (double& log : node_log) sum += log = std::exp(log - top);
    hit_share.assign(hits.size(), 0.0);
    for (int j = 0; j < n; ++j) {
        Seen& s = seen[j];
        s.belongs = 0;
        if ((labels && problem.points[j].group >= 0) || !s.count) continue;
        for (int k = 0; k < nodes; ++k) {
            const double on = (1 - problem.rates[k]) * s.density;
            s.belongs += node_log[k] / sum * on / (on + problem.rates[k] + problem.points[j].furniture);
        }
        for (int k = s.first; k < s.first + s.count; ++k) hit_share[k] = s.belongs * hits[k].weight / s.density;
    }
    for (size_t g = 0; g < views.size(); ++g) {
        base += log_group(g);
        share_group(g);
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
        by_area = by_area || (point.on_face() && !point.directed);
        for (int k = seen[j].first; k < seen[j].first + seen[j].count; ++k)
            if (may_be_of(point, hits[k].face) &&
                std::find(view.faces.begin(), view.faces.end(), hits[k].face) == view.faces.end())
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
        const bool aimed = point.on_face() && point.directed;  // of which the face has no measure
        for (int k = seen[rows[r]].first; k < seen[rows[r]].first + seen[rows[r]].count; ++k) {
            const size_t f = std::find(view.faces.begin(), view.faces.end(), hits[k].face) - view.faces.begin();
            if (f < F) view.on_face[r * F + f] += hits[k].weight * (aimed ? 1.0 : view.factor[f]);
        }
    }
}

// Log density of the points of a group: the sum over faces of the product, that the label means nothing, and that what it
// names is not of the part. Such labels, and outliers among labelled points, are as rare as is stated: a sensor may make
// many outliers, but nobody gives many labels that contradict each other.
double Likelihood::log_group(size_t g, bool anywhere) {
    const std::vector<int>& rows = problem.groups[g];
    GroupView& view = views[g];
    const size_t F = view.faces.size();
    const double rare = problem.mean_rate;
    view.logs.assign(F + 2, 0.0);
    double top = -1e300, sum = 0;
    for (size_t f = 0; f <= F; ++f) {
        double log = f < F ? view.log_prior[f] : 0;
        for (size_t r = 0; r < rows.size(); ++r)
            log += std::log(labelled_density(view, r, f, rows[r]));
        view.logs[f] = log + std::log1p(-rare);
        top = std::max(top, view.logs[f]);
    }
    view.logs[F + 1] = anywhere ? std::log(rare) + problem.log_elsewhere[g] : -1e300;
    top = std::max(top, view.logs[F + 1]);
    for (double& log : view.logs) sum += log = std::exp(log - top);
    for (double& log : view.logs) log /= sum;  // now the probability of each face
    return top + std::log(sum);
}

// Density of a labelled point over that of an outlier if the label's face is this one; beyond the last: if it means
// nothing.
double Likelihood::labelled_density(const GroupView& view, size_t r, size_t f, int row) const {
    const double rare = problem.mean_rate, density = seen[row].density;
    const double on = f < view.faces.size() ? (1 - rare) * view.on_face[r * view.faces.size() + f] : 0.0;
    return (1 - rare) * (on + rare * density) + rare + problem.points[row].furniture;
}

// How much each point counts by face, then whatever the face; after log_group.
void Likelihood::share_group(size_t g) {
    const std::vector<int>& rows = problem.groups[g];
    GroupView& view = views[g];
    const size_t F = view.faces.size();
    const double rare = problem.mean_rate;
    view.weights.assign(rows.size() * (F + 1), 0.0);
    for (size_t r = 0; r < rows.size(); ++r)
        for (size_t f = 0; f <= F; ++f) {
            const double share = view.logs[f] * (1 - rare) / labelled_density(view, r, f, rows[r]);
            if (f < F) view.weights[r * F + f] += share * (1 - rare);
            view.weights[rows.size() * F + r] += share * rare;
        }
}

void Likelihood::share_hits(size_t g) {
    const std::vector<int>& rows = problem.groups[g];
    const GroupView& view = views[g];
    const size_t F = view.faces.size();
    for (size_t r = 0; r < rows.size(); ++r) {
        const Point& point = problem.points[rows[r]];
        const bool aimed = point.on_face() && point.directed;
        Seen& s = seen[rows[r]];
        for (int k = s.first; k < s.first + s.count; ++k) {
            const size_t f = std::find(view.faces.begin(), view.faces.end(), hits[k].face) - view.faces.begin();
            const double own = f < F ? view.weights[r * F + f] * (aimed ? 1.0 : view.factor[f]) : 0.0;
            hit_share[k] = hits[k].weight * (own + view.weights[rows.size() * F + r]);
            s.belongs += hit_share[k];
        }
    }
}

namespace {

// What one point adds: by its place p in the part, by the attitude w through a sensed normal, by the log of the noise.
struct PointSlope {
    Vec3 p, w;
    Mat3 pp, pw, ww;
    double by_scale = 0, of_scale = 0, expected = 0, scaled = 0;

    void add(const PointSlope& other) {
        p += other.p;
        w += other.w;
        for (int i = 0; i < 9; ++i) pp.m[i] += other.pp.m[i], pw.m[i] += other.pw.m[i], ww.m[i] += other.ww.m[i];
        by_scale += other.by_scale;
        of_scale += other.of_scale;
        expected += other.expected;
        scaled += other.scaled;
    }
};

inline void add_hit(PointSlope& sum, const Hit& h, const Point& point, double weight, double unscaled, const Vec3& m) {
    const double r = h.distance * h.per_sd;
    const bool face = h.face >= 0;
    if (face) {
        sum.p += (-weight * r * h.per_sd) * h.normal;
        add_outer(sum.pp, weight * h.per_sd * h.per_sd, h.normal, h.normal);
    }
    sum.p += weight * h.slope;
    const Mat3 stiff = h.tilted ? not_negative(h.stiff) : h.stiff;  // with w, what a tilt adds is not negative by itself
    for (int i = 0; i < 9; ++i) sum.pp.m[i] += weight * stiff.m[i];
    const double scaled = 1 - unscaled * h.per_sd * h.per_sd;  // share of the variance that the noise scale scales
    const double across = face ? 1 : point.kind == Kind::EDGE || point.kind == Kind::CENTRE ? 2 : 3;
    sum.scaled += weight * scaled;
    sum.by_scale += weight * scaled * (r * r - across + h.spread);
    sum.of_scale += 2 * weight * scaled * scaled * r * r;
    sum.expected += 2 * weight * scaled * scaled * across;
    if (!h.tilted) return;
    for (int i = 0; i < 2; ++i) {
        const Vec3 by_p = (-h.bend[i] * h.along * h.per_tilt[i]) * h.e[i];
        const Vec3 by_w = h.per_tilt[i] * cross(h.e[i], m);
        sum.p += (-weight * h.tilt[i]) * by_p;
        sum.w += (-weight * h.tilt[i]) * by_w;
        add_outer(sum.pp, weight, by_p, by_p);
        add_outer(sum.pw, weight, by_p, by_w);
        add_outer(sum.ww, weight, by_w, by_w);
    }
}

// All that a point may have met. The facets of one face pull a point to their middles, but do not hold it there: their
// information is that of the mixture, less than the mean of theirs by how much they differ.
PointSlope slope_of(const Hit* hits, const double* shares, std::vector<int>& order, const Point& point, double unscaled,
                    const Vec3& m) {
    PointSlope sum;
    std::sort(order.begin(), order.end(), [&](int a, int b) { return hits[a].face < hits[b].face; });
    for (size_t first = 0, next; first < order.size(); first = next) {
        PointSlope own;
        Mat3 pulls;
        double weight = 0;
        for (next = first; next < order.size() && hits[order[next]].face == hits[order[first]].face; ++next) {
            const int k = order[next];
            const Vec3 before = own.p;
            add_hit(own, hits[k], point, shares[k], unscaled, m);
            const Vec3 pull = own.p - before;
            add_outer(pulls, 1 / shares[k], pull, pull);
            weight += shares[k];
        }
        if (!hits[order[first]].tilted) {
            if (next - first > 1) {
                for (int i = 0; i < 9; ++i) own.pp.m[i] -= pulls.m[i];
                add_outer(own.pp, 1 / weight, own.p, own.p);
            }
            own.pp = not_negative(own.pp);
        }
        sum.add(own);
    }
    return sum;
}

// From a point to the states: its place in the part moves by J = (-1, y x, R' G) with them, y being from the centre.
void add_states(const PointSlope& s, const Vec3& y, const Mat3& R, const Problem& problem, int j, double* gradient,
                double* information) {
    const int D = problem.shared, K = problem.size(), P = 6 + D;
    const bool oriented = problem.points[j].oriented;
    double J[3][MOST_STATES], BJ[6][MOST_STATES];
    const double H[9] = {0, -y.z, y.y, y.z, 0, -y.x, -y.y, y.x, 0};
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < 3; ++k) {
            J[i][k] = i == k ? -1 : 0;
            J[i][3 + k] = H[3 * i + k];
        }
    const double* G = D ? problem.gain(j) : nullptr;
    for (int d = 0; d < D; ++d) {
        const Vec3 g = transposed_times(R, {G[d], G[D + d], G[2 * D + d]});
        for (int i = 0; i < 3; ++i) J[i][6 + d] = g[i];
    }
    for (int k = 0; k < P; ++k) {
        gradient[k] += s.p.x * J[0][k] + s.p.y * J[1][k] + s.p.z * J[2][k];
        for (int i = 0; i < 3; ++i) {
            BJ[i][k] = s.pp(i, 0) * J[0][k] + s.pp(i, 1) * J[1][k] + s.pp(i, 2) * J[2][k];
            BJ[3 + i][k] = s.pw(0, i) * J[0][k] + s.pw(1, i) * J[1][k] + s.pw(2, i) * J[2][k];
        }
    }
    if (oriented)
        for (int k = 0; k < 3; ++k) {
            gradient[3 + k] += s.w[k];
            for (int i = 0; i < 3; ++i) {
                BJ[i][3 + k] += s.pw(i, k);
                BJ[3 + i][3 + k] += s.ww(i, k);
            }
        }
    for (int a = 0; a < P; ++a)
        for (int b = 0; b <= a; ++b) {
            double sum = J[0][a] * BJ[0][b] + J[1][a] * BJ[1][b] + J[2][a] * BJ[2][b];
            if (oriented && a >= 3 && a < 6) sum += BJ[a][b];
            information[a * K + b] += sum;
        }
}

}  // namespace

// Gradient and information of all points: of each hit by the point and its normal, then by the states.
void Likelihood::add_points(const State& state) {
    double scaled = 0, weight = 0, of_scale = 0, expected = 0;
    for (size_t j = 0; j < problem.points.size(); ++j) {
        const Seen& s = seen[j];
        if (!s.count) continue;
        const Point& point = problem.points[j];
        const Vec3 m = point.oriented ? transposed_times(state.pose.R, point.normal) : Vec3{};
        order.clear();
        for (int k = s.first; k < s.first + s.count; ++k)
            if (hit_share[k] >= 1e-12) order.push_back(k);
        const PointSlope sum = slope_of(hits.data(), hit_share.data(), order, point, point.extra + blur * blur, m);
        add_states(sum, s.in_part - shape.centre, state.pose.R, problem, static_cast<int>(j), gradient.data(),
                   information.data());
        if (problem.scale_sd > 0 && blur == 0) {  // blurred, the noise is no one's
            scaled += sum.scaled;
            weight += s.belongs;
            gradient.back() += problem.scale_sd * sum.by_scale;
            of_scale += sum.of_scale;
            expected += sum.expected;
        }
    }
    // the curvature by the log of the scale, which is next to none where the scale is far too large
    if (problem.scale_sd > 0 && blur == 0)
        information.back() += problem.scale_sd * problem.scale_sd * std::max(of_scale, LEAST_CURVED * expected);
    scaled_share = weight > 0 ? scaled / weight : 0;
}

}  // namespace tanteo
