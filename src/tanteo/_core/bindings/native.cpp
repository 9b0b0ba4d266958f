// Python bindings: arrays in, arrays out; every loop runs without the interpreter's lock.
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/unique_ptr.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <memory>
#include <optional>

#include "proposals/axes.hpp"
#include "bindings/conversion.hpp"
#include "factors/registry.hpp"
#include "bindings/normal_poses_arguments.hpp"
#include "solve/likelihood.hpp"
#include "normal.hpp"
#include "proposals/overlaps.hpp"
#include "proposals/assignments.hpp"
#include "proposals/propose.hpp"
#include "solve/sample.hpp"
#include "parallel.hpp"
#include "solve/solve.hpp"

#ifndef TANTEO_VERSION
#define TANTEO_VERSION "unknown"
#endif

using namespace tanteo;
using namespace nb::literals;

namespace tanteo {
void offer_images(nb::module_& m);  // image_bindings.cpp
void offer_python_terms(nb::module_& m);  // factors/python_term.cpp
void offer_lanes(nb::module_& m);  // lanes_bindings.cpp
void offer_pose_terms(nb::module_& m);  // pose_terms_bindings.cpp
void offer_beams(nb::module_& m);   // beam_bindings.cpp
void offer_coarse(nb::module_& m);  // coarse_bindings.cpp
void offer_outlines(nb::module_& m);  // outlines_bindings.cpp
void offer_meshes(nb::module_& m);  // mesh_bindings.cpp
void offer_planes(nb::module_& m);  // planes_bindings.cpp
void offer_axes(nb::module_& m);  // axes_bindings.cpp
void offer_placements(nb::module_& m);  // placement_bindings.cpp
void offer_rounds(nb::module_& m);  // rounds_bindings.cpp
}

namespace {

std::vector<State> states(const Doubles& Ts, const Doubles& zs, const Problem& problem) {
    const size_t D = problem.size() - 6;
    const std::vector<Pose> at = poses(Ts);
    expect(zs, "shared", {at.size(), D});
    std::vector<State> out(at.size());
    for (size_t k = 0; k < at.size(); ++k)
        out[k] = {at[k], std::vector<double>(zs.data() + k * D, zs.data() + (k + 1) * D)};
    return out;
}

Out shared_out(const std::vector<State>& all, size_t D) {
    std::vector<double> out;
    for (const State& s : all) out.insert(out.end(), s.z.begin(), s.z.end());
    return array_of(std::move(out), {all.size(), D});
}

// returns the full symmetric matrix from its lower triangle
void symmetric(const std::vector<double>& A, int K, double* out) {
    for (int a = 0; a < K; ++a)
        for (int b = 0; b < K; ++b) out[a * K + b] = a >= b ? A[a * K + b] : A[b * K + a];
}

constexpr int MOST_FACES = 10'000'000;  // their areas are stored by number
constexpr size_t AXIS_COLUMNS = ModelAxes::COLUMNS;  // ends, range of the size, fraction, side, number, code, line or point, range of a second size
constexpr int MOST_LANDMARKS = ModelAxes::KINDS - 1;

std::unique_ptr<Shape> make_shape(Doubles vertices, Ints triangles, Ints faces, Ints profile_rows, Doubles profiles,
                                  Doubles edges, Doubles corners, Doubles axes, Doubles hull, Doubles centre, Doubles samples,
                                  Doubles sample_normals, int cells, const std::optional<Doubles>& areas) {
    Solid solid;
    solid.vertices = vectors(vertices, "vertices");
    const size_t count = faces.size();
    solid.triangles = expect(triangles, "triangles", 3 * count, 0, int64_t(solid.vertices.size()) - 1);
    solid.faces = expect(faces, "faces", count, 0, MOST_FACES);
    const size_t known_profiles = expect(profiles, "profiles", {ANY, 11}), known_edges = expect(edges, "edges", {ANY, 6});
    solid.profile_rows = expect(profile_rows, "profile_rows", count, -1, int64_t(known_profiles) - 1);
    for (size_t k = 0; k < known_profiles; ++k) {
        const double* p = profiles.data() + 11 * k;
        solid.profiles.push_back({load(p), load(p + 3), p[6], p[7], p[8], p[9], p[10]});
    }
    for (size_t k = 0; k < known_edges; ++k) {
        const Vec3 a = load(edges.data() + 6 * k), b = load(edges.data() + 6 * k + 3);
        solid.edges.push_back({a, unit(b - a), norm(b - a)});
    }
    for (size_t k = 0, known = expect(axes, "axes", {ANY, AXIS_COLUMNS}); k < known; ++k) {
        const double* x = axes.data() + AXIS_COLUMNS * k;
        const Vec3 a = load(x), b = load(x + 3);
        if (!(norm(b - a) > 0)) refuse("axes", "expected two different ends");
        RoundAxis axis{a, unit(b - a), x[12] > 0 ? norm(b - a) : 0.0, x[6], x[7], expect(x[8], "axes", 0, 1),
                       x[13], x[14], 0, 0, 0};
        axis.hole = x[9] > 0 ? 1 : -1;
        axis.number = static_cast<int>(expect(x[10], "axes", 0, MOST_FACES));
        axis.kind = static_cast<int>(expect(x[11], "axes", 1, MOST_LANDMARKS));
        solid.axes.push_back(axis);
    }
    solid.corners = vectors(corners, "corners");
    solid.hull = vectors(hull, "hull");
    solid.samples = vectors(samples, "samples");
    solid.sample_normals = vectors(sample_normals, "sample_normals");
    if (solid.hull.empty() || solid.samples.empty() || solid.samples.size() != solid.sample_normals.size())
        refuse("samples", "expected at least one, each with a normal, and a hull");
    expect(cells, "cells", 4, 256);
    solid.centre = vector(centre, "centre");
    if (areas) solid.areas.assign(areas->data(), areas->data() + areas->size());
    for (const double area : solid.areas) expect(area, "areas", 0, 1e300);
    nb::gil_scoped_release release;
    return std::make_unique<Shape>(std::move(solid), cells);
}

std::unique_ptr<Shape> open_shape(nb::ndarray<const uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu> buffer) {
    return std::make_unique<Shape>(buffer.data(), buffer.size());
}

Out rows_out(const Array<Vec3>& rows) {
    std::vector<double> out(3 * rows.size());
    for (size_t k = 0; k < rows.size(); ++k) store(rows[k], &out[3 * k]);
    return array_of(std::move(out), {rows.size(), 3});
}

// Factors of one kind, which problems share.
struct FactorList {
    std::vector<std::shared_ptr<const Factor>> all;
};

// Named arrays from Python; `kept` owns converted arrays.
std::map<std::string, Columns::Array> arrays_of(const nb::dict& given, std::vector<Doubles>& kept) {
    std::map<std::string, Columns::Array> arrays;
    for (const auto& [key, value] : given) {
        kept.push_back(nb::cast<Doubles>(value));
        const Doubles& a = kept.back();
        Columns::Array array{a.data(), {}};
        for (size_t k = 0; k < a.ndim(); ++k) array.shape.push_back(a.shape(k));
        arrays[nb::cast<std::string>(key)] = std::move(array);
    }
    return arrays;
}

FactorList factors_of(const std::string& kind, const nb::dict& given) {
    std::vector<Doubles> kept;
    std::map<std::string, Columns::Array> arrays = arrays_of(given, kept);
    const auto points = arrays.find("points");
    const size_t rows = points == arrays.end() || points->second.shape.empty() ? 0 : points->second.shape[0];
    FactorList out;
    for (auto& factor : make_factors(kind, Columns(rows, std::move(arrays)))) out.all.push_back(std::move(factor));
    return out;
}

std::shared_ptr<PoseTerm> term_of(const std::string& kind, const nb::dict& arrays, int first) {
    std::vector<Doubles> kept;
    return make_term(kind, Arrays(arrays_of(arrays, kept)), static_cast<int>(expect(first, "first", 0, MOST_STATES)));
}

// The factors of all kinds in the order of the measurements.
void place_factors(const nb::list& blocks, Problem& problem) {
    size_t n = 0;
    for (const auto& block : blocks) n += nb::cast<FactorList&>(block[0]).all.size();
    problem.factors.resize(n);
    for (const auto& block : blocks) {
        const FactorList& list = nb::cast<FactorList&>(block[0]);
        const std::vector<int> rows = expect(nb::cast<Ints>(block[1]), "rows", list.all.size(), 0, int64_t(n) - 1);
        for (size_t k = 0; k < rows.size(); ++k) problem.factors[rows[k]] = list.all[k];
    }
    for (const auto& factor : problem.factors)
        if (!factor) refuse("rows", "expected every row from 0 to " + std::to_string(n) + " once");
}

std::unique_ptr<Problem> make_problem(nb::list blocks, Doubles furniture, Ints groups, Doubles log_elsewhere,
                                      Doubles shared_jacobian, Doubles direction_jacobian, double scale_sd, Doubles rates,
                                      Doubles rate_weights, double mean_rate, Doubles rays, Doubles ray_shifts,
                                      Doubles ray_turns, Doubles prior_means, Doubles prior_roots,
                                      Doubles prior_log_weights, Doubles table, Doubles region, Doubles group_regions,
                                      Ints one_sided) {
    auto problem = std::make_unique<Problem>();
    place_factors(blocks, *problem);
    const size_t n = problem->factors.size(), D = shared_jacobian.ndim() == 3 ? shared_jacobian.shape(2) : 0;
    problem->furniture = doubles(furniture, "furniture", {n});
    for (const double density : problem->furniture) expect(density, "furniture", 0, 1e300);
    problem->group = expect(groups, "groups", n, -1, int64_t(n) - 1);
    for (size_t k = 0; k < n; ++k) {
        const int group = problem->group[k];
        if (group < 0) continue;
        if (group >= static_cast<int>(problem->groups.size())) problem->groups.resize(group + 1);
        problem->groups[group].push_back(static_cast<int>(k));
    }
    problem->shared_jacobian = doubles(shared_jacobian, "shared_jacobian", {n, 3, D});
    if (direction_jacobian.size()) problem->direction_jacobian = doubles(direction_jacobian, "direction_jacobian", {n, 3, D});
    problem->scale_sd = expect(scale_sd, "scale_sd", 0, 100);
    if (6 + D + (scale_sd > 0) > MOST_STATES) refuse("shared_jacobian", "expected fewer shared errors, got " + std::to_string(D));
    problem->shared = static_cast<int>(D);
    if (one_sided.size())  // none otherwise
        for (const int side : expect(one_sided, "one_sided", D, 0, 1)) problem->one_sided.push_back(static_cast<char>(side));
    problem->log_elsewhere = doubles(log_elsewhere, "log_elsewhere", {problem->groups.size()});
    problem->rates = doubles(rates, "rates", {ANY});
    problem->rate_weights = doubles(rate_weights, "rate_weights", {problem->rates.size()});
    if (problem->rates.empty()) refuse("rates", "expected some, got none");
    for (const double rate : problem->rates) expect(rate, "rates", 1e-300, 1);
    for (const double weight : problem->rate_weights) expect(weight, "rate_weights", 0, 1e300);
    problem->mean_rate = expect(mean_rate, "mean_rate", 1e-300, 1);
    const size_t m = expect(rays, "rays", {ANY, 9});
    for (size_t k = 0; k < m; ++k) {
        const double* r = rays.data() + 9 * k;
        problem->rays.push_back({load(r), load(r + 3), r[6], r[7], r[8]});
    }
    problem->ray_shifts = doubles(ray_shifts, "ray_shifts", {m, 3, D});
    problem->ray_turns = doubles(ray_turns, "ray_turns", {m, 3, D});
    problem->priors = pose_priors(prior_means, prior_roots, prior_log_weights);
    const std::vector<double> patch = doubles(region, "region", {2});
    problem->region = {expect(patch[0], "region", 0, 1e300), expect(patch[1], "region", 0, 1e300),
                       doubles(group_regions, "group_regions", {problem->groups.size()})};
    for (const double own : problem->region.groups) expect(own, "group_regions", 0, 1e300);
    const size_t planes = table.size() / 7;  // of a point, a normal and a standard deviation each
    expect(table, "table", {7 * planes});
    for (const double* one = table.data(); one != table.data() + 7 * planes; one += 7)
        problem->tables.push_back({load(one), load(one + 3), expect(one[6], "table", 1e-300, 1e300)});
    return problem;
}

Out log_densities(const Shape& shape, const Problem& problem, Doubles Ts, Doubles zs) {
    const std::vector<State> all = states(Ts, zs, problem);
    std::vector<double> out(all.size());
    {
        nb::gil_scoped_release release;
        for_all(all.size(), [&] {
            Likelihood own(shape, problem);
            own.with_terms = false;
            return [&, likelihood = std::move(own)](size_t k) mutable { out[k] = likelihood.at(all[k], false); };
        });
        for (const auto& term : problem.terms) {
            const std::vector<double> more = term->values(all);
            for (size_t k = 0; k < all.size(); ++k) out[k] += more[k];
        }
    }
    return list_of(std::move(out));
}

std::tuple<Out, Out, Out> slopes(const Shape& shape, const Problem& problem, Doubles Ts, Doubles zs) {
    const std::vector<State> all = states(Ts, zs, problem);
    const size_t S = all.size(), K = problem.size();
    std::vector<double> logs(S), gradients(S * K), informations(S * K * K);
    {
        nb::gil_scoped_release release;
        for_all(S, [&] {
            return [&, likelihood = Likelihood(shape, problem)](size_t k) mutable {
                logs[k] = likelihood.at(all[k], true);
                std::copy(likelihood.gradient.begin(), likelihood.gradient.end(), &gradients[k * K]);
                symmetric(likelihood.information, static_cast<int>(K), &informations[k * K * K]);
            };
        });
    }
    return {list_of(std::move(logs)), array_of(std::move(gradients), {S, K}),
            array_of(std::move(informations), {S, K, K})};
}

// Evaluation of every factor at every pose. A table (S, n, 12): density on the part relative to an outlier, probability that
// it is no outlier; for its likeliest element: distance, one over its sd, tilt of the direction in sds, density if it were
// exactly on the element, normal (3); and its position in the part frame (3). Further the elements (S, n), the log density
// of all factors together (S). Densities are even over the part. For each design of the places: the densities of each factor
// over these (D, S, n), the log density of each label group on the part (D, S, G), the log weight of the design (D, S), and
// its probability (D, S).
nb::tuple details(const Shape& shape, const Problem& problem, Doubles Ts, Doubles zs) {
    const std::vector<State> all = states(Ts, zs, problem);
    const size_t S = all.size(), n = problem.factors.size();
    const size_t G = problem.groups.size();
    std::vector<double> table(S * n * 12), together(S);
    std::vector<int32_t> elements(S * n, -1);
    Likelihood likelihood(shape, problem);
    const size_t D = likelihood.designs.size();
    std::vector<double> scales(D * S * n), groups(D * S * G), weights(D * S), probabilities(D * S);
    {
        nb::gil_scoped_release release;
        for (size_t k = 0; k < S; ++k) {
            likelihood.at(all[k], false);
            together[k] = likelihood.log_points;
            for (size_t i = 0; i < D; ++i) {
                const size_t at = i * S + k;
                weights[at] = likelihood.designs[i].log_weight;
                probabilities[at] = likelihood.designs[i].probability;
                Design& design = likelihood.designs[weights[at] > -1e300 ? i : 0];
                for (size_t g = 0; g < G; ++g) groups[at * G + g] = likelihood.log_on_part(design, g);
                for (size_t j = 0; j < n; ++j) scales[at * n + j] = design.scale_of(*problem.factors[j]);
            }
            for (size_t j = 0; j < n; ++j) {
                const Evaluated& own = likelihood.evaluated[j];
                double* row = &table[(k * n + j) * 12];
                row[0] = own.density;
                row[1] = own.inlier;
                store(own.p, row + 9);
                if (!own.count) {
                    const NearestPlace place = problem.factors[j]->beside(shape, all[k].pose, own.p);
                    row[2] = place.distance;
                    row[3] = place.per_sd;
                    row[5] = place.density;
                    store(place.normal, row + 6);
                    elements[k * n + j] = place.element;
                    continue;
                }
                const Component* const first = &likelihood.components.all[own.first];
                const Component& best = *std::max_element(first, first + own.count, [](const Component& a, const Component& b) {
                    return a.weight < b.weight;
                });
                row[2] = best.distance;
                row[3] = best.per_sd;
                row[4] = best.tilted ? std::hypot(best.tilt[0], best.tilt[1]) : 0;
                const double r = best.distance * best.per_sd;
                row[5] = best.weight * std::exp(0.5 * r * r);
                store(best.normal, row + 6);
                elements[k * n + j] = best.element;
            }
        }
    }
    return nb::make_tuple(array_of(std::move(table), {S, n, 12}), array_of(std::move(elements), {S, n}),
                          list_of(std::move(together)), array_of(std::move(scales), {D, S, n}),
                          array_of(std::move(groups), {D, S, G}), array_of(std::move(weights), {D, S}),
                          array_of(std::move(probabilities), {D, S}));
}

// Poses from each pair of points, best first, and the pair that led to each; every pair has its own seed.
std::tuple<Out, OutInts> proposed(const Shape& shape, const Problem& problem, Ints rows, Ints pairs, int per_pair, int spins,
                                  double tolerance, double blur, double tilt, int keep, Starts seeds) {
    const int64_t last = int64_t(problem.factors.size()) - 1;
    const size_t count = seeds.size();
    const std::vector<int> chosen = expect(rows, "rows", ANY, 0, last), both = expect(pairs, "pairs", 2 * count, 0, last);
    const Effort effort{static_cast<int>(expect(per_pair, "per_pair", 0, 1e9)),
                        static_cast<int>(expect(spins, "spins", 1, 1e6)), expect(tolerance, "tolerance", 0, 1e300), expect(blur, "blur", 1e-300, 1e300),
                        expect(tilt, "tilt", 1e-300, 1e300), static_cast<int>(expect(keep, "keep", 1, 1e9))};
    std::vector<std::vector<Proposal>> found(count);
    {
        nb::gil_scoped_release release;
        for_all(count, [&] {
            return [&](size_t k) {
                found[k] = propose(shape, problem, chosen, both[2 * k], both[2 * k + 1], effort, seeds.data()[k]);
            };
        });
    }
    std::vector<Pose> out;
    std::vector<int32_t> from;
    for (size_t k = 0; k < count; ++k)
        for (const Proposal& p : found[k]) {
            out.push_back(p.pose);
            from.push_back(static_cast<int32_t>(k));
        }
    return {poses_out(out), list_of(std::move(from))};
}

// Poses with points on faces near a mean pose, their scores, the number of nodes, and whether all assignments were tried.
std::tuple<Out, Out, int, bool> assigned(const Shape& shape, const Problem& problem, Ints rows, Doubles mean, Doubles information,
                                         double gate, double cost, double gap, double noise, int outliers, int nodes, int keep) {
    const std::vector<int> which = expect(rows, "rows", ANY, 0, int64_t(problem.factors.size()) - 1);
    expect(mean, "mean", {4, 4});
    expect(information, "information", {6, 6});
    PoseRegion region{load_pose(mean.data()), {}};
    std::copy_n(information.data(), 36, region.information);
    AssignedPoses found;
    {
        nb::gil_scoped_release release;
        found = assigned_poses(shape, problem, which, region, {gate, cost, gap, noise, outliers, nodes, keep});
    }
    std::vector<Pose> out;
    std::vector<double> scores;
    for (const AssignedPose& one : found.best) out.push_back(one.pose), scores.push_back(one.score);
    return {poses_out(out), list_of(std::move(scores)), found.nodes, found.complete};
}

Out scores(const Shape& shape, const Problem& problem, Ints rows, Doubles Ts, double blur, double tilt) {
    const std::vector<Pose> all = poses(Ts);
    std::vector<double> out;
    const std::vector<int> which = expect(rows, "rows", ANY, 0, int64_t(problem.factors.size()) - 1);
    expect(blur, "blur", 1e-300, 1e300);
    expect(tilt, "tilt", 1e-300, 1e300);
    {
        nb::gil_scoped_release release;
        for (const Pose& pose : all) out.push_back(score(shape, problem, which, pose, blur, tilt, 1e300));
    }
    return list_of(std::move(out));
}

// Refined poses, their costs, the start that led to each, the common offsets [m] and the distances of the points.
std::tuple<Out, Out, OutInts, Out, Out> refined(const Shape& shape, const Problem& problem, Ints rows, Doubles scales,
                                                 Doubles Ts, double offset_sd, bool with_distances, double known) {
    const std::vector<Pose> starts = poses(Ts);
    const std::vector<int> which = expect(rows, "rows", ANY, 0, int64_t(problem.factors.size()) - 1);
    const std::vector<double> steps = doubles(scales, "scales", {ANY});
    if (steps.empty()) refuse("scales", "expected some, got none");
    for (const double step : steps) expect(step, "scales", 1e-300, 1e300);
    expect(offset_sd, "offset_sd", 0, 1e300);
    expect(known, "known", 0, 1e300);
    std::vector<RefinedPose> found;
    {
        nb::gil_scoped_release release;
        found = refine_poses(shape, problem, which, steps, starts, offset_sd, known);
    }
    std::vector<Pose> at;
    std::vector<double> costs, offsets, distances;
    std::vector<int32_t> from;
    for (const RefinedPose& s : found) {
        at.push_back(s.pose);
        costs.push_back(s.cost);
        from.push_back(s.from);
        offsets.push_back(s.offset);
        if (!with_distances) continue;
        const std::vector<double> own = distances_at(shape, problem, which, s);
        distances.insert(distances.end(), own.begin(), own.end());
    }
    const size_t n = which.size(), S = with_distances ? found.size() : 0;
    return {poses_out(at), list_of(std::move(costs)), list_of(std::move(from)), list_of(std::move(offsets)),
            array_of(std::move(distances), {S, n})};
}

// Maxima: poses, shared errors, log densities, informations about the centre, the maximum to which each start led or -1, and
// the start of each maximum.
nb::tuple maximized(const Shape& shape, const Problem& problem, Doubles Ts, Doubles zs, Doubles blurs, int steps,
                  double enough, double margin, double near) {
    const std::vector<State> starts = states(Ts, zs, problem);
    const std::vector<double> coarse = doubles(blurs, "blurs", {ANY});
    for (const double blur : coarse) expect(blur, "blurs", 0, 1e300);
    expect(steps, "steps", 0, 1e9);
    expect(enough, "enough", 0, 1e300);
    expect(margin, "margin", 0, 1e300);
    expect(near, "near", 0, 1e300);
    std::vector<Maximum> found;
    {
        nb::gil_scoped_release release;
        found = maximize_all(shape, problem, starts, coarse, steps, enough, margin, near);
    }
    const size_t S = found.size(), K = problem.size();
    std::vector<Pose> at(S);
    std::vector<State> all(S);
    std::vector<double> logs(S), informations(S * K * K);
    std::vector<int32_t> from(S), who(starts.size(), -1);
    for (size_t k = 0; k < S; ++k) {
        who[found[k].from] = static_cast<int32_t>(k);
        for (const int other : found[k].also) who[other] = static_cast<int32_t>(k);
        all[k] = found[k].state;
        at[k] = found[k].state.pose;
        logs[k] = found[k].at.value;
        from[k] = found[k].from;
        symmetric(found[k].at.information, static_cast<int>(K), &informations[k * K * K]);
    }
    return nb::make_tuple(poses_out(at), shared_out(all, K - 6), list_of(std::move(logs)),
                          array_of(std::move(informations), {S, K, K}), list_of(std::move(who)), list_of(std::move(from)));
}

// log densities of poses with shared errors and noise scale integrated out, and the best values of these
std::tuple<Out, Out> marginals(const Shape& shape, const Problem& problem, Doubles Ts, Doubles zs) {
    std::vector<State> all = states(Ts, zs, problem);
    std::vector<double> logs(all.size());
    {
        nb::gil_scoped_release release;
        for_all(all.size(), [&] {
            return [&, likelihood = Likelihood(shape, problem)](size_t k) mutable {
                logs[k] = marginal(likelihood, problem, all[k]);
            };
        });
    }
    return {list_of(std::move(logs)), shared_out(all, problem.size() - 6)};
}

Out placed(Doubles Ts, Doubles offsets, Doubles centre) {
    std::vector<Pose> all = poses(Ts);
    expect(offsets, "offsets", {all.size(), 6});
    const Vec3 c = vector(centre, "centre");
    for (size_t k = 0; k < all.size(); ++k)
        all[k] = moved(all[k], load(offsets.data() + 6 * k), load(offsets.data() + 6 * k + 3), c);
    return poses_out(all);
}

Out offsets(Doubles T, Doubles Ts, Doubles centre) {
    const std::vector<Pose> all = poses(Ts);
    expect(T, "base", {4, 4});
    const Pose base = load_pose(T.data());
    const Vec3 c = vector(centre, "centre");
    std::vector<double> out(6 * all.size());
    for (size_t k = 0; k < all.size(); ++k) {
        Vec3 v, w;
        difference(base, all[k], c, v, w);
        store(v, &out[6 * k]);
        store(w, &out[6 * k + 3]);
    }
    return array_of(std::move(out), {all.size(), 6});
}

std::tuple<Out, Out> mixture(Doubles Ts, Doubles bases, Doubles bends, Ints owners, int m, Doubles means, Doubles inverses,
                             Doubles log_weights, double freedom, Doubles centre) {
    const std::vector<Pose> all = poses(Ts), at = poses(bases, "bases");
    const size_t C = at.size();
    expect(m, "m", 0, 1e9);
    expect(bends, "bends", {C, 6, 6, 6});
    const std::vector<int> owner = expect(owners, "owners", C, 0, int64_t(m) - 1);
    expect(means, "means", {C, 6});
    expect(inverses, "inverses", {C, 6, 6});
    expect(log_weights, "log_weights", {C});
    expect(freedom, "freedom", 1e-3, 1e6);
    std::vector<MixtureComponent> components(C);
    for (size_t k = 0; k < C; ++k) {
        MixtureComponent& c = components[k];
        c.owner = owner[k];
        c.base = at[k];
        const double* bend = bends.data() + 216 * k;
        if (std::any_of(bend, bend + 216, [](double b) { return b != 0; }))
            for (int i = 0; i < 6; ++i)
                for (int j = 0; j < 6; ++j)
                    for (int l = j; l < 6; ++l)
                        c.bend.push_back(bend[36 * i + 6 * j + l] + (l > j ? bend[36 * i + 6 * l + j] : 0));
        for (int i = 0; i < 6; ++i) expect(inverses.data()[36 * k + 7 * i], "inverses", 1e-150, 1e150);
        std::copy_n(means.data() + 6 * k, 6, c.mean);
        std::copy_n(inverses.data() + 36 * k, 36, c.inverse);
        c.log_weight = log_weights.data()[k];
    }
    const Vec3 middle = vector(centre, "centre");
    const size_t count = static_cast<size_t>(m);
    std::vector<double> logs(all.size()), shares(all.size() * count);
    {
        nb::gil_scoped_release release;
        const Mixture mix(std::move(components), m, freedom, middle);
        for (size_t k = 0; k < all.size(); ++k) logs[k] = mix.log_density(all[k], shares.data() + k * count);
    }
    return {list_of(std::move(logs)), array_of(std::move(shares), {all.size(), count})};
}

// Whether two poses are within a squared distance by an information about a centre.
bool are_near(const Pose& one, const Pose& other, const double* information, double limit, const Vec3& centre) {
    Vec3 v, w;
    difference(one, other, centre, v, w);
    if (squared(w) > 1) return false;
    const double x[6] = {v.x, v.y, v.z, w.x, w.y, w.z};
    double q = 0;
    for (int a = 0; a < 6; ++a)
        for (int b = 0; b < 6; ++b) q += information[6 * a + b] * x[a] * x[b];
    return q < limit;
}

// Indices of the poses, in the given order, that are farther than a limit from all earlier kept ones, in squared standard
// deviations by the information of the kept one; and for every pose the kept one that it equals, or -1 once `most` are kept.
// With the symmetries of a part, a pose equals a kept one also if one of its symmetric images does.
std::tuple<OutInts, OutInts> distinct(Doubles Ts, Doubles informations, double limit, int most, Doubles centre,
                                      const std::optional<Doubles>& symmetries) {
    const std::vector<Pose> all = poses(Ts), turns = symmetries ? poses(*symmetries, "symmetries") : std::vector<Pose>(1);
    expect(informations, "informations", {all.size(), 6, 6});
    const Vec3 c = vector(centre, "centre");
    std::vector<int32_t> kept, who(all.size(), -1);
    for (size_t k = 0; k < all.size(); ++k) {
        std::vector<Pose> images;
        for (const Pose& turn : turns) images.push_back({all[k].R * turn.R, all[k].R * turn.t + all[k].t});
        for (size_t l = 0; l < kept.size() && who[k] < 0; ++l) {
            const auto near = [&](const Pose& image) {
                return are_near(all[kept[l]], image, informations.data() + 36 * kept[l], limit, c);
            };
            if (std::any_of(images.begin(), images.end(), near)) who[k] = static_cast<int32_t>(l);
        }
        if (who[k] >= 0 || static_cast<int>(kept.size()) >= most) continue;
        who[k] = static_cast<int32_t>(kept.size());
        kept.push_back(static_cast<int32_t>(k));
    }
    return {list_of(std::move(kept)), list_of(std::move(who))};
}

nb::tuple closest_points(const Shape& shape, Doubles points) {
    const std::vector<Vec3> all = vectors(points, "points");
    std::vector<double> distances(all.size()), places(3 * all.size());
    std::vector<int32_t> triangles(all.size());
    {
        nb::gil_scoped_release release;
        for (size_t k = 0; k < all.size(); ++k) {
            const Closest c = shape.closest(all[k]);
            distances[k] = std::sqrt(c.squared);
            store(c.point, &places[3 * k]);
            triangles[k] = c.triangle;
        }
    }
    const size_t n = all.size();
    return nb::make_tuple(array_of(std::move(distances), {n}), array_of(std::move(places), {n, 3}),
                          array_of(std::move(triangles), {n}));
}

nb::tuple first_hits(const Shape& shape, Doubles origins, Doubles directions) {
    const std::vector<Vec3> from = vectors(origins, "origins"), along = vectors(directions, "directions");
    if (from.size() != along.size()) refuse("directions", "expected as many as origins");
    std::vector<double> distances(from.size());
    std::vector<int32_t> triangles(from.size());
    {
        nb::gil_scoped_release release;
        for (size_t k = 0; k < from.size(); ++k) {
            int t = -1;
            const double d = shape.cast(from[k], along[k], 1e300, &t);
            distances[k] = t < 0 ? std::numeric_limits<double>::infinity() : d;
            triangles[k] = t;
        }
    }
    return nb::make_tuple(list_of(std::move(distances)), list_of(std::move(triangles)));
}

Out group_information(Doubles weights, Doubles means, Doubles variances, Ints groups) {
    const std::vector<int> of = expect(groups, "groups", ANY, 0, 1e9);
    const size_t S = of.size(), C = expect(weights, "weights", {ANY, S});
    const std::vector<double> w = doubles(weights, "weights", {C, S}), m = doubles(means, "means", {C, S});
    const std::vector<double> v = doubles(variances, "variances", {C, S});
    std::vector<double> out(C);
    {
        nb::gil_scoped_release release;
        Overlaps overlaps(of);
        for (size_t c = 0; c < C; ++c) out[c] = overlaps.information(&w[c * S], &m[c * S], &v[c * S]);
    }
    return list_of(std::move(out));
}

}  // namespace

NB_MODULE(native, m) {
    m.def("version", [] { return TANTEO_VERSION; });
    m.def("most_threads", [] { return most_threads(); });
    nb::class_<Shape>(m, "Shape")
        .def_prop_ro("area", [](const Shape& s) { return s.area; })
        .def_prop_ro("diagonal", [](const Shape& s) { return s.diagonal; })
        .def_prop_ro("flats", [](const Shape& s) { return s.flats.size(); })
        .def_prop_ro("samples", [](const Shape& s) { return rows_out(s.samples); }, nb::rv_policy::automatic)
        .def_prop_ro("normals", [](const Shape& s) { return rows_out(s.sample_normals); }, nb::rv_policy::automatic)
        .def("bytes", [](const Shape& s) {
            nb::bytes all = nb::steal<nb::bytes>(PyBytes_FromStringAndSize(nullptr, static_cast<Py_ssize_t>(s.size())));
            if (!all.is_valid()) throw std::bad_alloc();
            s.write(reinterpret_cast<unsigned char*>(PyBytes_AsString(all.ptr())));
            return all;
        })
        .def_prop_ro("centre", [](const Shape& s) {
            return array_of(std::vector<double>{s.centre.x, s.centre.y, s.centre.z}, {3});
        }, nb::rv_policy::automatic);
    nb::class_<PoseTerm>(m, "PoseTerm");
    offer_images(m);
    offer_pose_terms(m);
    offer_python_terms(m);
    offer_lanes(m);
    nb::class_<Problem>(m, "Problem")
        .def_prop_ro("size", &Problem::size)
        .def("add", [](Problem& problem, std::shared_ptr<const PoseTerm> term) { problem.terms.push_back(std::move(term)); },
             "term"_a);
    m.def("make_shape", &make_shape, "vertices"_a, "triangles"_a, "faces"_a, "profile_rows"_a, "profiles"_a, "edges"_a,
          "corners"_a, "axes"_a, "hull"_a, "centre"_a, "samples"_a, "sample_normals"_a, "cells"_a,
          "areas"_a = nb::none());
    m.def("open_shape", &open_shape, "buffer"_a, nb::keep_alive<0, 1>());
    nb::class_<FactorList>(m, "FactorList").def("__len__", [](const FactorList& list) { return list.all.size(); });
    m.def("make_factors", &factors_of, "kind"_a, "columns"_a);
    m.def("make_term", &term_of, "kind"_a, "arrays"_a, "first"_a);
    m.def("landmark_codes", [] { return landmark_codes(); });
    m.def("make_problem", &make_problem, "factors"_a, "furniture"_a, "groups"_a, "log_elsewhere"_a, "shared_jacobian"_a,
          "direction_jacobian"_a, "scale_sd"_a, "rates"_a, "rate_weights"_a, "mean_rate"_a, "rays"_a, "ray_shifts"_a,
          "ray_turns"_a, "prior_means"_a, "prior_roots"_a, "prior_log_weights"_a, "table"_a,
          "region"_a, "group_regions"_a, "one_sided"_a);
    m.def("log_densities", &log_densities, "shape"_a, "problem"_a, "poses"_a, "shared"_a);
    m.def("slopes", &slopes, "shape"_a, "problem"_a, "poses"_a, "shared"_a);
    m.def("details", &details, "shape"_a, "problem"_a, "poses"_a, "shared"_a);
    m.def("propose", &proposed, "shape"_a, "problem"_a, "rows"_a, "pairs"_a, "per_pair"_a, "spins"_a, "tolerance"_a,
          "blur"_a, "tilt"_a, "keep"_a, "seeds"_a);
    m.def("assigned_poses", &assigned, "shape"_a, "problem"_a, "rows"_a, "mean"_a, "information"_a, "gate"_a, "cost"_a, "gap"_a,
          "noise"_a, "outliers"_a, "nodes"_a, "keep"_a);
    m.def("scores", &scores, "shape"_a, "problem"_a, "rows"_a, "poses"_a, "blur"_a, "tilt"_a);
    m.def("refine_poses", &refined, "shape"_a, "problem"_a, "rows"_a, "scales"_a, "poses"_a,
          "offset_sd"_a = 0.0, "with_distances"_a = false, "known"_a = 1e300);
    m.def("maximize", &maximized, "shape"_a, "problem"_a, "poses"_a, "shared"_a, "blurs"_a, "steps"_a, "enough"_a,
          "margin"_a, "near"_a = 0.0);
    m.def("marginals", &marginals, "shape"_a, "problem"_a, "poses"_a, "shared"_a);
    m.def("place", &placed, "poses"_a, "offsets"_a, "centre"_a);
    m.def("offsets", &offsets, "base"_a, "poses"_a, "centre"_a);
    m.def("mixture", &mixture, "poses"_a, "bases"_a, "bends"_a, "owners"_a, "m"_a, "means"_a, "inverses"_a, "log_weights"_a, "freedom"_a,
          "centre"_a);
    m.def("distinct", &distinct, "poses"_a, "informations"_a, "limit"_a, "most"_a, "centre"_a, "symmetries"_a = nb::none());
    m.def("closest_points", &closest_points, "shape"_a, "points"_a);
    m.def("group_information", &group_information, "weights"_a, "means"_a, "variances"_a, "groups"_a);
    m.def("first_hits", &first_hits, "shape"_a, "origins"_a, "directions"_a);
    offer_beams(m);
    offer_coarse(m);
    offer_outlines(m);
    offer_meshes(m);
    offer_planes(m);
    offer_axes(m);
    offer_rounds(m);
    offer_placements(m);
}
