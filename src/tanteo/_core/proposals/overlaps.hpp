// Expected information of a reading about the group of its sample, from overlaps of pairs of samples.
#pragma once
#include <cstddef>
#include <vector>

namespace tanteo {

// Readings expected under some samples: normal densities with weights, those of one group together.
class Overlaps {
  public:
    // number of the group of each sample, from 0
    explicit Overlaps(const std::vector<int>& groups);

    // Mutual information [nats] of the group and one reading: weights (0 for a sample that gives none), means, variances
    // of all samples; overlaps of pairs are Bhattacharyya's, in single precision.
    double information(const double* weights, const double* means, const double* variances);

  private:
    std::vector<int> order, group;  // samples by group
    std::vector<float> w, m, v, root, all, own, pair;
    std::vector<std::size_t> end;  // of the group of each
};

}  // namespace tanteo
