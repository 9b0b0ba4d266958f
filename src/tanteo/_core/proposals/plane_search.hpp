// Poses of a part at which sensed planes are on its faces: what is parallel votes for where the part is along it.
#pragma once
#include <array>
#include <vector>

#include "proposals/lines.hpp"
#include "proposals/plane_base.hpp"
#include "proposals/planes.hpp"

namespace tanteo {

class PlaneSearch {
  public:
    // Each triple has three numbers of planes, whose lines determine the pose; the last one is -1 where there is no third. Walls
    // are triples of a plane and two points that may be of cylinders across it.
    PlaneSearch(const std::vector<SensedPlane>& sensed, const std::vector<int>& triples, const std::vector<int>& walls);

    // Poses that cost less than the limit, or than so much more than the best, in nats, best first. Most: what each
    // plane costs without a face.
    std::vector<PlanePose> on(const ModelFaces& faces, const std::vector<double>& most, double limit, double behind,
                              int keep);

  private:
    using Pair = std::array<Vec3, 2>;
    // A face, or a plane of the part as one sensed plane may meet it at an attitude.
    struct Option {
        Vec3 normal, centre;
        double ahead, room2, turned;  // height over it but for the shift; squared reach [m^2]; nats of the tilt
    };
    struct Sensed {
        Vec3 at, normal;               // in the part's axes
        size_t first, last;            // of its options
        size_t first_wall, last_wall;  // of the cylinders on whose walls it may be
    };
    struct Rough {
        PlanePose at;
        double turned;
    };

    std::vector<SensedPlane> sensed;
    std::vector<SensedLine> lines;
    std::vector<PlaneBase> bases;
    double within = 0;            // angle between planes of one line
    double apart = 0, known = 0;  // distance and turn from which poses are two
    Vec3 middle;

    // of the part in question
    const ModelFaces* faces = nullptr;
    const std::vector<double>* most = nullptr;
    double limit = 0, behind = 0;
    size_t most_poses = 0;
    std::vector<ModelLine> model;
    std::vector<std::vector<Shift>> table;  // of each sensed line on each of the part's, along it and against it
    std::vector<char> tabled;
    std::vector<Rough> rough;

    // of the attitude
    const PlaneBase* base = nullptr;
    Mat3 into;  // world to part
    std::vector<Sensed> planes;
    std::vector<Option> options;
    std::vector<ModelRound> walls;
    std::vector<Shift> along[3], rolled;
    std::vector<Vec3> towards;
    ModelLine wall;

    const std::vector<Shift>& ways(int line, size_t i);
    Vec3 way(size_t i) const { return i % 2 ? -model[i / 2].way : model[i / 2].way; }
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
