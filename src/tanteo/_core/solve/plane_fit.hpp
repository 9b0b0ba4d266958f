// Sensed planes at a pose of a part: the cost of each, and refinement of the pose so that they are on faces.
#pragma once
#include <vector>

#include "solve/maximize.hpp"
#include "proposals/planes.hpp"

namespace tanteo {

// Least cost of a plane [nats], and the surface with that cost, if there is one: normal in the part frame, distance from it
// (height) [m], and for a wall its axis and its curvature (bend) across the axis [1/m].
struct PlaneMatch {
    double cost;
    bool found;
    Vec3 normal;
    double height;
    Vec3 axis;
    double bend;
};

// Matches one sensed plane at a pose. turned: standard deviation of the attitude about a point [rad]; most: cost without a
// face [nats].
PlaneMatch match_plane(const ModelFaces& faces, const SensedPlane& plane, double most, const Pose& pose, double turned,
                       const Vec3& about);

class PlaneFit {
  public:
    PlaneFit(const ModelFaces& faces, const std::vector<SensedPlane>& sensed, const std::vector<double>& most)
        : faces(faces), sensed(sensed), most(most) {}

    // Refines a pose so that the planes are on their faces. turned: standard deviation of the attitude about a point [rad].
    PlanePose refined(Pose pose, double turned, const Vec3& about) const;

  private:
    const ModelFaces& faces;
    const std::vector<SensedPlane>& sensed;
    const std::vector<double>& most;

    NormalEquations<6> equations(const Pose& pose, double turned, const Vec3& about) const;
    void add_tilt(const PlaneMatch& to, const Vec3& own, const Vec3& at, double weight,
                  NormalEquations<6>& equations) const;
};

// A point with its normal on the wall of a cylinder: cost [nats] if it is below `most`, normal of the wall there, and
// distance of the point from it [m].
struct WallMatch {
    double cost;
    bool found;
    Vec3 normal;
    double height;
};

WallMatch on_wall(const ModelRound& round, const Vec3& normal, const Vec3& point, double variance, double tilt2, double most);

}  // namespace tanteo
