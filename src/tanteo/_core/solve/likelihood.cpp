// The joint likelihood of all factors: outliers, furniture and label groups, then gradient and information over pose,
// shared errors and noise scale. Rays and priors are in prior.cpp; docs/math.md, section 15, has the formulas.
#include "solve/likelihood.hpp"

#include <cmath>

#include "solve/one_sided.hpp"

namespace tanteo {

constexpr double LEAST_CURVED = 0.25;  // least curvature by the noise scale that steps assume, over the expected one
constexpr double MOST_CHOSEN = 50;  // definition: most places that a person chooses; more are a scan

void Likelihood::begin(const State& state, bool with_slope, FaceQueue& shared) {
    const int n = static_cast<int>(problem.factors.size());
    components.queue = &shared;
    has_slope = with_slope;
    evaluated.resize(n);
    predicted.resize(n);
    placements.clear();
    amounts.assign(state.z.begin(), state.z.begin() + problem.shared);
    rates.assign(problem.shared, 1.0);
    for (size_t d = 0; d < problem.one_sided.size(); ++d) {
        if (!problem.one_sided[d]) continue;
        const Effect effect = one_sided(state.z[d]);
        amounts[d] = effect.value;
        rates[d] = effect.slope;
    }
    for (int j = 0; j < n; ++j)
        if (is_excluded(j)) evaluated[j] = {};
        else place(state, j, with_slope);
}

double Likelihood::finish(const State& state) {
    const int n = static_cast<int>(problem.factors.size()), K = problem.size();
    const bool with_slope = has_slope;
    components.all.clear();
    int placed = 0;
    for (int j = 0; j < n; ++j)
        if (!is_excluded(j)) evaluate(j, placements[placed++]);
    if (with_slope) {
        gradient.assign(K, 0.0);
        information.assign(static_cast<size_t>(K) * K, 0.0);
    }
    double log = log_points = combine();
    if (with_slope) add_factors(state);
    log += add_rays(state);
    log += add_priors(state, with_slope);
    if (!with_terms) return log;
    const Slope slope{shape.centre, K, gradient.data(), information.data()};
    for (const auto& term : problem.terms) log += term->add(state, with_slope ? &slope : nullptr);
    return log;
}

// Places factor j at a state. Shared errors z move its position by G z; the noise scale s multiplies its
// covariance: C = s^2 C_device + (tolerance^2 + blur^2) I.
void Likelihood::place(const State& state, int j, bool with_slope) {
    const Factor& factor = *problem.factors[j];
    const Mat3& R = state.pose.R;
    Evaluated& own = evaluated[j];
    Vec3 world = factor.at, direction = factor.direction;
    const int D = problem.shared;
    if (D) {
        const double* G = problem.place_jacobian(j);
        for (int i = 0; i < 3; ++i)
            for (int d = 0; d < D; ++d) world[i] += G[i * D + d] * amounts[d];
        if (const double* H = factor.has_direction() ? problem.turn_jacobian(j) : nullptr) {
            for (int i = 0; i < 3; ++i)
                for (int d = 0; d < D; ++d) direction[i] += H[i * D + d] * amounts[d];
            direction = unit(direction);
        }
    }
    own.p = into_part(state.pose, world);
    own.m = factor.has_direction() ? transposed_times(R, direction) : Vec3{};
    const double scale = problem.scale_sd > 0 ? std::exp(2 * problem.scale_sd * state.z[D]) : 1.0;
    Mat3 C = factor.cov;
    for (double& c : C.m) c *= scale;
    for (int i = 0; i < 3; ++i) C(i, i) += factor.extra + blur * blur;
    if (!factor.isotropic) C = turned_into(R, C);
    placements.push_back({shape, R, own.p, own.m, C, blur, blur_turn, NEGLIGIBLE * problem.mean_rate, with_slope, world,
                          with_slope && (with_pose || problem.shared), same_place, &predicted[j]});
    factor.begin(placements.back(), *components.queue);
}

void Likelihood::evaluate(int j, const Placement& placement) {
    Evaluated& own = evaluated[j];
    own.first = static_cast<int>(components.size());
    problem.factors[j]->evaluate(placement, components);
    own.count = static_cast<int>(components.size()) - own.first;
    own.density = 0;
    for (int k = own.first; k < own.first + own.count; ++k) own.density += components.all[k].weight;
    if (!(own.density > 0)) {
        components.all.resize(own.first);
        own.count = 0;
        own.density = 0;
    }
}

// Three designs of the places are possible. With prior probability 1/2 they are even over the part, with 1/4 over a region
// and with 1/4 over the touched faces. The centre of a region is even over the part, so that a density per area is 1 / a and
// the region has the probability a / A: one factor 1 / A for all measurements instead of one for each (docs/math.md,
// section 15).
Likelihood::Likelihood(const Shape& shape, const Problem& problem) : designs(1), shape(shape), problem(problem) {
    const Region& patch = problem.region;
    bool on_faces = false, on_edges = false;
    for (const auto& factor : problem.factors) {
        spread.push_back(Design::spread_over(*factor));
        log_outliers += factor->log_outlier;
        if (factor->has_models()) models = 2;
        on_faces = on_faces || (factor->codimension() == 1 && !factor->aimed());
        on_edges = on_edges || (factor->codimension() == 2 && factor->on_surface() && !factor->aimed());
    }
    if ((on_faces && patch.area > 0) || (on_edges && patch.length > 0)) {
        Design region, faces;
        if (on_faces && patch.area > 0) region.on_face = std::max(1.0, shape.area / patch.area);
        if (on_edges && patch.length > 0) region.on_edge = std::max(1.0, shape.edge_length / patch.length);
        region.log_weight = std::log(0.25) - std::log(on_faces ? region.on_face : region.on_edge);
        region.patch = true;
        const bool differs = region.on_face > 1 || region.on_edge > 1;
        designs[0].log_weight = std::log(differs ? 0.5 : 0.75);
        if (differs) designs.push_back(region);
        designs.push_back(faces);
    }
    for (Design& design : designs) design.labels.resize(problem.groups.size());
}

// The design that is even over the touched faces and edges: those on which the measurements without a direction are
// inliers. Call after combine(designs[0]). m faces are touched with probability 2^-m, each chosen by its area. Places of a
// scan follow its path: together they count as MOST_CHOSEN independent ones for the set of faces, so that a
// single point at a border does not outweigh the fit of all others.
void Likelihood::find_touched(Design& design) {
    design.on_face = design.on_edge = 1;
    design.log_weight = std::log(0.25);
    for (const int across : {1, 2}) {
        touched.clear();
        double count = 0;
        for (size_t j = 0; j < evaluated.size(); ++j) {
            const Evaluated& own = evaluated[j];
            if (spread[j] != across || !own.count || designs[0].inlier[j] < 0.5) continue;
            ++count;
            const Component* const first = &components.all[own.first];
            const int element = std::max_element(first, first + own.count, [](const Component& a, const Component& b) {
                                    return a.weight < b.weight;
                                })->element;
            if (element == -1) design.log_weight = -1e300;  // several faces at once
            else if (std::find(touched.begin(), touched.end(), element) == touched.end()) touched.push_back(element);
        }
        double share = 0;
        for (size_t k = 0; k < touched.size(); ++k) {
            const double own = shape.measure_of(touched[k]);
            share += own;
            design.log_weight += std::log(own * (k + 1) / 2);
        }
        const double power = std::min(1.0, MOST_CHOSEN / count);
        if (share > 0) (across == 1 ? design.on_face : design.on_edge) = std::pow(1 / share, power);
    }
}

// Joint log density of all factors: the mixture over the designs. Sets the responsibility of each component. While noise
// is blurred, touched faces are not known.
double Likelihood::combine() {
    const size_t count = designs.size() - (designs.size() > 1 && blur > 0);
    double top = -1e300, sum = 0;
    for (size_t k = 0; k < designs.size(); ++k) {
        Design& design = designs[k];
        if (k > 0 && k + 1 == count && count == designs.size()) find_touched(design);
        design.probability = k < count && design.log_weight > -1e300 ? design.log_weight + combine(design) : -1e300;
        top = std::max(top, design.probability);
    }
    for (Design& design : designs) sum += design.probability = std::exp(design.probability - top);
    responsibility.assign(components.size(), 0.0);
    for (Evaluated& own : evaluated) own.inlier = 0;
    for (Design& design : designs) {
        design.probability /= sum;
        if (!(design.probability > 0)) continue;
        for (size_t k = 0; k < responsibility.size(); ++k) responsibility[k] += design.probability * design.responsibility[k];
        for (size_t j = 0; j < evaluated.size(); ++j) evaluated[j].inlier += design.probability * design.inlier[j];
    }
    return top + std::log(sum);
}

// Weight of a component under one of two models of the device.
static double in_model(const Component& c, int model) {
    return c.model < 0 ? c.weight : c.model == model ? 2 * c.weight : 0.0;
}

// Joint log density: sum over the quadrature nodes q of the outlier rate of w_q prod_j [(1 - q) density_j + q], times the
// density of each label group. The models of a device are nodes, too.
// Sets the responsibility of each component. Labels are ignored while noise is blurred: a
// label must not exclude an adjacent face before the maximization has converged.
double Likelihood::combine(Design& design) {
    std::vector<double>& out = design.responsibility;
    const bool labelled = blur == 0;
    const size_t groups = labelled ? problem.groups.size() : 0;
    const int n = static_cast<int>(problem.factors.size()), nodes = static_cast<int>(problem.rates.size());
    double base = log_outliers;
    // density of each factor under each model of its device
    of_model.assign(static_cast<size_t>(models) * n, 0.0);
    for (int j = 0; j < n; ++j) {
        const Evaluated& own = evaluated[j];
        const double scale = scale_of(design, j);
        for (int h = 0; h < models; ++h) {
            double& density = of_model[static_cast<size_t>(models) * j + h];
            if (models == 1) density = scale * own.density;
            else
                for (int k = own.first; k < own.first + own.count; ++k) density += scale * in_model(components.all[k], h);
        }
    }
    node_log.assign(static_cast<size_t>(models) * nodes, 0.0);
    for (size_t g = 0; g < groups; ++g) find_elements(design, g);
    for (int q = 0; q < models * nodes; ++q) {
        const double rate = problem.rates[q / models];
        double product = 1, log = 0;
        for (int j = 0; j < n; ++j) {
            if (is_excluded(j) || (labelled && problem.group[j] >= 0)) continue;
            product *= (1 - rate) * of_model[static_cast<size_t>(models) * j + q % models] + rate + problem.furniture[j];
            if (product < 1e-200 || product > 1e200) {
                log += std::log(product);
                product = 1;
            }
        }
        node_log[q] = log + std::log(product) + std::log(problem.rate_weights[q / models] / models);
    }
    double top = -1e300, sum = 0;
    for (const double log : node_log) top = std::max(top, log);
    for (double& log : node_log) sum += log = std::exp(log - top);
    out.assign(components.size(), 0.0);
    for (int j = 0; j < n; ++j) {
        Evaluated& own = evaluated[j];
        own.inlier = 0;
        if ((labelled && problem.group[j] >= 0) || !own.count) continue;
        const double scale = scale_of(design, j);
        for (int h = 0; h < models; ++h) {
            const double density = of_model[static_cast<size_t>(models) * j + h];
            if (!(density > 0)) continue;
            double inlier = 0;
            for (int k = 0; k < nodes; ++k) {
                const double on = (1 - problem.rates[k]) * density;
                inlier += node_log[models * k + h] / sum * on / (on + problem.rates[k] + problem.furniture[j]);
            }
            own.inlier += inlier;
            for (int k = own.first; k < own.first + own.count; ++k) {
                const Component& c = components.all[k];
                out[k] += inlier * scale * (models == 1 ? c.weight : in_model(c, h)) / density;
            }
        }
    }
    for (size_t g = 0; g < groups; ++g) {
        base += log_group(design, g);
        weigh_elements(design, g);
        weigh_components(design, g, out);
    }
    design.inlier.resize(evaluated.size());
    for (size_t j = 0; j < evaluated.size(); ++j) design.inlier[j] = evaluated[j].inlier;
    return base + top + std::log(sum);
}

// The elements to which a label may refer, their prior probabilities, and the density of each factor on each element. A
// factor may contradict its label at the outlier rate. In a region, only the patch of the group counts of an element.
void Likelihood::find_elements(Design& design, size_t g) {
    const std::vector<int>& rows = problem.groups[g];
    LabelGroup& group = design.labels[g];
    group.elements.clear();
    group.log_prior.clear();
    group.factor.clear();
    bool by_area = false;
    for (const int j : rows) {
        const Factor& factor = *problem.factors[j];
        const Evaluated& own = evaluated[j];
        by_area = by_area || (factor.codimension() == 1 && !factor.aimed());
        for (int k = own.first; k < own.first + own.count; ++k) {
            const int element = components.all[k].element;
            if (factor.may_name(shape, element) &&
                std::find(group.elements.begin(), group.elements.end(), element) == group.elements.end())
                group.elements.push_back(element);
        }
    }
    const size_t E = group.elements.size();
    double scale = 1, whole = shape.area;  // scale: 1 for the design that is even over the part
    for (const int j : rows) {
        scale = std::max(scale, design.scale_of(*problem.factors[j]));
        if (problem.factors[j]->codimension() == 2) whole = shape.edge_length;
    }
    for (const int element : group.elements) {
        double share = shape.measure_of(element);
        if (design.patch && scale > 1) share = std::min(share, problem.region.groups[g] / whole);
        group.log_prior.push_back(element >= 0 && !by_area ? 0.0 : std::log(share * scale));
        group.factor.push_back(1 / share);  // ratio of the density on this element to that on all elements
    }
    group.on_element.assign(rows.size() * E, 0.0);
    for (size_t r = 0; r < rows.size(); ++r) {
        const bool aimed = problem.factors[rows[r]]->aimed();
        const Evaluated& own = evaluated[rows[r]];
        for (int k = own.first; k < own.first + own.count; ++k) {
            const Component& c = components.all[k];
            const size_t e = std::find(group.elements.begin(), group.elements.end(), c.element) - group.elements.begin();
            if (e < E) group.on_element[r * E + e] += c.weight * (aimed ? 1.0 : group.factor[e]);
        }
    }
}

// Log density of the factors of a group: the sum of the products over the elements, of the case of a wrong label, and of
// the case that the labelled surface is on another object. Wrong labels, and outliers among labelled points, have the
// stated rate: a sensor may make many outliers, but labels seldom contradict each other.
double Likelihood::log_group(Design& design, size_t g, bool anywhere) {
    const std::vector<int>& rows = problem.groups[g];
    LabelGroup& group = design.labels[g];
    const size_t E = group.elements.size();
    const double rare = problem.mean_rate;
    group.logs.assign(E + 2, 0.0);
    double top = -1e300, sum = 0;
    for (size_t e = 0; e <= E; ++e) {
        double log = e < E ? group.log_prior[e] : 0;
        for (size_t r = 0; r < rows.size(); ++r) log += std::log(labelled_density(design, g, r, e, rows[r]));
        group.logs[e] = log + std::log1p(-rare);
        top = std::max(top, group.logs[e]);
    }
    group.logs[E + 1] = anywhere ? std::log(rare) + problem.log_elsewhere[g] : -1e300;
    top = std::max(top, group.logs[E + 1]);
    for (double& log : group.logs) sum += log = std::exp(log - top);
    for (double& log : group.logs) log /= sum;  // probability of each element
    return top + std::log(sum);
}

// Density of a labelled factor relative to an outlier if its label refers to element e; e = number of elements: wrong label.
double Likelihood::labelled_density(const Design& design, size_t g, size_t r, size_t e, int row) const {
    const LabelGroup& group = design.labels[g];
    const double rare = problem.mean_rate, density = design.scale_of(*problem.factors[row]) * evaluated[row].density;
    const double on = e < group.elements.size() ? (1 - rare) * group.on_element[r * group.elements.size() + e] : 0.0;
    return (1 - rare) * (on + rare * density) + rare + problem.furniture[row];
}

// Weight of each factor for each element, then for a wrong label; call after log_group.
void Likelihood::weigh_elements(Design& design, size_t g) {
    const std::vector<int>& rows = problem.groups[g];
    LabelGroup& group = design.labels[g];
    const size_t E = group.elements.size();
    const double rare = problem.mean_rate;
    group.weights.assign(rows.size() * (E + 1), 0.0);
    for (size_t r = 0; r < rows.size(); ++r)
        for (size_t e = 0; e <= E; ++e) {
            const double share = group.logs[e] * (1 - rare) / labelled_density(design, g, r, e, rows[r]);
            if (e < E) group.weights[r * E + e] += share * (1 - rare);
            group.weights[rows.size() * E + r] += share * rare;
        }
}

void Likelihood::weigh_components(const Design& design, size_t g, std::vector<double>& out) {
    const std::vector<int>& rows = problem.groups[g];
    const LabelGroup& group = design.labels[g];
    const size_t E = group.elements.size();
    for (size_t r = 0; r < rows.size(); ++r) {
        const bool aimed = problem.factors[rows[r]]->aimed();
        const double scale = design.scale_of(*problem.factors[rows[r]]);
        Evaluated& own = evaluated[rows[r]];
        for (int k = own.first; k < own.first + own.count; ++k) {
            const Component& c = components.all[k];
            const size_t e = std::find(group.elements.begin(), group.elements.end(), c.element) - group.elements.begin();
            const double labelled = e < E ? group.weights[r * E + e] * (aimed ? 1.0 : group.factor[e]) : 0.0;
            out[k] = c.weight * (labelled + scale * group.weights[rows.size() * E + r]);
            own.inlier += out[k];
        }
    }
}

namespace {

// Derivatives of the log density of a factor by the log of the noise scale s. With r^2 the squared residual over the scaled
// part of the variance, and c the codimension, d log N / d log s = r^2 - c.
struct ScaleSlope {
    double gradient = 0, observed = 0, expected = 0, scaled = 0;

    void add(const Component& c, int codimension, double weight, double unscaled) {
        const double r = c.distance * c.per_sd, scaled_share = 1 - (unscaled + c.unscaled) * c.per_sd * c.per_sd;
        const double across = c.element >= 0 ? 1 : codimension;
        scaled += weight * scaled_share;
        gradient += weight * scaled_share * (r * r - across + c.spread);
        observed += 2 * weight * scaled_share * scaled_share * r * r;
        expected += 2 * weight * scaled_share * scaled_share * across;
    }
};

// Gradient and information of all components of a factor. The facets of one face draw a point to their middles but do not
// constrain it there: the information is that of the mixture, the mean of theirs minus the spread of their gradients.
//
// `left` becomes the fraction that the spread of several rays of a cone leaves of it: as their ranges have the variance of
// the noise and of the rays together, the noise is this fraction of it.
LocalSlope slope_of(const Components& components, const double* weights, std::vector<int>& order, double& left) {
    LocalSlope sum;
    double whole = 0, spread = 0;
    const Component* all = components.all.data();
    std::sort(order.begin(), order.end(), [&](int a, int b) { return all[a].element < all[b].element; });
    for (size_t first = 0, next; first < order.size(); first = next) {
        LocalSlope own;
        Mat3 pulls;
        double weight = 0, curvature = 0, pull_along = 0, squares = 0;  // of the residuals alone
        for (next = first; next < order.size() && all[order[next]].element == all[order[first]].element; ++next) {
            const int k = order[next];
            const Vec3 before = own.p;
            add_component(own, all[k], weights[k]);
            const Vec3 pull = own.p - before;
            add_outer(pulls, 1 / weights[k], pull, pull);
            weight += weights[k];
            const double per = all[k].per_sd, r = all[k].distance * per;
            curvature += weights[k] * per * per;
            pull_along += weights[k] * per * r;
            squares += weights[k] * per * per * r * r;
        }
        if (!all[order[first]].tilted && !all[order[first]].turns) {
            if (next - first > 1) {
                for (int i = 0; i < 9; ++i) own.pp.m[i] -= pulls.m[i];
                add_outer(own.pp, 1 / weight, own.p, own.p);
            }
            own.pp = not_negative(own.pp);
        }
        if (all[order[first]].turns && next - first > 1) {  // the rays of a cone pull in nearly the same direction
            const double here = std::max(1 - (squares - pull_along * pull_along / weight) / curvature, 0.0);
            own.scale_information(here);
            spread += (1 - here) * curvature;
        }
        whole += curvature;
        sum.add(own);
    }
    left = whole > 0 ? 1 - spread / whole : 0;
    return sum;
}

// The chain rule from a factor's position p and direction m in the part frame to the states (v, w, z):
//   dp = -v + y x w + R' G da, with y = p - centre,    dm = m x w + R' H da, and amounts da = rates dz.
void add_states(const LocalSlope& s, const Vec3& y, const Vec3& m, const Mat3& R, const Problem& problem, int j,
                const std::vector<double>& rates, bool with_pose, double* gradient, double* information) {
    const int D = problem.shared, K = problem.size(), P = 6 + D;
    const bool oriented = problem.factors[j]->has_direction();
    const int rows = oriented ? 6 : 3;
    // most shared errors are of other devices and do not move this measurement
    thread_local std::vector<int> columns;
    thread_local std::vector<double> rows_of_J, rows_of_BJ;
    const double *G = D ? problem.place_jacobian(j) : nullptr, *H = D && oriented ? problem.turn_jacobian(j) : nullptr;
    columns.clear();
    const int pose = with_pose ? 6 : 0;
    for (int k = 6 - pose; k < P; ++k) {
        bool moves = k < 6;
        for (int i = 0; i < 3 && !moves; ++i) moves = G[i * D + k - 6] != 0 || (H && H[i * D + k - 6] != 0);
        if (moves) columns.push_back(k);
    }
    const int n = static_cast<int>(columns.size());
    rows_of_J.assign(static_cast<size_t>(6) * n, 0.0);
    rows_of_BJ.assign(static_cast<size_t>(6) * n, 0.0);
    double *J[6], *BJ[6];
    for (int i = 0; i < 6; ++i) J[i] = &rows_of_J[static_cast<size_t>(i) * n], BJ[i] = &rows_of_BJ[static_cast<size_t>(i) * n];
    const double Y[9] = {0, -y.z, y.y, y.z, 0, -y.x, -y.y, y.x, 0};
    const double M[9] = {0, -m.z, m.y, m.z, 0, -m.x, -m.y, m.x, 0};
    for (int i = 0; i < 3 && pose; ++i)
        for (int k = 0; k < 3; ++k) {
            J[i][k] = i == k ? -1 : 0;
            J[i][3 + k] = Y[3 * i + k];
            J[3 + i][k] = 0;
            J[3 + i][3 + k] = M[3 * i + k];
        }
    for (int c = pose; c < n; ++c) {
        const int d = columns[c] - 6;
        const Vec3 g = transposed_times(R, {G[d], G[D + d], G[2 * D + d]});
        Vec3 h;
        if (H) {
            h = transposed_times(R, {H[d], H[D + d], H[2 * D + d]});
            h = h - dot(h, m) * m;  // a direction stays a unit vector
        }
        for (int i = 0; i < 3; ++i) {
            J[i][c] = rates[d] * g[i];
            J[3 + i][c] = rates[d] * h[i];
        }
    }
    for (int k = 0; k < n; ++k) {
        double& own = gradient[columns[k]];
        own += s.p.x * J[0][k] + s.p.y * J[1][k] + s.p.z * J[2][k];
        for (int i = 0; i < 3; ++i) BJ[i][k] = s.pp(i, 0) * J[0][k] + s.pp(i, 1) * J[1][k] + s.pp(i, 2) * J[2][k];
        if (!oriented) continue;
        own += s.m.x * J[3][k] + s.m.y * J[4][k] + s.m.z * J[5][k];
        for (int i = 0; i < 3; ++i) {
            BJ[i][k] += s.pm(i, 0) * J[3][k] + s.pm(i, 1) * J[4][k] + s.pm(i, 2) * J[5][k];
            BJ[3 + i][k] = s.pm(0, i) * J[0][k] + s.pm(1, i) * J[1][k] + s.pm(2, i) * J[2][k] + s.mm(i, 0) * J[3][k] +
                           s.mm(i, 1) * J[4][k] + s.mm(i, 2) * J[5][k];
        }
    }
    for (int a = 0; a < n; ++a)
        for (int b = 0; b <= a; ++b) {
            double sum = 0;
            for (int i = 0; i < rows; ++i) sum += J[i][a] * BJ[i][b];
            information[columns[a] * K + columns[b]] += sum;
        }
}

}  // namespace

// Gradient and information of all factors: of each component by position and direction, then by the states.
void Likelihood::add_factors(const State& state) {
    double observed = 0, expected = 0;
    const bool scales = problem.scale_sd > 0 && blur == 0;  // blurred noise is not that of a device
    const bool integrated = scales && with_pose;
    if (integrated) unscaled_points.assign(information.size(), 0.0);
    for (size_t j = 0; j < problem.factors.size(); ++j) {
        const Evaluated& own = evaluated[j];
        if (!own.count) continue;
        const Factor& factor = *problem.factors[j];
        order.clear();
        for (int k = own.first; k < own.first + own.count; ++k)
            if (responsibility[k] >= 1e-12) order.push_back(k);
        ScaleSlope scale;
        const double unscaled = factor.extra + blur * blur;
        if (scales) {
            for (const int k : order) scale.add(components.all[k], factor.codimension(), responsibility[k], unscaled);
            gradient.back() += problem.scale_sd * scale.gradient;
            observed += scale.observed;
            expected += scale.expected;
        }
        if (!with_pose && !problem.shared) continue;
        double left = 1;
        LocalSlope sum = slope_of(components, responsibility.data(), order, left);
        const auto add = [&](double* to) {
            add_states(sum, own.p - shape.centre, own.m, state.pose.R, problem, static_cast<int>(j), rates, with_pose,
                       gradient.data(), to);
        };
        add(information.data());
        sum.scale_information(1 - left * scale.scaled / own.inlier);
        sum.p = sum.m = {};
        if (integrated && left * scale.scaled < (1 - 1e-6) * own.inlier) add(unscaled_points.data());
    }
    if (integrated) of_points = information;
    for (size_t k = 0; integrated && k < information.size(); ++k) of_points[k] -= unscaled_points[k];
    // the observed curvature by the log of the scale nearly vanishes if the scale is far too large
    if (scales) information.back() += problem.scale_sd * problem.scale_sd * std::max(observed, LEAST_CURVED * expected);
}

}  // namespace tanteo
