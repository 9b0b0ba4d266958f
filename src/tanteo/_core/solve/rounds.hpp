// Circles (rims), cylinders, cones and spheres by maximum likelihood from points: docs/math.md, section 8 "Round, ML".
#pragma once
#include <cmath>
#include <limits>
#include <vector>

#include "vec.hpp"

namespace tanteo {

enum class RoundKind : int { CIRCLE = 0, CYLINDER = 1, CONE = 2, SPHERE = 3 };

// Signed distances from a round feature of size s (radius, half angle) to a point p in its frame: zero on the feature,
// positive outside the round body. A surface has one row; a rim has two, along its axis and radial.
struct RoundDistance {
    int rows = 1;
    double F[2] = {0, 0};
    Vec3 G[2];  // dF / dp; the last is the normal of a surface
    double by_size[2] = {0, 0};
    Mat3 H;       // second derivatives of the last row; those of the other are zero
    Vec3 turned;  // derivative of the normal by the size
};
RoundDistance round_distance(RoundKind surface, const Vec3& p, double s);

// Input of a fit. The unknowns are rows of a small motion of the frame, the size if it is free, and the whitened shared
// errors of the points: the true point is the measured one + shared_jacobian z.
struct RoundTask {
    RoundKind kind = RoundKind::CIRCLE, surface = RoundKind::CIRCLE;  // a circle of points of a wall has two
    std::vector<int> rows;
    std::vector<Vec3> points;
    std::vector<Mat3> covs;
    std::vector<Vec3> normals;  // sensed, out of the round body; zero for a point without one; empty if no point has one
    std::vector<double> normal_sds;  // infinite for a point without a normal
    std::vector<Vec3> outward;  // all away from the axis, or all towards it; zero if unknown; empty if all are unknown
    std::vector<double> shared_jacobian;  // (n, 3, D)
    int shared = 0, side = 0;             // side: 1 where outward has to lead away from the axis, -1 towards it
    bool sized = false;                   // whether the size is known; its value and standard deviation
    double size = 0, size_sd = 0;
    bool framed = false;  // whether the frame is known, with information (m, m) over the rows
    Mat3 frame_turn;
    Vec3 frame_origin;
    std::vector<double> frame_information, frame_jacobian;  // (m, D): true frame = known frame exp(own error + jacobian z)
    double as_good = 9.21, limit = 0;  // fits within as_good of the least sum of squares, or below the limit, are equally good

    bool free_size() const { return !sized || size_sd > 0; }
    bool slides() const { return kind == RoundKind::CYLINDER; }  // whether its origin stays at the mean of the points
    double largest() const { return kind == RoundKind::CONE ? 1.5 : std::numeric_limits<double>::infinity(); }
    int unknowns() const { return static_cast<int>(rows.size()) + free_size() + shared; }
};

struct RoundState {
    Mat3 R = identity();
    Vec3 c;
    double s = 0;
    std::vector<double> z;
};

// A task linearized at a state: at most four residuals for each point (distances, two of a normal), by M unknowns.
struct RoundLinear {
    int k = 1, M = 0;
    std::vector<double> e, W;  // distances without the mean effect of curvature (n, k); inverse covariances (n, 4, 4)
    std::vector<double> h;     // derivatives of all residuals by the unknowns (n, 4, M)
    std::vector<Vec3> G;       // derivatives of all residuals by the points, in the world (n, 4)
    std::vector<double> each;  // weighted square of each point's residuals
    std::vector<double> information, gradient;  // gradient of -chi2 / 2
    double chi2 = 0;
};

struct RoundFit {
    RoundState state;
    RoundLinear at;
    bool converged = false;
    double condition = 0;           // least eigenvalue of the information scaled to unit diagonal
    double rival = std::nan("");    // size of another fit that is equally good; nan without one
    std::vector<double> whole;      // inverse of the information of all unknowns (M, M)
};

RoundLinear linearize(const RoundTask& task, const RoundState& state);

// Damped Gauss-Newton from the linearized state `at` until the predicted gain of a step is below the tolerance. Returns
// whether it converged.
bool refine_round(const RoundTask& task, RoundState& state, RoundLinear& at, int passes, double tolerance);

std::vector<RoundState> round_starts(const RoundTask& task);
Vec3 circle_centre(const std::vector<Vec3>& points, const Mat3& R);  // centre of the algebraic circle across z of a frame

// The best of the fits from all starts, refined to convergence.
RoundFit fit_round(const RoundTask& task);

}  // namespace tanteo
