// The range of a device with a wide beam, by what it reports of its cone: one random ray, the nearest surface, the mean of
// all rays, or the surface that returns most.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <stdexcept>

#include "factors/on_surface.hpp"
#include "factors/visible.hpp"
#include "normal.hpp"

namespace tanteo {

namespace {

// What chose these numbers: seed 71 of benchmarks/wide_cones.py, a few scenes of it; WEIGHT_SD is smaller than the
// difference of even and signal weights (0.2 to 0.3 of the spread), which are two models.
constexpr int FEW_RAYS = 31, MANY_RAYS = RayPattern::MOST;  // numbers of rays that are tried for a random ray
constexpr int OVER_FURNITURE = 63;  // rays that fill the cone over furniture alone
// The number of hits that a random ray needs is that at which the error of their mean is RASTER standard deviations of the
// noise. The error is RAYS_ERROR times the spread over their number (rms over 120 cones and eight parts: 1.6 to 1.8).
constexpr double FEWEST = 8, MOST_WANTED = 30, RASTER = 0.2, RAYS_ERROR = 1.7;
constexpr double EDGE_SD = 0.05;    // relative standard deviation of the half angle: sensitivity fades at the edge
constexpr double WEIGHT_SD = 0.03;  // of the mean over rays, over their spread: the reflectance of each place is unknown
constexpr int STRONGER = 4;         // power of the signal to which a surface is the strongest
constexpr double SAME = 0.3;        // difference in standard deviations up to which echoes of one face are one component

// Moments of ranges: sums of weights, of weighted ranges and of their squares.
struct Moments {
    double weight = 0, first = 0, second = 0;
    void add(double w, double range) {
        weight += w;
        first += w * range;
        second += w * range * range;
    }
    double mean() const { return first / weight; }
    double spread() const { return std::max(second / weight - mean() * mean(), 0.0); }
};

double signal_of(double cosine, double range) { return cosine / (range * range); }

// Furniture in the cone, as a plane: what it returns to the rays that the part does not block, by number and by signal.
struct Background {
    Vec3 normal;        // in the part frame; zero without furniture
    double height = 0;  // of the origin of the cone
    Moments free[2];    // even, and by signal

    bool exists() const { return squared(normal) > 0; }

    // The range at which the ray along a unit vector hits it; 0 for none.
    double range(const Vec3& ray) const {
        const double cosine = -dot(normal, ray);
        return cosine > 1e-3 ? height / cosine : 0;
    }
    // Takes away what the part blocks along a ray.
    void block(const Vec3& ray, double share) {
        const double r = range(ray);
        if (!(r > 0)) return;
        free[0].add(-share, r);
        free[1].add(-share * signal_of(-dot(normal, ray), r), r);
    }
};

}  // namespace

// p(range | pose) = sum over responses of share * N(range; predicted range, variance). The place of the factor is on the
// axis at the range; the axis is its sensed direction, so that both move with shared errors.
class ConeRange final : public OnSurface {
  public:
    void evaluate(const Placement& placement, Components& out) const override;
    int codimension() const override { return 1; }
    bool aimed() const override { return true; }
    bool has_models() const override { return is_open() || of_mean > 0; }
    double rough_cost(const Shape& shape, const Pose& pose, double blur, double tilt) const override;
    NearestElement nearest(const Shape& shape, const Pose& pose, const Vec3& p, bool coarse) const override;

    void fill(const Columns& columns, size_t row) {
        OnSurface::fill(columns, row);
        direction = inward;
        aims = true;
        range = columns.number("ranges", row, 0, 1e300);
        half_angle = columns.number("half_angles", row, 0, 1.5);
        least_cosine = std::cos(columns.number("max_incidences", row, 0, 0.5 * PI));
        of_rays = columns.number("of_rays", row, 0, 1);
        of_nearest = columns.number("of_nearest", row, 0, 1);
        of_mean = columns.number("of_mean", row, 0, 1);
        of_strongest = columns.number("of_strongest", row, 0, 1);
        furniture = columns.vector("furniture_normals", row);
        furniture_offset = columns.number("furniture_offsets", row, -1e300, 1e300);
        const double slope = std::tan(half_angle);
        half_u = columns.vector("half_widths", row);
        half_v = columns.vector("half_heights", row);
        round = !(squared(half_u) > 0 && squared(half_v) > 0);
        if (round) half_u = slope * any_across(direction), half_v = cross(direction, half_u);
        const double corner = std::sqrt(squared(half_u) + squared(half_v) + 2 * std::fabs(dot(half_u, half_v)));
        widest = round ? half_angle : std::atan(corner);
        if (!(dot(cross(half_u, half_v), direction) > 0) && slope > 0)
            throw std::invalid_argument("half_widths, half_heights: expected right-handed axes about the beam.");
        if (!(squared(furniture) > 0)) return;
        const Vec3 origin = at - range * direction;
        const double height = dot(furniture, origin) - furniture_offset;
        const RayPattern& pattern = RayPattern::of(OVER_FURNITURE, round);
        for (int k = 0; k < OVER_FURNITURE; ++k) {
            const Vec3 ray = unit(direction + static_cast<double>(pattern.x[k]) * half_u + static_cast<double>(pattern.y[k]) * half_v);
            const double cosine = -dot(furniture, ray);
            if (!(cosine > 1e-3)) continue;
            furniture_returns[0].add(1.0 / OVER_FURNITURE, height / cosine);
            furniture_returns[1].add(signal_of(cosine, height / cosine) / OVER_FURNITURE, height / cosine);
        }
        furniture_along = height / std::max(-dot(furniture, direction), 1e-3);
    }

  private:
    double range = 0, half_angle = 0, least_cosine = 0;
    Vec3 half_u, half_v;  // half axes of the section of the beam at distance one, in the world
    bool round = true;    // whether the section is an ellipse and no parallelogram
    double widest = 0;    // half angle of the cone that holds the beam
    double of_rays = 0, of_nearest = 0, of_mean = 0, of_strongest = 0;  // probability of each response
    Vec3 furniture;                // outward normal of furniture in the cone, in the world; zero for none
    double furniture_offset = 0;   // of its plane along the normal
    double furniture_along = 0;    // its range along the axis
    Moments furniture_returns[2];  // what it returns to one ray, by number and by signal

    // Whether the response is unknown: a model of its own for each, which all readings of the problem share. So have the
    // weights of a mean: even, or by the returned signal.
    bool is_open() const { return of_nearest > 0 && of_nearest < 1; }
    void predict(const Placement& at, double variance) const;
    void keep(const Placement& at, const ConeEcho& echo, double share, double more, int model) const;
    void add(const Component& predicted, double noise, double negligible, size_t first, Components& out) const;
    void predict_nearest(const Placement& at, const Cone& cone, const std::vector<int>& triangles) const;
    void predict_rays(const Placement& at, const Section& section, const std::vector<int>& triangles, const Vec3& origin, double variance) const;
    void predict_means(const Placement& at, const Section& section, const std::vector<int>& triangles, const Vec3& origin) const;
    double reach(double sd) const { return range + REACH * sd; }
    static Vec3 by_axis(const RayHit& hit, const Vec3& axis);
    Background background(const Placement& at, const Vec3& axis, double rays) const;
};

// What the furniture returns to a number of rays that fill the cone. Its moments are those at the sensed pose, moved with
// the range along the axis.
Background ConeRange::background(const Placement& at, const Vec3& axis, double rays) const {
    Background out;
    if (!(squared(furniture) > 0)) return out;
    out.normal = transposed_times(at.R, furniture);
    out.height = dot(furniture, at.world) - furniture_offset - range * dot(out.normal, axis);
    const double along = out.range(axis), more = along > 0 ? along - furniture_along : 0;
    for (int k = 0; k < 2; ++k) {
        const Moments& one = furniture_returns[k];
        out.free[k] = {rays * one.weight, rays * (one.first + more * one.weight),
                       rays * (one.second + 2 * more * one.first + more * more * one.weight)};
    }
    return out;
}

// The derivative of the range of a ray by the axis, as the beam turns without rotation about it.
Vec3 ConeRange::by_axis(const RayHit& hit, const Vec3& axis) {
    return (hit.range / (hit.cosine * hit.length())) * (hit.normal - dot(hit.normal, axis) * hit.along);
}

// Keeps an echo with its probability; `more` is the variance that does not depend on the noise.
void ConeRange::keep(const Placement& at, const ConeEcho& echo, double share, double more, int model) const {
    Component c;
    c.unscaled = more;
    c.distance = echo.range - range;
    c.weight = share;
    c.element = at.shape.faces[echo.triangle];
    c.model = has_models() ? model : -1;
    c.normal = echo.by_origin;
    c.turns = true;
    c.by_turn = echo.by_axis - range * echo.by_origin;
    at.predicted->push_back(c);
}

// Adds a component, or its share to an equal one. The variance is that of the noise, and more that does not depend on it.
void ConeRange::add(const Component& predicted, double noise, double negligible, size_t first, Components& out) const {
    const double per_sd = 1 / std::sqrt(noise + predicted.unscaled), r = predicted.distance * per_sd;
    if (!(std::fabs(r) < REACH)) return;
    const double weight = predicted.weight * per_sd * fast_exp(-0.5 * r * r - HALF_LOG_TWO_PI - log_outlier);
    if (!(weight >= negligible)) return;
    for (size_t k = first; k < out.size(); ++k) {
        Component& other = out.all[k];
        if (other.element != predicted.element || other.model != predicted.model ||
            std::fabs(other.distance - predicted.distance) * per_sd > SAME)
            continue;
        const double sum = other.weight + weight, own = weight / sum;
        other.distance += own * (predicted.distance - other.distance);
        other.normal += own * (predicted.normal - other.normal);
        other.by_turn += own * (predicted.by_turn - other.by_turn);
        other.weight = sum;
        return;
    }
    out.all.push_back(predicted);
    out.all.back().weight = weight;
    out.all.back().per_sd = per_sd;
}

void ConeRange::evaluate(const Placement& at, Components& out) const {
    const double variance = dot(at.m, at.C * at.m);
    const size_t first = out.size();
    if (!at.is_known) {
        at.predicted->clear();
        predict(at, variance);
    }
    for (const Component& one : *at.predicted) add(one, variance, at.negligible, first, out);
}

void ConeRange::predict(const Placement& at, double variance) const {
    // there was an echo: only the nearest surface must face the device, as other responses weaken with the incidence
    const Cone cone{at.p - range * at.m, at.m, half_angle, 0};
    Cone about{cone.origin, cone.axis, std::min(half_angle * (1 + 1.74 * EDGE_SD), 1.55), least_cosine};
    if (of_nearest < 1) about.half_angle = std::max(about.half_angle, widest);
    const bool all = of_mean + of_strongest > 0;  // surfaces behind the reported range count, too
    const std::vector<int> triangles = triangles_in(at.shape, about, all ? 1e150 : reach(std::sqrt(variance)));
    if (triangles.empty()) return;
    if (of_nearest > 0) predict_nearest(at, about, triangles);
    if (!(of_nearest < 1)) return;
    const auto across = [&](const Vec3& half) {  // in the world the rays turn with the sensor
        const Vec3 own = transposed_times(at.R, half);
        return own - dot(own, cone.axis) * cone.axis;
    };
    const Section section{cone.axis, across(half_u), across(half_v), round};
    if (of_rays > 0) predict_rays(at, section, triangles, cone.origin, variance);
    if (all) predict_means(at, section, triangles, cone.origin);
}

// The half angle is uncertain: three nodes of Gauss and Hermite, which the nearest echo shares if it is inside all of them.
void ConeRange::predict_nearest(const Placement& at, const Cone& about, const std::vector<int>& triangles) const {
    const double nodes[3] = {1 + 1.732 * EDGE_SD, 1, 1 - 1.732 * EDGE_SD}, weights[3] = {1. / 6, 2. / 3, 1. / 6};
    Cone cone = about;
    ConeEcho echo;
    double left = 1;
    for (int k = 0; k < 3; ++k) {
        cone.half_angle = std::min(half_angle * nodes[k], 1.55);
        echo = nearest_in(at.shape, triangles, cone);
        if (echo.triangle < 0) return;
        const bool last = dot(echo.ray, cone.axis) > std::cos(half_angle * nodes[2]);
        keep(at, echo, of_nearest * (last ? left : weights[k]), 0, 1);
        if (last) return;
        left -= weights[k];
    }
}

// Rays that fill the section, or where the part covers less than half of it, the part. The place of a random ray is known to
// one cell of the raster, so that few rays suffice.
void ConeRange::predict_rays(const Placement& at, const Section& section, const std::vector<int>& triangles,
                             const Vec3& origin, double variance) const {
    const Seen seen(at.shape, triangles, origin, section);
    thread_local std::vector<RayHit> hits;
    const bool whole = seen.covered() > 0.5;
    double rays = 1;  // that would fill the section
    for (const int count : {FEW_RAYS, MANY_RAYS}) {
        seen.cast(RayPattern::of(count, round), whole, hits);
        rays = count / (whole ? 1.0 : std::max(seen.covered(), 1e-9));
        Moments all;
        for (const RayHit& hit : hits) all.add(1, hit.range);
        const double error = hits.empty() ? 0 : RAYS_ERROR * std::sqrt(all.spread() / variance);
        if (static_cast<double>(hits.size()) >= std::clamp(error / RASTER, FEWEST, MOST_WANTED)) break;
    }
    Background other = background(at, section.axis, rays);
    for (const RayHit& hit : hits)
        if (other.exists()) other.block((1 / hit.length()) * hit.along, 1);
    const double beyond = std::max(other.free[0].weight, 0.0), slope = std::tan(half_angle);
    for (const RayHit& hit : hits) {
        // a ray stands for its cell of the cone, in which the range varies with the incidence; there was an echo
        const double tangent2 = 1 / (hit.cosine * hit.cosine) - 1, cell = hit.range * slope * 0.5;
        ConeEcho echo;
        echo.range = hit.range;
        echo.triangle = hit.triangle;
        echo.by_origin = (1 / hit.cosine) * hit.normal;
        echo.by_axis = by_axis(hit, section.axis);
        keep(at, echo, of_rays / (static_cast<double>(hits.size()) + beyond), cell * cell * tangent2 / rays, 0);
    }
}

// The mean of all places that are seen, or the means of each face.
void ConeRange::predict_means(const Placement& at, const Section& section, const std::vector<int>& triangles,
                              const Vec3& origin) const {
    thread_local std::vector<RayHit> hits;
    thread_local std::vector<Outline> outlines;
    Visible::see(at.shape, triangles, origin, section, at.with_place, hits, outlines);
    if (hits.empty()) return;
    Background other = background(at, section.axis, 1);
    for (const RayHit& hit : hits)
        if (other.exists()) other.block((1 / hit.length()) * hit.along, hit.share);
    for (Moments& one : other.free)
        if (!(one.weight > 0)) one = {};
    thread_local std::vector<Vec3> turned;
    turned.clear();
    for (const RayHit& hit : hits) {
        if (!at.with_place) break;
        turned.push_back(by_axis(hit, section.axis));
    }
    // The mean of the rays of some faces, which are the hits where face is -1 or that of the triangle, and of furniture; even
    // or by signal. A mean over furniture, too, has the probability of the fraction that the part returns, as the rest of the
    // density is that of furniture alone. Outlines move by the transport theorem of Reynolds (docs/math.md).
    const auto add_mean = [&](int face, bool by_signal, const Moments& beside, double share, int model) {
        const auto counts = [&](const RayHit& hit) { return face < 0 || at.shape.faces[hit.triangle] == face; };
        const auto weight_of = [&](const RayHit& hit) { return by_signal ? signal_of(hit.cosine, hit.range) : 1.0; };
        ConeEcho mean;
        Moments own;
        for (const RayHit& hit : hits) {
            if (!counts(hit)) continue;
            own.add(hit.share * weight_of(hit), hit.range);
            mean.triangle = hit.triangle;
        }
        if (!(own.weight > 0)) return;
        const Moments all{own.weight + beside.weight, own.first + beside.first, own.second + beside.second};
        mean.range = all.mean();
        if (at.with_place) {
            for (const RayHit& hit : hits) {
                if (!counts(hit)) continue;
                const double weight = hit.share * weight_of(hit), more = hit.range - mean.range;
                // a signal is the height over the plane by the cubed range
                const double by_range = by_signal ? weight * (1 - 3 * more / hit.range) : weight;
                mean.by_origin += (by_range / hit.cosine + (by_signal ? weight * more / hit.height() : 0)) * hit.normal;
                mean.by_axis += by_range * turned[static_cast<size_t>(&hit - hits.data())];
            }
            for (const Outline& one : outlines) {
                double jump = 0;
                for (int k = 0; k < 2; ++k) {
                    if (one.sides[k] >= 0) {
                        const RayHit& hit = hits[one.sides[k]];
                        if (counts(hit)) jump += (k ? -1 : 1) * weight_of(hit) * (hit.range - mean.range);
                    } else if (beside.weight > 0) {
                        const RayHit& hit = hits[one.sides[1 - k]];
                        const Vec3 ray = (1 / hit.length()) * hit.along;
                        const double r = other.range(ray), w = by_signal ? signal_of(-dot(other.normal, ray), r) : 1.0;
                        if (r > 0) jump += (k ? -1 : 1) * w * (r - mean.range);
                    }
                }
                mean.by_origin += jump * one.by_origin;
                mean.by_axis += jump * one.by_axis;
            }
            mean.by_origin = (1 / all.weight) * mean.by_origin;
            mean.by_axis = (1 / all.weight) * mean.by_axis;
        }
        keep(at, mean, share * own.weight / all.weight, all.spread() * WEIGHT_SD * WEIGHT_SD, model);
    };
    for (int by_signal = 0; by_signal < 2 && of_mean > 0; ++by_signal)
        add_mean(-1, by_signal, other.free[by_signal], 0.5 * of_mean, by_signal);
    if (!(of_strongest > 0)) return;
    struct Surface {
        int face;
        double signal;
    };
    thread_local std::vector<Surface> surfaces;
    surfaces.clear();
    for (const RayHit& hit : hits) {
        const int face = at.shape.faces[hit.triangle];
        const double signal = hit.share * signal_of(hit.cosine, hit.range);
        size_t j = 0;
        while (j < surfaces.size() && surfaces[j].face != face) ++j;
        if (j == surfaces.size()) surfaces.push_back({face, 0});
        surfaces[j].signal += signal;
    }
    double most = other.free[1].weight;
    for (const Surface& one : surfaces) most = std::max(most, one.signal);
    double sum = std::pow(other.free[1].weight / most, STRONGER);
    for (Surface& one : surfaces) sum += one.signal = std::pow(std::max(one.signal, 0.0) / most, STRONGER);
    for (const Surface& one : surfaces)
        if (one.signal > 0) add_mean(one.face, false, {}, of_strongest * one.signal / sum, 0);
}

// By the distance field: a surface is at the range somewhere in the spot, and the ball that the cone holds is empty.
double ConeRange::rough_cost(const Shape& shape, const Pose& pose, double blur, double tilt) const {
    (void)tilt;
    const Vec3 p = into_part(pose, at), a = transposed_times(pose.R, inward), o = p - range * a;
    const double spot = range * std::tan(half_angle), sine = std::sin(half_angle);
    const double beside = std::max(shape.field(p) - spot, 0.0), far = std::max(shape.field(o) - range, 0.0);
    const double along = range / (1 + sine), inside = std::max(along * sine - shape.field(o + along * a), 0.0);
    const double cost = (beside * beside + far * far + (of_nearest > 0 ? inside * inside : 0)) / (blur * blur);
    return std::min(cost, ROUGH_CAP);
}

NearestElement ConeRange::nearest(const Shape& shape, const Pose& pose, const Vec3& p, bool coarse) const {
    const Vec3 a = transposed_times(pose.R, direction);
    const Cone cone{p - range * a, a, half_angle, least_cosine};
    ConeEcho echo;
    if (of_nearest == 0) {
        echo.range = shape.cast(cone.origin, a, 1e299, &echo.triangle);
        if (echo.triangle >= 0) {
            echo.ray = a;
            echo.cosine = -dot(shape.normals[echo.triangle], a);
            if (!(echo.cosine > 1e-3)) echo = {};
        }
    }
    if (echo.triangle < 0) echo = nearest_in(shape, triangles_in(shape, cone, 2 * range), cone);
    if (echo.triangle < 0) return OnSurface::nearest(shape, pose, p, coarse);
    // the place at the range along the ray to the surface, and its distance from the plane there
    const Vec3& n = shape.normals[echo.triangle];
    const double cosine = -dot(n, echo.ray);
    NearestElement out;
    out.possible = true;
    out.distance = (echo.range - range) * cosine;
    out.direction = n;
    out.beside = range * (echo.ray - a);
    out.along = cosine;
    return out;
}

static const RegisteredKind registered("cone_range", factors_from_columns<ConeRange>);

}  // namespace tanteo
