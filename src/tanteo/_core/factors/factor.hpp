// A measurement factor: one class for each kind of measurement. Only the factor depends on the kind. The model that all
// kinds share (outliers, labels, furniture, noise scale, shared errors) is in likelihood.cpp.
//
// A factor's density is a mixture over the elements of the part that may have been measured (faces, edges, corners,
// axes): p(measurement | pose) = sum_i Component_i. Densities are relative to that of an outlier.
#pragma once
#include <algorithm>
#include <memory>
#include <vector>

#include "normal.hpp"
#include "shape/shape.hpp"
#include "vec.hpp"

namespace tanteo {

constexpr double REACH = 6;        // standard deviations beyond which a density is zero
constexpr double NEGLIGIBLE = 1e-9;  // densities below this fraction of the outlier rate are dropped

// One element of the part that may have been measured: its density, and the derivatives of the log density by the
// position p of the measurement in the part frame and by its direction m there.
//
// log density = -r^2 / 2 + log mass(p) + log tilt(p, m) + const, with the residual r = distance * per_sd along the
// normal. Elements other than faces have all of their gradient and curvature in slope and stiff.
struct Component {
    double weight;              // density relative to that of an outlier
    double distance, per_sd;    // residual [m], and one over its standard deviation
    double unscaled = 0;        // variance that the noise scale does not multiply, in addition to that of the factor [m^2]
    Vec3 normal;                // direction of the residual; zero if slope and stiff contain all of it
    Vec3 slope;                 // gradient of the log density by p, without the residual
    Mat3 stiff;                 // minus the second derivative of the same part by p
    double spread = 0;          // derivative of the log truncated mass by the log noise scale
    int element;                // face, or a number below -1 for edges, corners and axes (Shape)
    bool tilted = false;        // whether a direction was sensed and compared
    double tilt[2], per_tilt[2];  // residuals of the direction along e, over their sd; one over the sd
    double bend[2], along;      // curvature of the surface along e [1/m]; cosine of the direction to the normal
    Vec3 e[2];
    bool turns = false;  // whether the residual depends on the direction of a beam, too
    int model = -1;      // model of the device to which it belongs (Factor::has_models); -1: both
    Vec3 by_turn;        // derivative of the distance by that direction [m]
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
    void scale_information(double by) {
        for (int i = 0; i < 9; ++i) pp.m[i] *= by, pm.m[i] *= by, mm.m[i] *= by;
    }
};

// Contact of a ball tip with an element, or a face that the ball must not enter (Components::contacts, near_faces).
struct BallContact {
    int flat, face;  // flat: -1 for an edge or a vertex
    bool round;
    Vec3 normal, on_it;
    double gap, mass;
};

// A measurement at a pose: its position, direction and noise in the part frame.
struct Placement {
    const Shape& shape;
    Mat3 R;             // attitude of the part in the world
    Vec3 p;             // position in the part frame, shared errors included
    Vec3 m;             // sensed direction in the part frame; zero if none was sensed
    Mat3 C;             // covariance in the part frame: noise scale, tolerance and blur included
    double blur;        // added to the noise of points [m], from coarse to fine
    double blur_turn;   // added to the noise of directions [rad]
    double negligible;  // density below which a component is dropped
    bool with_slope;
    Vec3 world;         // position in the world, shared errors included
    bool with_place;    // whether derivatives by position and direction are needed, not by the noise scale alone
    bool is_known;      // whether the place is that of the last evaluation
    std::vector<Component>* predicted;  // what a factor keeps of it: components of which only the weight depends on the noise
};

class FaceQueue;

// The components of all measurements, one after another, and work space of one evaluation.
struct Components {
    std::vector<Component> all;
    FaceQueue* queue = nullptr;                     // what the factors began
    std::vector<BallContact> contacts, near_faces;  // of one ball

    size_t size() const { return all.size(); }
};

// Places of the part that may have been measured, each with its normal or axis, for proposals. The centre of a ball is one
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
    size_t window() const { return std::min(in_a_row, count); }  // number of consecutive sites that are searched for a partner
    Site operator[](size_t k) const { return {places[k] + radius * directions[k], directions[k]}; }

  private:
    const Vec3 *places, *directions;
    double radius;
    size_t count, in_a_row;
    std::vector<Vec3> own_places, own_directions;
};

// The element of the right kind that is nearest to a measurement, for robust ICP refinement.
struct NearestElement {
    bool possible = false;     // whether the part has such an element
    bool contradicted = false; // whether the sensor would be on the inner side of the surface
    double distance = 0;       // signed residual [m]
    Vec3 direction;            // of the residual
    Vec3 normal;               // of the surface, if a sensed normal is compared; zero otherwise
    Vec3 beside;               // from the measurement to the place whose distance it is, in the part frame; zero for most
    double along = 1;          // cosine between approach and residual: derivative of the residual by an offset along the approach
};

// The element nearest to a measurement without a component, for messages.
struct NearestPlace {
    double distance, per_sd, density;  // density: if the measurement were exactly on the element
    Vec3 normal;
    int element;
};

class Factor {
  public:
    virtual ~Factor() = default;

    Vec3 at;               // sensed position in the world [m]
    Mat3 cov;              // covariance of the device's noise, which the noise scale multiplies [m^2]
    double extra = 0;      // variance that the noise scale does not multiply: the part's tolerance [m^2]
    double log_outlier = 0;  // log density of an outlier
    Vec3 direction;        // sensed normal or axis in the world; zero if none was sensed
    double direction_sd = 1;  // standard deviation of each of its tilts [rad]
    bool oriented = false;   // whether a direction was sensed
    bool aims = false;       // whether `direction` is the axis of a beam on which the density depends
    bool isotropic = false;  // whether cov is a multiple of the identity

    bool has_direction() const { return oriented || aims; }
    // Adds work that runs in lanes for many factors together; evaluate() at the same placement takes the results.
    virtual void begin(const Placement&, FaceQueue&) const {}
    // Appends a component for each element that may have been measured.
    virtual void evaluate(const Placement& placement, Components& out) const = 0;
    // Number of directions in which an element constrains the measurement.
    virtual int codimension() const = 0;
    // Whether it measures the surface and not a landmark, whose density is a fraction of all landmarks and not per area or
    // length of the part.
    virtual bool on_surface() const { return true; }
    // Whether a label of this measurement may refer to the element.
    virtual bool may_name(const Shape&, int) const { return true; }
    // Whether the density is not per area of the face: a beam of known direction hits one point of each face.
    virtual bool aimed() const { return false; }

    // Whether its device has one of two models, unknown but equal for all measurements; weights are those of half and half.
    virtual bool has_models() const { return false; }

    // Places of the part that may have been measured: poses are proposed from pairs of sites.
    virtual Sites sites(const Shape& shape) const = 0;
    // Truncated cost at a pose by coarse tables: squared distance over blur, and squared tilt over `tilt`.
    virtual double rough_cost(const Shape& shape, const Pose& pose, double blur, double tilt) const = 0;
    // The element nearest to a point p in the part frame; coarse: to about one cell of the distance grid.
    virtual NearestElement nearest(const Shape& shape, const Pose& pose, const Vec3& p, bool coarse) const = 0;
    // The element nearest to a point p in the part frame that has no component.
    virtual NearestPlace beside(const Shape& shape, const Pose& pose, const Vec3& p) const = 0;

    void set_noise(const Mat3& covariance, double tolerance_variance);
};

// Largest rough cost of one measurement: it may be an outlier.
constexpr double ROUGH_CAP = 9;

// The point of the surface nearest to a point p in the part frame, for a ball of a radius (0 for a point) and, if directed,
// a beam along `inward`.
NearestPlace nearest_on_surface(const Factor& factor, const Shape& shape, const Pose& pose, const Vec3& p, double radius,
                                const Vec3& inward, bool directed);

// Adds gradient and information of one component, times a weight.
void add_component(LocalSlope& sum, const Component& c, double weight);

// Density of a sensed direction m about the normal n of an element, by its tilts along e[0] and e[1]. The variance is that
// of the sensor, plus that of the normal of a curved surface because the position is uncertain.
double tilt_density(const Vec3* e, const double* bend, const Vec3& n, const Mat3& C, const Vec3& m, double variance,
                    Component& component);

}  // namespace tanteo
