#include "factors/alternatives.hpp"

#include <cmath>

namespace tanteo {

double Alternatives::add(const State& state, const Slope* slope) const {
    const size_t size = slope ? static_cast<size_t>(slope->size) : 0;
    std::vector<double> logs;
    std::vector<std::vector<double>> gradients, informations;
    double top = -1e300, sum = 0;
    for (const TermGroup& group : groups) {
        std::vector<double> gradient(size), information(size * size);
        const Slope own{slope ? slope->centre : Vec3{}, static_cast<int>(size), gradient.data(), information.data()};
        double log = group.log_weight;
        for (const auto& term : group.terms) log += term->add(state, slope ? &own : nullptr);
        logs.push_back(log);
        top = std::max(top, log);
        gradients.push_back(std::move(gradient));
        informations.push_back(std::move(information));
    }
    for (const double log : logs) sum += std::exp(log - top);
    for (size_t k = 0; slope && k < groups.size(); ++k) {
        const double share = std::exp(logs[k] - top) / sum;
        for (size_t a = 0; a < size; ++a) {
            slope->gradient[a] += share * gradients[k][a];
            for (size_t b = 0; b <= a; ++b) slope->information[a * size + b] += share * informations[k][a * size + b];
        }
    }
    return top + std::log(sum);
}

int Alternatives::columns() const {
    int most = 0;
    for (const TermGroup& group : groups)
        for (const auto& term : group.terms) most = std::max(most, term->columns());
    return most;
}

}  // namespace tanteo
