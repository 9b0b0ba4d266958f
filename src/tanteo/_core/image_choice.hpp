// Edges of a part that may have met another's: what each choice of them says.
#pragma once
#include <cstddef>
#include <vector>

namespace tanteo {

struct EdgeTerms {  // of n unknowns: beforehand, and what each of G edges adds if it is the part's own and if another's
    size_t n, G;
    const double *information, *gradient;                                // n x n, n
    const double *edge_information, *edge_gradients, *edge_logs;         // G x 2 x n x n, G x 2 x n, G x 2
};

class ChoiceWeigher {
  public:
    explicit ChoiceWeigher(const EdgeTerms& terms) : t(terms), A(t.n * t.n), b(t.n), scale(t.n) {}
    // Log weight of a choice by Laplace's integral, up to a constant, with its mean and covariance; minus infinity
    // where its information is of no full rank.
    double weigh(const bool* other, double* mean, double* covariance);

  private:
    EdgeTerms t;
    std::vector<double> A, b, scale;
};

}  // namespace tanteo
