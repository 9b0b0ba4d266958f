// Sensed centres and planes against the axes and faces of a part: bounds of their cost over all poses, and poses.
#pragma once
#include <vector>

#include "proposals/planes.hpp"

namespace tanteo {

struct SensedCentre {
    Vec3 at, axis;                 // the axis of an apex leads into the cone; zero if it was not sensed
    double sd = 0, tilt = 0;       // standard deviations of the position [m] and of the axis [rad]
    double size = 0, size_sd = 1;  // radius [m] or half angle [rad], 0 if unknown
    double most = 8;               // cost without an axis [nats]
    int side = 0, kind = 0;        // 1: hole, -1: boss, 0: unknown; code of its landmarks

    bool oriented() const { return squared(axis) > 0; }
};

// Axis of a hole or boss, on which a centre may be at any height. A sphere or cone has one point.
struct ModelAxis {
    Vec3 middle, along;
    bool point = false;  // a point, not a line
    int side = 1, kind = 0, number = -1;
    double least = 0, most = 0;                  // radius or half angle
    double wall = 0;             // half of the wall, from the middle [m]
};

struct ModelAxes {
    static constexpr int KINDS = 64, COLUMNS = 15;
    std::vector<ModelAxis> all;
    double unseen[KINDS] = {};  // fraction of the axes of each kind that are not stored

    ModelAxes() = default;
    ModelAxes(const float* rows, size_t count);  // COLUMNS numbers each, as in the shape of a part
};

struct SensedScene {
    std::vector<SensedCentre> centres;
    std::vector<SensedPlane> planes;
};

// Sensed centres against a part at any pose.
class AxisFits {
  public:
    AxisFits(const ModelAxes& axes, const std::vector<SensedCentre>& centres);

    double most(int i) const { return most_of[i]; }                                  // cost of a centre without an axis [nats]
    double size(int i, int a) const { return sizes[i * axes.all.size() + a]; }       // cost of its size [nats]; huge if excluded
    bool may_match(int i, int a) const { return size(i, a) < most(i); }
    bool agree(int i, int a, int j, int b) const;  // whether two centres can be on two axes at their distance
    double least_apart(int a, int b) const;        // least distance of their lines [m]
    double lacking() const;

    const ModelAxes& axes;
    const std::vector<SensedCentre>& centres;

  private:
    std::vector<double> sizes, most_of;
};

// Lower bound of the cost of centres on a part [nats], from axes that single centres and pairs need, each centre once.
double lacking(const ModelAxes& axes, const std::vector<SensedCentre>& centres);

struct AxisPoses {
    std::vector<PlanePose> best;
    bool all = true;  // whether all poses that the seeds allow were tried
};

// Poses that put the items of each seed on axes and faces, and poses refined from starts, with their costs, best first. A seed
// has three numbers: centres, then planes, numbered after the centres; -1 fills the rest.
AxisPoses axis_poses(const ModelAxes& axes, const ModelFaces& faces, const SensedScene& scene,
                     const std::vector<int>& seeds, const std::vector<Pose>& starts, double limit, int keep);

}  // namespace tanteo
