// A measurement factor: one kind of measurement as a type. Everything that depends on the kind is asked of the factor;
// nothing else asks what kind it is. What is common to all kinds (outliers, labels, furniture, noise scale, shared
// errors) is written once around them, in likelihood.cpp.
//
// A factor's density is a mixture over the elements of the part that the measurement may be of (faces, edges, corners,
// axes): p(measurement | pose) = sum_i Component_i. Densities are over that of an outlier.
#pragma once
#include <algorithm>
#include <memory>
#include <vector>

#include "normal.hpp"
#include "shape/shape.hpp"
#include "vec.hpp"

namespace tanteo {

constexpr double REACH = 6;        // standard deviations beyond which a density is zero
constexpr double NEGLIGIBLE = 1e-9;  // of the outlier rate: a density that does not matter

// One element of the part that a measurement may be of: its density, and how the log of that density follows the place
// p of the measurement in the part and its direction m there.
//
// log density = -r^2 / 2 + log mass(p) + log tilt(p, m) + const, with the residual r = distance * per_sd along the
// normal. Elements other than faces keep all of their gradient and curvature in slope and stiff.
struct Component {
    double weight;              // density over that of an outlier
    double distance, per_sd;    // residual [m], and one over its standard deviation
    Vec3 normal;                // direction of the residual; zero where slope and stiff hold all of it
    Vec3 slope;                 // gradient of the log by p, of all but the residual
    Mat3 stiff;                 // minus the second derivative of that by p
    double spread = 0;          // derivative of the log of the truncated mass by the log of the noise
    int element;                // face, or a number below -1 for edges, corners and axes (Shape)
    bool tilted = false;        // whether a direction was sensed and compared
    double tilt[2], per_tilt[2];  // residuals of the direction along e, over their sd; one over the sd
    double bend[2], along;      // curvature of the surface along e [1/m]; cosine of the direction to the normal
    Vec3 e[2];
};

// Gradient of the log density of a measurement by p and m, and its Gauss-Newton information.
struct LocalSlope {
    Vec3 p, m;
    Mat3 pp, pm, mm;

    void add(const LocalSlope& other) {
        p += other.p;
        m += other.m;
        for (int i = 0; i < 9; ++i) pp.m[i] += other.pp.m[i], pm.m[i] += other.pm.m[i], mm.m[i] += other.mm.m[i];
    }
};

// The tip of a ball on an element, or another face that the ball must not enter (Components::contacts, near_faces).
struct BallContact {
    int flat, face;  // flat: -1 for an edge or a vertex
    bool round;
    Vec3 normal, on_it;
    double gap, mass;
};

// A measurement at a pose: its place and noise in the part's frame.
struct Placement {
    const Shape& shape;
    Mat3 R;             // attitude of the part in the world
    Vec3 p;             // place in the part, shared errors included
    Vec3 m;             // sensed direction in the part; zero where none was sensed
    Mat3 C;             // covariance in the part: noise scale, tolerance and blur included
    double blur;        // added to the noise of points [m], from coarse to fine
    double blur_turn;   // added to the noise of directions [rad]
    double negligible;  // a density that does not matter
    bool with_slope;
};

// The components of all measurements, one after another, and scratch space of one evaluation.
struct Components {
    std::vector<Component> all;
    std::vector<BallContact> contacts, near_faces;  // of one ball

    size_t size() const { return all.size(); }
};

// Places of the part where a measurement may be, each with the normal or axis there: for proposals. A ball's centre is one
// radius away along the normal.
struct Site {
    Vec3 at, normal;
};
class Sites {
  public:
    Sites(const Array<Vec3>& places, const Array<Vec3>& directions, double radius, size_t window)
        : places(places.data()), directions(directions.data()), radius(radius), count(places.size()), in_a_row(window) {}
    explicit Sites(const std::vector<Site>& sites) : radius(0), count(sites.size()), in_a_row(sites.size()) {
        for (const Site& site : sites) own_places.push_back(site.at), own_directions.push_back(site.normal);
        places = own_places.data();
        directions = own_directions.data();
    }
    Sites(const Sites&) = delete;
    size_t size() const { return count; }
    size_t window() const { return std::min(in_a_row, count); }  // how many in a row are searched for a partner
    Site operator[](size_t k) const { return {places[k] + radius * directions[k], directions[k]}; }

  private:
    const Vec3 *places, *directions;
    double radius;
    size_t count, in_a_row;
    std::vector<Vec3> own_places, own_directions;
};

// What pulls a measurement to the nearest element of its kind: for robust ICP refinement.
struct NearestElement {
    bool possible = false;     // whether the part has such an element
    bool contradicted = false; // whether it is looked at from behind
    double distance = 0;       // signed residual [m]
    Vec3 direction;            // of the residual
    Vec3 normal;               // of the surface, if a sensed normal is compared; zero otherwise
    double along = 1;          // cosine between the approach and the residual: its change with an offset along the approach
};

// A measurement beside the part, where it has no component: for messages.
struct NearestPlace {
    double distance, per_sd, density;  // density if it were right on it
    Vec3 normal;
    int element;
};

class Factor {
  public:
    virtual ~Factor() = default;

    Vec3 at;               // sensed place in the world
    Mat3 cov;              // of the device's noise, which the noise scale multiplies
    double extra = 0;      // variance that the noise scale leaves alone: the part's tolerance
    double log_outlier = 0;  // log density of an outlier
    Vec3 direction;        // sensed normal or axis in the world; zero where none was sensed
    double direction_sd = 1;  // of each of its tilts [rad]
    bool oriented = false;   // whether a direction was sensed
    bool isotropic = false;  // whether cov is a multiple of the identity

    // Appends the elements that the measurement may be of.
    virtual void evaluate(const Placement& placement, Components& out) const = 0;
    // In how many directions an element holds the measurement.
    virtual int codimension() const = 0;
    // Whether a label of this kind may name the element.
    virtual bool may_name(const Shape&, int) const { return true; }
    // Whether the density is not over the face's area: a beam of known direction meets one place of each face.
    virtual bool aimed() const { return false; }

    // Where on the part the measurement may be: poses are proposed from pairs of sites.
    virtual Sites sites(const Shape& shape) const = 0;
    // Capped cost of a pose, on coarse tables: squares of distance over blur and of tilt over tilt.
    virtual double rough_cost(const Shape& shape, const Pose& pose, double blur, double tilt) const = 0;
    // The nearest element at a place p of the part; coarse: to about a cell of the distance grid.
    virtual NearestElement nearest(const Shape& shape, const Pose& pose, const Vec3& p, bool coarse) const = 0;
    // What is nearest where no component is.
    virtual NearestPlace beside(const Shape& shape, const Pose& pose, const Vec3& p) const = 0;

    void set_noise(const Mat3& covariance, double tolerance_variance);
};

// Poses are scored roughly: no measurement costs more, it may be an outlier.
constexpr double ROUGH_CAP = 9;

// The place of the surface that is nearest to a place p of the part, for a ball of a radius (0 for a point) and a beam
// along a direction, if it is known.
NearestPlace nearest_on_surface(const Factor& factor, const Shape& shape, const Pose& pose, const Vec3& p, double radius,
                                const Vec3& inward, bool directed);

// Gradient and information of one component, to which a weight is applied.
void add_component(LocalSlope& sum, const Component& c, double weight);

// Density of a direction m about the normal n of an element, by its tilts to e[0] and e[1]: as uncertain as the sensor,
// and as the surface turns by its curvature where the point may be.
double tilt_density(const Vec3* e, const double* bend, const Vec3& n, const Mat3& C, const Vec3& m, double variance,
                    Component& component);

}  // namespace tanteo
