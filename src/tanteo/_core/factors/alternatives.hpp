// Mixture over groups of terms, of which exactly one applies. The log density is
//
//   log sum_k exp(w_k + sum_i l_ki(T, z)),
//
// with w_k the log prior probability of group k and l_ki the log densities of its terms. Gradient and information are the
// means over the groups, weighted by their probabilities at the pose. The spread between the groups' gradients is
// omitted, because it would make the information indefinite.
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
