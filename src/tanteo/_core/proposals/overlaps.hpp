// Expected information of a reading about the group of its sample, from overlaps of pairs of samples.
#pragma once
#include <cstddef>
#include <vector>

namespace tanteo {

// Expected readings under samples in groups: normal densities with weights.
class Overlaps {
  public:
    // groups: index of the group of each sample, from 0
    explicit Overlaps(const std::vector<int>& groups);

    // Mutual information of the group and one reading [nats], from weights (0 for a sample without a reading), means and
    // variances of all samples, by Bhattacharyya overlaps of pairs in single precision.
    double information(const double* weights, const double* means, const double* variances);

  private:
    std::vector<int> order, group;  // samples by group
    std::vector<float> w, m, v, root, all, own, pair;
    std::vector<std::size_t> end;  // end of the group of each sample
};

}  // namespace tanteo
