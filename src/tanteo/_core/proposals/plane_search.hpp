// Poses of a part with sensed planes on its faces: parallel planes vote for the position of the part along their normal.
#pragma once
#include <array>
#include <vector>

#include "proposals/lines.hpp"
#include "proposals/plane_base.hpp"
#include "proposals/planes.hpp"

namespace tanteo {

class PlaneSearch {
  public:
    // triples: three indices of planes each, whose lines determine the pose; the last is -1 if there is no third. walls:
    // triples of a plane and two points that may be on cylinders across it.
    PlaneSearch(const std::vector<SensedPlane>& sensed, const std::vector<int>& triples, const std::vector<int>& walls);

    // Poses that cost less than the limit, and less than the best plus a gap [nats], best first. most: cost of each plane
    // without a face [nats].
    std::vector<PlanePose> on(const ModelFaces& faces, const std::vector<double>& most, double limit, double gap,
                              int keep);

  private:
    using Pair = std::array<Vec3, 2>;
    // A face of the part that may match a sensed plane at an attitude.
    struct Option {
        Vec3 normal, centre;
        double height, reach2, turned;  // height of the plane over it without the shift; squared reach [m^2]; cost of the tilt [nats]
    };
    struct Sensed {
        Vec3 at, normal;               // in the part's axes
        size_t first, last;            // range of its options
        size_t first_wall, last_wall;  // range of the cylinders on whose walls it may be
    };
    struct Rough {
        PlanePose at;
        double turned;
    };

    std::vector<SensedPlane> sensed;
    std::vector<SensedLine> lines;
    std::vector<PlaneBase> bases;
    double within = 0;            // largest angle between planes of one line
    double apart = 0, known = 0;  // distance and turn from which poses are different
    Vec3 middle;

    // data of the current part
    const ModelFaces* faces = nullptr;
    const std::vector<double>* most = nullptr;
    double limit = 0, gap = 0;
    size_t most_poses = 0;
    std::vector<ModelLine> model;
    std::vector<std::vector<Shift>> table;  // shifts of each sensed line on each line of the part, along it and against it
    std::vector<char> tabled;
    std::vector<Rough> rough;

    // data of the current attitude
    const PlaneBase* base = nullptr;
    Mat3 into;  // world to part
    std::vector<Sensed> planes;
    std::vector<Option> options;
    std::vector<ModelRound> walls;
    std::vector<Shift> along[3], wall_shifts;
    std::vector<Vec3> towards;
    ModelLine wall;

    const std::vector<Shift>& shifts_of(int line, size_t i);
    Vec3 direction_of(size_t i) const { return i % 2 ? -model[i / 2].direction : model[i / 2].direction; }
    double none(int line) const;
    void attitudes();
    void attitude(size_t i, size_t k);
    void on_walls();
    void on_two_walls(size_t i, const ModelRound& one, const ModelRound& other);
    void turned_to(size_t i, const Mat3& attitude, const Pair& places, const Pair& axes_at);
    double other(int line, std::vector<Shift>* all);
    void average();
    void prepare();
    void slides(const Vec3& direction, std::vector<Shift>& out) const;
    void place(int m, int line, const Vec3& direction);
    void placed(const Vec3* direction, double others);
    double cost(const Vec3& shift) const;
    void keep(const Vec3& shift, double cost);
    void thinned();
    bool are_one(const Pose& one, const Pose& other, double turn) const;
};

}  // namespace tanteo
