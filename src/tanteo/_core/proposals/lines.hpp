// Sensed planes and faces grouped by direction: parallel ones are compared by their heights along it.
#pragma once
#include <vector>

#include "proposals/planes.hpp"

namespace tanteo {

// Sensed planes whose normals are parallel within their uncertainty.
struct SensedLine {
    struct Member {
        int plane, sign;  // sign of its normal along the line; 0 if its side is unknown
        double height, variance;
        bool alone;
    };
    Vec3 normal, middle;
    double tilt = 0;    // standard deviation of the normal [rad]
    double within = 0;  // largest angle between its planes [rad]
    std::vector<Member> members;

    double weight() const { return 1 / (tilt * tilt + MADE * MADE); }  // information on the normal, with that of made faces [1/rad^2]
};

std::vector<SensedLine> sensed_lines(const std::vector<SensedPlane>& sensed);

// Sorted heights of faces with normals in one sense of a line: planes alone, and with the walls of cylinders.
struct Heights {
    std::vector<double> planes, all;

    const std::vector<double>& of(bool alone) const { return alone ? all : planes; }
    void clear() {
        planes.clear();
        all.clear();
    }
};

// A direction of a part, and the heights of faces with normals along it and against it.
struct ModelLine {
    Vec3 direction;
    Heights forward, backward;
    double blur = 0;  // variance of the heights of faces that are only nearly parallel
};

// The lines of a part's planes; faces within a small angle of each other are on the lines of both.
void model_lines(const ModelFaces& faces, double within, std::vector<ModelLine>& out);

// The walls of cylinders alone whose normals may be along the line.
void wall_line(const ModelFaces& faces, double within, ModelLine& line);

// One shift that puts sensed planes on faces along their line, and the cost of all of them there [nats].
struct Shift {
    double at, cost;
};

// The shifts that put the planes of a line on a part's line, along it or against it (turn: 1, -1), and cost less than the
// limit, cheapest first. most: cost of each plane without a face [nats].
void shifts(const SensedLine& line, const ModelLine& faces, int turn, const std::vector<double>& most, double limit,
            std::vector<Shift>& out);

}  // namespace tanteo
