// Registry of the kinds of measurement factors by name, and of the functions that make factors from columns.
#pragma once
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "solve/pose_term.hpp"
#include "factors/factor.hpp"

namespace tanteo {

// Named arrays of n measurements of one kind, checked on access; an invalid value throws std::invalid_argument.
class Columns {
  public:
    struct Array {
        const double* data;
        std::vector<size_t> shape;
    };

    Columns(size_t rows, std::map<std::string, Array> arrays);
    size_t rows() const { return count; }
    // A number of a row within limits, or a vector; zero if there is no such column.
    double number(const char* name, size_t row, double least, double most) const;
    Vec3 vector(const char* name, size_t row) const;
    // Sets the columns of all kinds: points, covs, extra, log_outlier.
    void fill(Factor& factor, size_t row) const;
    // Sets a sensed direction with its sd; none if it is zero.
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

// The factors of a kind whose class has fill(columns, row).
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

// Throws std::invalid_argument with the registered kinds if the kind is not registered.
Factors make_factors(const std::string& kind, const Columns& columns);

// Named arrays of one further term of the log density, checked on access.
class Arrays {
  public:
    explicit Arrays(std::map<std::string, Columns::Array> arrays);
    bool has(const char* name) const;                                       // whether it exists and is not empty
    double number(const char* name, double least, double most) const;       // an array of one number
    std::vector<Vec3> vectors(const char* name) const;                      // an array of rows of three numbers
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

// Throws std::invalid_argument with the name of the argument and what was expected.
[[noreturn]] void refuse_argument(const std::string& name, const std::string& what);

// Codes of the landmarks (Shape::axes) by the kind of factor that measures them.
const std::map<std::string, int>& landmark_codes();

}  // namespace tanteo
