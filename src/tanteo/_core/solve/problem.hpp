// Measurements and priors of an inference, compiled once and read many times.
#pragma once
#include <memory>
#include <vector>

#include "factors/factor.hpp"
#include "solve/pose_term.hpp"

namespace tanteo {

// A free-space ray.
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

// The region that the measurements without a direction touch. Its size is that of their patch, whichever part it is of.
struct Region {
    double area = 0, length = 0;  // of the patch on faces [m^2] and on edges [m]; 0: no such measurement
    std::vector<double> groups;   // area or length of the patch of each label group
};

// The factors, and the data of their joint model: labels, outliers, furniture, shared errors, noise scale, region.
struct Problem {
    std::vector<std::shared_ptr<const Factor>> factors;
    std::vector<double> furniture;        // density on known furniture relative to an outlier, times its prior odds
    std::vector<int> group;               // label group of each factor, -1 for none
    std::vector<std::vector<int>> groups;  // rows of factors, one label group each
    std::vector<double> log_elsewhere;    // log density of a group on another object, relative to outliers
    std::vector<double> shared_jacobian;  // (n, 3, D): true position = position + jacobian z
    std::vector<double> direction_jacobian;  // (n, 3, D): true direction = direction + jacobian z; empty: none moves
    std::vector<FreeRay> rays;
    std::vector<double> ray_shifts, ray_turns;  // (m, 3, D)
    int shared = 0;                             // D
    std::vector<char> one_sided;                // whether each shared error acts on one side only; empty: none does
    double scale_sd = 0;                        // of the log of the noise scale; 0: the noise is as stated
    std::vector<double> rates, rate_weights;    // quadrature of the outlier rate
    double mean_rate = 0.02;
    std::vector<PosePrior> priors;
    std::vector<Table> tables;  // planes that the part touches
    Region region;
    std::vector<std::shared_ptr<const PoseTerm>> terms;  // further terms of the log density, such as images

    int size() const { return 6 + shared + (scale_sd > 0); }
    const double* place_jacobian(int j) const { return &shared_jacobian[static_cast<size_t>(j) * 3 * shared]; }
    const double* turn_jacobian(int j) const {
        return direction_jacobian.empty() ? nullptr : &direction_jacobian[static_cast<size_t>(j) * 3 * shared];
    }
};

}  // namespace tanteo
