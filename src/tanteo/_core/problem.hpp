// What was sensed and what is known beforehand: packed once, read many times.
#pragma once
#include <memory>
#include <vector>

#include "pose_term.hpp"

namespace tanteo {

// CENTRE: of a circle, on the axis of a hole or boss; ROUND: of a face that is not flat; BALL: centre of a sphere;
// APEX: of a cone.
enum class Kind : int { FACE = 0, EDGE = 1, CORNER = 2, CENTRE = 3, ROUND = 4, BALL = 5, APEX = 6 };

// A sensed point: of a face, edge or corner of the part, or an outlier.
struct Point {
    Vec3 at;            // world; of a ball its centre
    Mat3 cov;           // of the sensor alone
    double extra = 0;   // variance that the noise scale leaves alone: the tolerance of the part
    double radius = 0;  // of the ball; from an apex how far along the axis
    Vec3 direction;     // of the sensor, into the material; or about into it, where only the side is known; else zero
    Vec3 normal;        // sensed, outward, or the axis of a circle or cone; zero where it was not
    double normal_sd = 1;
    double reach = 0;       // free-space ray before the point along its direction
    double log_outlier = 0; // density if it is an outlier
    double furniture = 0;   // density on what is known to stand around, over that, times the odds of being there
    double circle = 0, circle_sd = 1;  // radius of what it is the centre of, half angle of a cone; 0 if nobody knows
    int hole = 0;                      // 1: of a hole, -1: of a boss
    Kind kind = Kind::FACE;
    int group = -1;  // of rows that share one face
    bool directed = false, sided = false, oriented = false, isotropic = false;

    bool on_face() const { return kind == Kind::FACE || kind == Kind::ROUND; }
    bool amid() const { return kind == Kind::CENTRE || kind == Kind::BALL || kind == Kind::APEX; }  // not on the surface
};

// A straight path on which nothing was met.
struct FreeRay {
    Vec3 origin, direction;
    double length = 0, slope = 0, least_cosine = 0;
};

// One normal density of poses, in the tangent at its mean: log(T0^-1 T) has the information root' root.
struct PosePrior {
    Pose mean;
    double root[36];  // row-major: residuals are root * xi
    double log_weight = 0;
};

struct Table {
    Vec3 point, normal;
    double sd = 0;
};

struct Problem {
    std::vector<Point> points;
    std::vector<double> shared_jacobian;  // (n, 3, D): true point = point + gain z
    std::vector<std::vector<int>> groups;  // rows of points, one group each
    std::vector<double> log_elsewhere;  // of each group if it is off the part as a whole, over that of as many outliers
    std::vector<FreeRay> rays;
    std::vector<double> ray_shifts, ray_turns;  // (m, 3, D)
    int shared = 0;                             // D
    double scale_sd = 0;                        // of the log of the noise scale; 0: the noise is as stated
    std::vector<double> rates, rate_weights;    // quadrature of the outlier rate
    double mean_rate = 0.02;
    std::vector<PosePrior> priors;
    bool has_table = false;
    Table table;
    std::vector<std::shared_ptr<const PoseTerm>> terms;  // of images and others: added to the log density as they are

    int size() const { return 6 + shared + (scale_sd > 0); }
    const double* gain(int j) const { return &shared_jacobian[static_cast<size_t>(j) * 3 * shared]; }
};

}  // namespace tanteo
