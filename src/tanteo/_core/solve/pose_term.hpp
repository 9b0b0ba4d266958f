// An additional term of the log density, a function of the pose and the shared errors: an image, a prior of stable poses,
// or a function of a user.
#pragma once
#include <vector>

#include "vec.hpp"

namespace tanteo {

// The unknowns: a pose, whitened shared errors, and the log of the noise scale over its sd.
struct State {
    Pose pose;
    std::vector<double> z;  // shared errors, then the noise scale if it is a state
};

// Sums to which a term adds its gradient and Gauss-Newton information: states are [v, w] about `centre` (`moved` in
// vec.hpp), then z. The information is row-major, size x size; its lower triangle is enough.
struct Slope {
    Vec3 centre;
    int size = 0;
    double *gradient = nullptr, *information = nullptr;

    // Adds one residual: `pull` is the derivative of the log density by the residual, `weight` its information, `row` the
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
    // Returns the log density at a state, and adds its slope if one is given.
    virtual double add(const State& state, const Slope* slope) const = 0;
    // Returns the log densities at many states.
    virtual std::vector<double> values(const std::vector<State>& states) const {
        std::vector<double> out;
        for (const State& state : states) out.push_back(add(state, nullptr));
        return out;
    }
    // Returns the number of entries of z that the term reads, from the first.
    virtual int columns() const { return 0; }
};

}  // namespace tanteo
