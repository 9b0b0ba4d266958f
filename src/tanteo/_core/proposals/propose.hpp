// Pose proposals: pairs of surface samples at the distance of two points, turned about their line, scored on the grid.
#pragma once
#include <cstdint>
#include <vector>

#include "solve/problem.hpp"
#include "shape/shape.hpp"

namespace tanteo {

struct Random {  // splitmix64: the same numbers everywhere
    uint64_t state;
    uint64_t next() {
        uint64_t z = (state += 0x9e3779b97f4a7c15ull);
        z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
        z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
        return z ^ (z >> 31);
    }
    double uniform() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }
};

struct Effort {
    int per_pair = 250;       // number of pairs of samples
    int spins = 24;           // number of turns about their line without normals
    double tolerance = 4e-3;  // tolerance of their distance [m]
    double blur = 4e-3;       // distance from the surface with cost 1 [m]
    double tilt = 0.25;       // tilt of a sensed normal with cost 1 [rad]
    int keep = 40;
};

struct Proposal {
    Pose pose;
    double cost;
};

// Cost of a pose: truncated squares of distances on the grid and of tilts; stops beyond the limit.
double score(const Shape& shape, const Problem& problem, const std::vector<int>& rows, const Pose& pose, double blur,
             double tilt, double limit);

// Poses that put points `from` and `to` on pairs of surface samples. Best first, none near a better one.
std::vector<Proposal> propose(const Shape& shape, const Problem& problem, const std::vector<int>& rows, int from, int to,
                              const Effort& effort, uint64_t seed);

// The best proposals, none near a better one.
std::vector<Proposal> thinned(const Shape& shape, std::vector<Proposal> all, int keep, double near, double near_turn);

}  // namespace tanteo
