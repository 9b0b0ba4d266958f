// One of several groups of terms holds: the log density is
//
//   log sum_k exp(w_k + sum_i l_ki(T, z)),
//
// with w_k the log probability of group k beforehand and l_ki the log densities of its terms. Gradient and information
// are the means of those of the groups by their probabilities at the pose: the spread between the groups' gradients,
// which would make the information indefinite, is left out.
#pragma once
#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "solve/pose_term.hpp"

namespace tanteo {

struct TermGroup {
    double log_weight;
    std::vector<std::shared_ptr<const PoseTerm>> terms;
};

class Alternatives : public PoseTerm {
  public:
    explicit Alternatives(std::vector<TermGroup> groups) : groups(std::move(groups)) {}
    double add(const State& state, const Slope* slope) const override;
    int columns() const override;

  private:
    std::vector<TermGroup> groups;
};

}  // namespace tanteo
