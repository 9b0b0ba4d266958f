#include "factors/image_edges.hpp"

#include <algorithm>
#include <cmath>

#include "normal.hpp"

namespace tanteo {

namespace {

constexpr int MOST_COLUMNS = 21;

// Slope of a sum over the states of one image, which are few of all.
class OwnSlope {
  public:
    explicit OwnSlope(int count) : count(count) {
        std::fill_n(gradient, count, 0.0);
        std::fill_n(information, count * count, 0.0);
    }
    void add(double pull, double weight, const double* row) {
        for (int a = 0; a < count; ++a) {
            gradient[a] += pull * row[a];
            const double scaled = weight * row[a];
            for (int b = 0; b <= a; ++b) information[a * count + b] += scaled * row[b];
        }
    }
    void add(double factor, const OwnSlope& other) {
        for (int a = 0; a < count; ++a) gradient[a] += factor * other.gradient[a];
        for (int k = 0; k < count * count; ++k) information[k] += factor * other.information[k];
    }
    void add_to(const Slope& slope, const int* columns) const {
        for (int a = 0; a < count; ++a) {
            slope.gradient[columns[a]] += gradient[a];
            for (int b = 0; b <= a; ++b)
                slope.information[std::max(columns[a], columns[b]) * slope.size + std::min(columns[a], columns[b])] +=
                    information[a * count + b];
        }
    }

  private:
    int count;
    double gradient[MOST_COLUMNS], information[MOST_COLUMNS * MOST_COLUMNS];
};

double normal_density(double d, double sd) { return std::exp(-0.5 * d * d / (sd * sd)) / (std::sqrt(2 * PI) * sd); }

}  // namespace

// A visible sample, matched to an edge point of the image or not.
struct ImageEdges::Sample {
    EdgeMatch at;
    int edge;
    double seen, offset;
    const double* row;  // derivative of the offset by the states
};

ImageEdges::ImageEdges(std::shared_ptr<const EdgePart> part_, std::shared_ptr<const EdgeImage> image_,
                       const EdgeRules& rules_, std::vector<PoseLevel> levels_, double reach_, int first_,
                       int common_)
    : part(std::move(part_)),
      image(std::move(image_)),
      rules(rules_),
      levels(std::move(levels_)),
      reach(reach_),
      first(first_),
      common(common_),
      points{image->nearest.data(), static_cast<int64_t>(image->sds.size()), image->rows, image->columns,
             image->pixels.data(), image->sds.data(), Channels(image->channels)} {}

double ImageEdges::add(const State& state, const Slope* slope) const { return evaluate(state, slope).log; }

// The level of the nearest pose, by the mean squared distance of the part's marks. Beyond a fraction `near` of their spread
// it is at least `least`: the constants of poses at which few edges match apply to no other poses.
double ImageEdges::level_at(const Pose& T, double least) const {
    if (levels.empty()) return 0;
    double best = 1e300, level = 0;
    for (const PoseLevel& one : levels) {
        double apart = 0;
        for (const Vec3& p : part->marks)
            apart += squared(one.T_world_part.R * p + one.T_world_part.t - (T.R * p + T.t));
        if (apart < best) best = apart, level = one.level;
    }
    Vec3 middle;
    for (const Vec3& p : part->marks) middle += (1.0 / part->marks.size()) * p;
    double spread = 0;
    for (const Vec3& p : part->marks) spread += squared(p - middle);
    return best < rules.near * rules.near * spread ? level : std::max(level, least);
}

ImageEdges::Sums ImageEdges::evaluate(const State& state, const Slope* slope) const {
    const EdgeFrame& frame = *part->frame;
    const double* z = state.z.data() + first;
    const int of_camera = image->camera_states(), of_shift = image->shift_states();
    const int own = image->states(), states = own + image->mount_states();
    Pose camera = image->T_world_camera;
    // the roots of the errors of the camera's pose, the errors, and their first columns of a row
    struct Root {
        const double *root, *z;
        int column;
    };
    std::vector<Root> roots;
    if (of_camera) roots.push_back({image->camera_root.data(), z, 6});
    if (states > own) roots.push_back({image->mount_root.data(), state.z.data() + common, 6 + own});
    if (!roots.empty()) {
        double xi[6] = {0};
        for (const Root& one : roots)
            for (int i = 0; i < 6; ++i)
                for (int k = 0; k < 6; ++k) xi[i] += one.root[6 * i + k] * one.z[k];
        camera = moved(camera, load(xi), load(xi + 3), {});
    }
    Lens lens = image->lens;
    if (of_shift) {
        lens.cx += image->shift_sd * z[of_camera];
        lens.cy += image->shift_sd * z[of_camera + 1];
    }
    const double response = 0.5 + (image->has_response ? 0.5 * z[own - 1] : 0);
    const Pose pose{transposed(camera.R) * state.pose.R, into_part(camera, state.pose.t)};  // part in the camera frame
    const std::shared_ptr<const EdgeView> view = frame.view_from(into_part(pose, {}));

    int columns[MOST_COLUMNS];
    for (int c = 0; c < 6 + states; ++c) columns[c] = c < 6 ? c : c < 6 + own ? first + c : common + c - own;
    std::vector<Sample> all;
    std::vector<size_t> matched;  // of all samples
    std::vector<EdgePlace> everywhere, places;
    std::vector<double> rows;
    all.reserve(frame.size());
    matched.reserve(frame.size());
    everywhere.reserve(frame.size());
    places.reserve(frame.size());
    if (slope) rows.reserve(frame.size() * (6 + states));
    std::vector<double> missed(part->edges), missed_log(part->edges);
    for (size_t k = 0; k < frame.size(); ++k) {
        if (!view->shown[k]) continue;
        const EdgeMatch m = match_edge(lens, points, frame.samples[k], pose, true, frame.diagonal, reach);
        if (!m.inside) continue;
        const double seen = view->rims[k] ? rules.rim_seen : rules.crease_seen;
        const int edge = part->groups[k];
        all.push_back({m, edge, seen, 0, nullptr});
        everywhere.push_back({m.x, m.y, m.nx, m.ny, m.span, 0, edge});
        if (m.point < 0) {
            missed[edge] += m.span;
            missed_log[edge] += m.span * std::log1p(-seen);
            continue;
        }
        // blur moves edge points of a bend inside by half its square over the radius (Bouma and others 2005)
        const double scale = m.span / frame.samples[k].length, width = image->widths[m.point];
        const double* normal = &image->normals[2 * m.point];
        const double side = std::copysign(1.0, m.nx * normal[0] + m.ny * normal[1]);
        const double responding = side * image->responses[m.point];
        const double curvature = dot(load(m.slope), part->bends[k]) / std::max(scale * scale, 1e-300);
        const double pulled = 0.5 * (width * width - image->blur * image->blur) * curvature + side * image->drifts[m.point];
        const double offset =
            m.offset - std::min(std::max(pulled, -rules.most_pulled), rules.most_pulled) - response * responding;
        all.back().offset = offset;
        if (slope) {
            // the offset shrinks by m.slope along motions of the part about its origin; about c they are (v + c x w, w)
            double* row = rows.data() + rows.size();
            rows.resize(rows.size() + 6 + states);
            all.back().row = row;
            const Vec3 by = load(m.slope), turn = load(m.slope + 3) + cross(by, slope->centre);
            store(-by, row);
            store(-turn, row + 3);
            for (const Root& one : roots) {  // with the camera, a point of its frame moves by -v - w x p
                const Vec3 by_point = pose.R * by, by_turn = cross(pose.R * frame.samples[k].at + pose.t, by_point);
                for (int c = 0; c < 6; ++c) {
                    row[one.column + c] = 0;
                    for (int i = 0; i < 3; ++i)
                        row[one.column + c] += by_point[i] * one.root[6 * i + c] + by_turn[i] * one.root[6 * (3 + i) + c];
                }
            }
            if (of_shift) {
                row[6 + of_camera] = -image->shift_sd * m.nx;
                row[7 + of_camera] = -image->shift_sd * m.ny;
            }
            if (image->has_response) row[5 + own] = -0.5 * responding;
        }
        matched.push_back(all.size() - 1);
        places.push_back({m.x + offset * m.nx, m.y + offset * m.ny, m.nx, m.ny, std::max(m.span, rules.beside),
                          std::fabs(offset), edge});
    }
    const std::vector<char> is_own = foremost(places, rules.along);
    std::vector<double> length(part->edges);
    for (size_t k = 0; k < matched.size(); ++k)
        if (is_own[k]) length[all[matched[k]].edge] += all[matched[k]].at.span;

    Sums sums;
    OwnSlope found(slope ? 6 + states : 0);
    const double spread = 1 / (rules.spread * rules.spread), wide = 1 / (rules.displaced_sd * rules.displaced_sd);
    for (size_t k = 0; k < matched.size(); ++k) {
        if (!is_own[k]) continue;
        const Sample& sample = all[matched[k]];
        const EdgeMatch& m = sample.at;
        const float chance = image->chance[image->chance.size() > 1 ? m.point : 0];
        const double d = sample.offset, scale = sample.seen * 2 * rules.reach / chance;
        const double near = (1 - rules.displaced) * scale * normal_density(d, rules.spread);
        const double far = rules.displaced * scale * normal_density(d, rules.displaced_sd);
        const double total = near + far + 1 - sample.seen;
        const double weight = m.span / rules.stretch / (1 + length[sample.edge] / rules.whole);
        sums.hits += weight * std::log(total);
        sums.squares += d * d;
        sums.matched += 1;
        if (!slope) continue;
        const double information = rules.hits * weight * (near * spread + far * wide) / total;
        found.add(-information * d, information, sample.row);
    }
    for (int e = 0; e < part->edges; ++e)
        if (missed[e] > 0) sums.misses += missed_log[e] / rules.stretch / (1 + missed[e] / rules.whole);
    if (rules.astray > 0) locate(all, ambiguous_places(everywhere, rules.beside, rules.along), sums, slope, columns, 6 + states);
    if (slope) found.add_to(*slope, columns);
    sums.there = rules.hits * sums.hits + rules.misses * sums.misses;
    sums.log = sums.there + sums.located - level_at(state.pose, sums.astray);
    return sums;
}

// The sum S, which depends on the positions of edges. Samples beside another edge of the part are excluded, and samples far
// from the median of their edge. With independent variances W^-1 and a common error with standard deviations b, the
// inverse of W^-1 + b b' follows from Woodbury's formula; its determinant is that of W^-1 times 1 + b' W b.
void ImageEdges::locate(const std::vector<Sample>& all, const std::vector<char>& beside, Sums& sums, const Slope* slope,
                        const int* columns, int count) const {
    struct Case {
        double more, log;  // more: variance of the common error beyond the stated one [px^2]
        OwnSlope slope;
        double chi2 = 0, draws = 0;
    };
    count = slope ? count : 0;
    Case cases[] = {{0, std::log(1 - rules.inexact), OwnSlope(count)},
                    {0.25 * rules.displaced_sd * rules.displaced_sd, std::log(rules.inexact), OwnSlope(count)}};
    std::vector<std::vector<const Sample*>> edges(part->edges);
    std::vector<char> visible(part->edges);
    for (size_t k = 0; k < all.size(); ++k) {
        if (beside[k]) continue;
        visible[all[k].edge] = 1;
        if (all[k].at.point >= 0) edges[all[k].edge].push_back(&all[k]);
    }
    for (int e = 0; e < part->edges; ++e) {
        if (!visible[e]) continue;
        std::vector<const Sample*>& own = edges[e];
        sums.astray += std::log(rules.astray);
        std::sort(own.begin(), own.end(), [](const Sample* a, const Sample* b) { return a->offset < b->offset; });
        const double median = own.empty() ? 0 : 0.5 * (own[(own.size() - 1) / 2]->offset + own[own.size() / 2]->offset);
        double square = 0, draws = 0, stated = 1;
        std::vector<double> weights;
        OwnSlope independent(count);  // without the common error; the same in both cases
        for (const Sample*& one : own) {
            const double sd = image->sds[one->at.point], b0 = image->commons[one->at.point], d = one->offset;
            const bool with_the_rest = std::fabs(d - median) < 4 * std::sqrt(sd * sd + b0 * b0 + rules.spread * rules.spread);
            const double share = with_the_rest ? std::min(one->at.span / rules.correlation, 1.0) : 0.0;
            const double w = share / (sd * sd);
            weights.push_back(w);
            square += w * d * d;
            draws += share;
            if (slope) independent.add(-w * d, w, one->row);
        }
        for (Case& one_case : cases) {
            double along = 0, total = 1;
            std::array<double, MOST_COLUMNS> common{};
            for (size_t k = 0; k < own.size(); ++k) {
                const double b0 = image->commons[own[k]->at.point], b = std::sqrt(b0 * b0 + one_case.more), w = weights[k];
                along += w * b * own[k]->offset;
                total += w * b * b;
                for (int c = 0; c < count; ++c) common[c] += w * b * own[k]->row[c];
            }
            if (&one_case == cases) stated = total;
            const double chi2 = square - along * along / total;
            const double is_own = own.empty() ? 0 : (1 - rules.astray) * std::sqrt(stated / total) * std::exp(0.5 * (draws - chi2));
            const double probability = is_own / (is_own + rules.astray);
            one_case.log += std::log(is_own + rules.astray);
            one_case.chi2 += probability * chi2;
            one_case.draws += probability * draws;
            if (!slope) continue;
            one_case.slope.add(probability, independent);
            one_case.slope.add(probability * along / total, -probability / total, common.data());
        }
    }
    const double most = std::max(cases[0].log, cases[1].log), least = std::min(cases[0].log, cases[1].log);
    const double located = most + std::log1p(std::exp(least - most));
    sums.located += located;
    OwnSlope own_slope(count);
    for (const Case& one : cases) {
        const double probability = std::exp(one.log - located);
        sums.chi2 += probability * one.chi2;
        sums.draws += probability * one.draws;
        if (slope) own_slope.add(probability, one.slope);
    }
    if (slope) own_slope.add_to(*slope, columns);
}

}  // namespace tanteo
