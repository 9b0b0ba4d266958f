// One additional term of the log density: anything that depends on the pose and the shared errors, and is no row of
// points, rays or priors. Images, a prior of stable poses and functions of a user are such terms.
#pragma once
#include <vector>

#include "vec.hpp"

namespace tanteo {

// The unknowns: a pose, whitened shared errors, and the log of the noise scale over its sd.
struct State {
    Pose pose;
    std::vector<double> z;  // shared errors, then the noise scale if it is a state
};

// Where a term adds its gradient and its Gauss-Newton information: states are [v, w] about `centre` (see `moved` in
// vec.hpp), then z. The information is row-major, size x size; its lower triangle is enough.
struct Slope {
    Vec3 centre;
    int size = 0;
    double *gradient = nullptr, *information = nullptr;

    // Add one residual: `pull` is the derivative of the log density by the residual, `weight` its information, `row` the
    // derivative of the residual by the states in `columns`.
    void add(double pull, double weight, const double* row, const int* columns, int count) const {
        for (int a = 0; a < count; ++a) {
            gradient[columns[a]] += pull * row[a];
            for (int b = 0; b < count; ++b)
                if (columns[b] <= columns[a])
                    information[columns[a] * size + columns[b]] += weight * row[a] * row[b];
        }
    }
};

class PoseTerm {
  public:
    virtual ~PoseTerm() = default;
    // Return the log density at a state; add its slope where one is given.
    virtual double add(const State& state, const Slope* slope) const = 0;
    // Return the log densities at many states.
    virtual std::vector<double> values(const std::vector<State>& states) const {
        std::vector<double> out;
        for (const State& state : states) out.push_back(add(state, nullptr));
        return out;
    }
    // Return how many entries of z the term reads, from the first.
    virtual int columns() const { return 0; }
};

}  // namespace tanteo
