// Sensed centres and planes at a pose of a part: their cost, their information on the pose, and refinement of the pose.
#pragma once
#include <cmath>
#include <vector>

#include "proposals/axes.hpp"
#include "solve/maximize.hpp"
#include "solve/plane_fit.hpp"

namespace tanteo {

constexpr double AXIS_TURNED = 0.004;  // standard deviation of made and meshed angles from the drawing [rad]

// Normal equations of a pose from lengths and angles, each a residual along one direction. The weak prior limits a step
// [m, rad].
struct PoseEquations : NormalEquations<6> {
    static constexpr double STEP = 0.1, TURN = 0.3;

    PoseEquations() { add_weak_prior(STEP, TURN); }
    // a point p of the part that is displaced by `off` along n
    void place(const Vec3& n, const Vec3& p, double off, double weight) {
        const Vec3 turn = cross(p, n);
        const double J[6] = {-n.x, -n.y, -n.z, -turn.x, -turn.y, -turn.z};
        add(J, off, weight);
    }
    // a direction in the part frame whose target is n
    void direction(const Vec3& own, const Vec3& n, double weight) {
        const Vec3 u = any_across(n), v = cross(n, u);
        for (const Vec3& e : {u, v}) {
            const Vec3 g = cross(own, e);
            const double J[6] = {0, 0, 0, -g.x, -g.y, -g.z};
            add(J, dot(own, e), weight);
        }
    }
};

// Covariance of a pose, and the resulting covariance of points and directions of the part.
struct Spread {
    double of[36] = {};

    void set(const double* L) {  // L: Cholesky factor of the information
        for (int k = 0; k < 6; ++k) {
            double column[6] = {};
            column[k] = 1;
            solve_cholesky(L, 6, column);
            for (int i = 0; i < 6; ++i) of[6 * i + k] = column[i];
        }
    }
    Mat3 at(const Vec3& q) const {  // covariance of a point, which moves by -v + q x w
        const double J[18] = {-1, 0, 0, 0, -q.z, q.y, 0, -1, 0, q.z, 0, -q.x, 0, 0, -1, -q.y, q.x, 0};
        double JS[18] = {};
        for (int i = 0; i < 3; ++i)
            for (int k = 0; k < 6; ++k)
                if (J[6 * i + k] != 0)
                    for (int j = 0; j < 6; ++j) JS[6 * i + j] += J[6 * i + k] * of[6 * k + j];
        Mat3 out;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                for (int k = 0; k < 6; ++k) out(i, j) += JS[6 * i + k] * J[6 * j + k];
        return out;
    }
    double turned() const { return of[21] + of[28] + of[35]; }  // variance of turns [rad^2]
};

class AxisComparison {
  public:
    AxisComparison(const ModelAxes& axes, const ModelFaces& faces, const SensedScene& scene)
        : fits(axes, scene.centres), axes(axes.all), faces(faces), scene(scene) {}

    // Total cost at an uncertain pose [nats]; slack: its uncertainty along axes and beside faces. The sum stops above the
    // limit.
    double cost(const Pose& pose, const Spread& known, const Spread& slack, double limit) const;
    // Refines a pose so that centres and planes are on their axes and faces.
    PlanePose refined(Pose pose, Spread known, double limit) const;

    static void add_centre(PoseEquations& at, const SensedCentre& centre, const ModelAxis& axis, const Pose& pose);
    void add_plane(PoseEquations& at, const SensedPlane& plane, const Pose& pose, const Spread& known) const;

    const AxisFits fits;
    const std::vector<ModelAxis>& axes;
    const ModelFaces& faces;
    const SensedScene& scene;

  private:
    struct Match {
        double cost;
        int axis = -1;
    };
    Match of_axes(int i, const Pose& pose, const Spread& known, const Spread& slack) const;
    PlaneMatch of_planes(SensedPlane plane, const Pose& pose, const Spread& known, const Spread& slack) const;
};

}  // namespace tanteo
