// Sensed centres on the axes of a part, and sensed planes on its faces: the best that any pose can do, without the part.
#pragma once
#include <vector>

#include "proposals/planes.hpp"

namespace tanteo {

struct SensedCentre {
    Vec3 at, axis;                 // of an apex the axis leads into the cone; zero where it was not sensed
    double sd = 0, tilt = 0;       // of the place [m], of the axis [rad]
    double size = 0, size_sd = 1;  // radius [m] or half angle [rad], 0 if unknown
    double most = 8;               // cost without an axis [nats]
    int side = 0, kind = 0;        // 1 of a hole, -1 of a boss, 0 if unknown; code of its landmarks

    bool oriented() const { return squared(axis) > 0; }
};

// Where the centres of one hole or boss may be: along its wall, or farther at a price. Of a sphere or cone it is a point.
struct ModelAxis {
    Vec3 middle, along;
    bool point = false;  // no line
    int side = 1, kind = 0, number = -1;
    double least = 0, most = 0;                  // radius or half angle
    double wall = 0, low = 0, high = 0, price = 0;  // from the middle: half of the wall, the reach; nats beyond the wall
};

struct ModelAxes {
    static constexpr int KINDS = 64, COLUMNS = 15;
    std::vector<ModelAxis> all;
    double unseen[KINDS] = {};  // share of those of a kind that are not among them

    ModelAxes() = default;
    ModelAxes(const float* rows, size_t count);  // COLUMNS numbers each, as the shape of a part has them
};

struct SensedScene {
    std::vector<SensedCentre> centres;
    std::vector<SensedPlane> planes;
};

// Sensed centres against a part at any pose.
class AxisFits {
  public:
    AxisFits(const ModelAxes& axes, const std::vector<SensedCentre>& centres);

    double most(int i) const { return most_of[i]; }                                  // nats of a centre of no axis
    double size(int i, int a) const { return sizes[i * axes.all.size() + a]; }       // nats of its size; huge if it cannot be
    bool may_be(int i, int a) const { return size(i, a) < most(i); }
    bool agree(int i, int a, int j, int b) const;  // whether two centres are as far apart as places of two axes can be
    double least_apart(int a, int b) const;        // of their lines [m]
    double lacking() const;

    const ModelAxes& axes;
    const std::vector<SensedCentre>& centres;

  private:
    std::vector<double> sizes, most_of;
};

// Nats that centres cost on a part at least, by what each and each two need: those of no axis are counted once.
double lacking(const ModelAxes& axes, const std::vector<SensedCentre>& centres);

struct AxisPoses {
    std::vector<PlanePose> best;
    bool all = true;  // whether every pose was tried that the seeds allow
};

// Poses that put the items of each seed on axes and faces, and poses to begin with, and what everything costs there, best
// first. Seeds have three numbers: centres, then planes, counted after them; -1 where there are fewer.
AxisPoses axis_poses(const ModelAxes& axes, const ModelFaces& faces, const SensedScene& scene,
                     const std::vector<int>& seeds, const std::vector<Pose>& starts, double limit, int keep);

}  // namespace tanteo
