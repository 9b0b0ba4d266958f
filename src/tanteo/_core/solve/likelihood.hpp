// The log density of all measurements, given a pose of the part, the shared errors and the noise scale.
#pragma once
#include <algorithm>
#include <vector>

#include "factors/face_queue.hpp"
#include "solve/problem.hpp"
#include "shape/shape.hpp"

namespace tanteo {

constexpr int MOST_STATES = 512;  // larger problems have too little memory and time

// A factor at a pose: its components, and the probability that it is no outlier.
struct Evaluated {
    Vec3 p, m;       // position and direction in the part frame
    int first = 0, count = 0;
    double density = 0;  // density on the part, relative to that of an outlier
    double inlier = 0;
};

// The factors of one label at a pose: the elements to which the label may refer.
struct LabelGroup {
    std::vector<int> elements;
    std::vector<double> log_prior, factor, on_element, logs, weights;
};

// One way in which the places of all measurements were chosen: evenly over the part, over one region of it, or over the
// faces that were touched. A density per area (or length) is that over the part times on_face (or on_edge).
struct Design {
    double on_face = 1, on_edge = 1, log_weight = 0;
    bool patch = false;      // whether only the patch of a label group counts of an element
    double probability = 0;  // at the state
    std::vector<LabelGroup> labels;
    std::vector<double> responsibility, inlier;  // of each component and of each factor

    double scale_of(const Factor& factor) const {
        const int across = spread_over(factor);
        return across == 1 ? on_face : across == 2 ? on_edge : 1;
    }
    // 1 if the density of a factor is per area of the part, 2 if per length of its edges, 0 if neither
    static int spread_over(const Factor& factor) {
        const int across = factor.codimension();
        return factor.aimed() || across == 3 || !factor.on_surface() ? 0 : across;
    }
};

// Height of the lowest point of a part over a table [m], and its derivatives by a small motion about the part's centre.
double height_over_table(const Shape& shape, const Table& table, const Pose& pose, double row[6]);

class Likelihood {
  public:
    Likelihood(const Shape& shape, const Problem& problem);

    // log density, prior included; with_slope: also gradient and Gauss-Newton information, of size() states,
    // about the centre of the shape
    double at(const State& state, bool with_slope) {
        queue.clear(with_slope);
        begin(state, with_slope, queue);
        queue.masses.run();
        return finish(state);
    }
    // The same in two steps, so that the lanes have the work of several poses: finish() in the order of begin(), after the
    // masses of the queue have run.
    void begin(const State& state, bool with_slope, FaceQueue& queue);
    double finish(const State& state);

    bool with_terms = true;          // whether further terms are added (PoseTerm)
    bool with_pose = true;           // whether factors add the slope by the pose, too; false: by the other states alone
    bool same_place = false;         // whether only the noise scale differs from the last state
    std::vector<char> coarse;        // whether each factor counts while noise is blurred; empty: all do
    double blur = 0, blur_turn = 0;  // added to the noise of places [m] and directions [rad]: coarse to fine
    std::vector<double> gradient, information;
    double log_points = 0;  // log density of the factors alone
    double log_pose = 0;    // of the pose priors: its normal densities, and its height over tables
    // if the noise scale is a state: information of the factors alone, each times the fraction of its variance that the
    // scale multiplies
    std::vector<double> of_points;
    std::vector<Evaluated> evaluated;
    Components components;

    // the designs: even over the part; even over a region, unless that is the part; even over the touched faces, last
    std::vector<Design> designs;

    // log density of a label group if its element is on the part, relative to outliers; call after at()
    double log_on_part(Design& design, size_t g) { return log_group(design, g, false); }

  private:
    const Shape& shape;
    const Problem& problem;
    std::vector<double> node_log, of_model, responsibility;
    std::vector<double> unscaled_points;  // information of the rest of the variance
    std::vector<double> amounts, rates;  // of the shared errors at the state, and their derivatives by it
    std::vector<int> spread;   // Design::spread_over of each factor
    double log_outliers = 0;   // log density of all factors as outliers
    int models = 1;            // number of models of their devices
    std::vector<int> touched;  // elements that measurements without a direction touch
    std::vector<int> order;  // components of a factor by element
    std::vector<Placement> placements;
    std::vector<std::vector<Component>> predicted;  // Placement::predicted of each factor
    FaceQueue queue;
    bool has_slope = false;  // whether finish() computes it

    double scale_of(const Design& design, int j) const {
        return spread[j] == 1 ? design.on_face : spread[j] == 2 ? design.on_edge : 1;
    }
    bool is_excluded(int j) const { return blur > 0 && !coarse.empty() && !coarse[j]; }
    void place(const State& state, int j, bool with_slope);
    void evaluate(int j, const Placement& placement);
    double combine();
    double combine(Design& design);
    void find_touched(Design& design);
    void find_elements(Design& design, size_t g);
    double log_group(Design& design, size_t g, bool anywhere = true);
    double labelled_density(const Design& design, size_t g, size_t r, size_t e, int row) const;
    void weigh_elements(Design& design, size_t g);
    void weigh_components(const Design& design, size_t g, std::vector<double>& out);
    void add_factors(const State& state);
    double add_rays(const State& state);
    double add_priors(const State& state, bool with_slope);
    double add_pose_prior(const Pose& pose, bool with_slope);
    double add_table(const Table& table, const Pose& pose, bool with_slope);
    void add_residuals(double share, const double* r, const double* rows, int count);
};

}  // namespace tanteo
