// Sensed planes and faces, line by line: what is parallel is compared by its heights along one direction.
#pragma once
#include <vector>

#include "proposals/planes.hpp"

namespace tanteo {

// Sensed planes whose normals are parallel within what is known of them.
struct SensedLine {
    struct Member {
        int plane, sign;  // its normal along the line: 1, -1, or 0 where its side is not known
        double height, variance;
        bool alone;
    };
    Vec3 normal, middle;
    double tilt = 0;    // of the normal [rad]
    double within = 0;  // how far from each other they may be [rad]
    std::vector<Member> members;

    double weight() const { return 1 / (tilt * tilt + MADE * MADE); }  // of the normal, as faces are made
};

std::vector<SensedLine> sensed_lines(const std::vector<SensedPlane>& sensed);

// Heights of faces that look one way along a line, sorted; with those of the walls of cylinders, and without.
struct Heights {
    std::vector<double> planes, all;

    const std::vector<double>& of(bool alone) const { return alone ? all : planes; }
    void clear() {
        planes.clear();
        all.clear();
    }
};

// A direction of a part, and its faces across it.
struct ModelLine {
    Vec3 way;
    Heights ahead, behind;
    double blur = 0;  // variance of the heights, where faces are only nearly parallel
};

// The lines of a part's planes; faces within a small angle of each other are on the lines of both.
void model_lines(const ModelFaces& faces, double within, std::vector<ModelLine>& out);

// The walls of cylinders alone, whose normals may look along the line's direction.
void wall_line(const ModelFaces& faces, double within, ModelLine& line);

// One way to put sensed planes on faces along their line: where the part is along it, and what all of them cost there.
struct Shift {
    double at, cost;
};

// The ways to put the planes of a line on a part's line, along it or against it (turn: 1, -1), that cost less than the
// limit; the least costly first. Most: cost of each plane without a face [nats].
void shifts(const SensedLine& line, const ModelLine& faces, int turn, const std::vector<double>& most, double limit,
            std::vector<Shift>& out);

}  // namespace tanteo
