// Sensed planes at a pose of a part: what each costs there, and the pose nearby at which all are nearest to faces.
#pragma once
#include <vector>

#include "solve/maximize.hpp"
#include "proposals/planes.hpp"

namespace tanteo {

// The least that a plane costs, and of which surface it is then, if of any: its normal in the part, how far off it is, and
// how a wall bends, across its axis: the normal turns by so much for each metre.
struct PlaneMatch {
    double cost;
    bool found;
    Vec3 normal;
    double height;
    Vec3 axis;
    double bend;
};

// One sensed plane at a pose whose attitude is known so well about a point [rad]. Most: cost without a face [nats].
PlaneMatch match_plane(const ModelFaces& faces, const SensedPlane& plane, double most, const Pose& pose, double turned,
                       const Vec3& about);

class PlaneFit {
  public:
    PlaneFit(const ModelFaces& faces, const std::vector<SensedPlane>& sensed, const std::vector<double>& most)
        : faces(faces), sensed(sensed), most(most) {}

    // Moves a pose, whose attitude is known so well about a point [rad], to where the planes are on their faces.
    PlanePose refined(Pose pose, double turned, const Vec3& about) const;

  private:
    const ModelFaces& faces;
    const std::vector<SensedPlane>& sensed;
    const std::vector<double>& most;

    NormalEquations<6> equations(const Pose& pose, double turned, const Vec3& about) const;
    void add_tilt(const PlaneMatch& to, const Vec3& own, const Vec3& at, double weight,
                  NormalEquations<6>& equations) const;
};

// A point with its normal on the wall of a cylinder: nats, if they are less than most; the normal of the wall there, and how
// far off it is.
struct WallMatch {
    double cost;
    bool found;
    Vec3 normal;
    double height;
};

WallMatch on_wall(const ModelRound& round, const Vec3& normal, const Vec3& point, double variance, double tilt2, double most);

}  // namespace tanteo
