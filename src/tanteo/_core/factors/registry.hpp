// Kinds of measurement factors by name: how the columns of many measurements of one kind become factors.
#pragma once
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "solve/pose_term.hpp"
#include "factors/factor.hpp"

namespace tanteo {

// Named arrays of n measurements of one kind, checked as they are read; what is wrong throws std::invalid_argument.
class Columns {
  public:
    struct Array {
        const double* data;
        std::vector<size_t> shape;
    };

    Columns(size_t rows, std::map<std::string, Array> arrays);
    size_t rows() const { return count; }
    // A finite number within limits, or a vector, of a row; zero if the column is not given.
    double number(const char* name, size_t row, double least, double most) const;
    Vec3 vector(const char* name, size_t row) const;
    // What all kinds have: points, covs, extra, log_outlier.
    void fill(Factor& factor, size_t row) const;
    // A sensed direction with direction_sds; none if it is zero.
    void set_direction(Factor& factor, size_t row, const Vec3& direction) const;

  private:
    const double* find(const char* name, size_t width) const;

    size_t count;
    std::map<std::string, Array> arrays;
};

using Factors = std::vector<std::unique_ptr<Factor>>;
using FactorMaker = std::function<Factors(const Columns&)>;

struct RegisteredKind {
    RegisteredKind(const char* name, FactorMaker make, int landmark = 0);
};

// Return the factors of a kind that has fill(columns, row).
template <class Kind>
Factors factors_from_columns(const Columns& columns) {
    Factors out;
    for (size_t k = 0; k < columns.rows(); ++k) {
        auto factor = std::make_unique<Kind>();
        factor->fill(columns, k);
        out.push_back(std::move(factor));
    }
    return out;
}

// Throws std::invalid_argument for a kind that is not registered, naming those that are.
Factors make_factors(const std::string& kind, const Columns& columns);

// Named arrays of one further term of the log density, checked as they are read.
class Arrays {
  public:
    explicit Arrays(std::map<std::string, Columns::Array> arrays);
    bool has(const char* name) const;                                       // whether it is given and not empty
    double number(const char* name, double least, double most) const;       // of one number
    std::vector<Vec3> vectors(const char* name) const;                      // of rows of three
    std::vector<double> numbers(const char* name, std::vector<size_t> shape) const;

  private:
    const Columns::Array& get(const char* name) const;
    std::map<std::string, Columns::Array> arrays;
};

using TermMaker = std::function<std::shared_ptr<PoseTerm>(const Arrays&, int first)>;

struct RegisteredTerm {
    RegisteredTerm(const char* name, TermMaker make);
};

// first: index of the first shared error of the term. Throws std::invalid_argument for a kind that is not registered.
std::shared_ptr<PoseTerm> make_term(const std::string& kind, const Arrays& arrays, int first);

// Throws std::invalid_argument: name: what was expected.
[[noreturn]] void refuse_argument(const std::string& name, const std::string& what);

// Codes of the landmarks of kinds that are points of the part beside its surface (Shape::axes), by kind.
const std::map<std::string, int>& landmark_codes();

}  // namespace tanteo
