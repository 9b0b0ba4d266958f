#include "factors/registry.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

namespace tanteo {

namespace {

struct Entry {
    FactorMaker make;
};

std::map<std::string, Entry>& kinds() {
    static std::map<std::string, Entry> all;
    return all;
}

std::map<std::string, int>& codes() {
    static std::map<std::string, int> all;
    return all;
}

std::map<std::string, TermMaker>& terms() {
    static std::map<std::string, TermMaker> all;
    return all;
}

[[noreturn]] void refuse(const std::string& name, const std::string& what) { refuse_argument(name, what); }

// A covariance; if it is singular, a small variance is added in all directions.
Mat3 covariance(const double* values, double extra) {
    Mat3 C;
    std::copy_n(values, 9, C.m);
    const double trace = C(0, 0) + C(1, 1) + C(2, 2), floor = 1e-12 * trace;
    for (int i = 0; i < 3; ++i)
        for (int k = 0; k < i; ++k)
            if (std::fabs(C(i, k) - C(k, i)) > 1e-9 * trace) refuse("covs", "expected symmetric matrices");
    double L[9];
    std::copy_n(C.m, 9, L);
    for (int i = 0; i < 3; ++i) L[4 * i] += extra - 2 * floor;
    if (cholesky(L, 3)) return C;
    for (int i = 0; i < 3; ++i) C(i, i) += 3 * floor;
    std::copy_n(C.m, 9, L);
    for (int i = 0; i < 3; ++i) L[4 * i] += extra;
    if (!cholesky(L, 3)) refuse("covs", "expected covariances, got a matrix that is zero or not positive");
    return C;
}

}  // namespace

Columns::Columns(size_t rows, std::map<std::string, Array> given) : count(rows), arrays(std::move(given)) {
    for (const auto& [name, array] : arrays) {
        size_t size = 1;
        for (const size_t n : array.shape) size *= n;
        if (array.shape.empty() || array.shape[0] != count)
            refuse(name, "expected a row for each of " + std::to_string(count) + " measurements, got " +
                             std::to_string(array.shape.empty() ? 0 : array.shape[0]));
        for (size_t k = 0; k < size; ++k)
            if (!std::isfinite(array.data[k])) refuse(name, "expected finite numbers, got nan or inf");
    }
}

const double* Columns::find(const char* name, size_t width) const {
    const auto found = arrays.find(name);
    if (found == arrays.end() || !count) return nullptr;
    size_t own = 1;
    for (size_t k = 1; k < found->second.shape.size(); ++k) own *= found->second.shape[k];
    const size_t axes = width == 1 ? 1 : width == 9 ? 3 : 2;  // numbers, vectors, matrices
    if (own != width || found->second.shape.size() != axes)
        refuse(name, "expected " + std::to_string(width) + " numbers a row, got " + std::to_string(own));
    return found->second.data;
}

double Columns::number(const char* name, size_t row, double least, double most) const {
    const double* values = find(name, 1);
    const double value = values ? values[row] : 0.0;
    if (value >= least && value <= most) return value;
    std::ostringstream what;
    what << "expected a number from " << least << " to " << most << ", got " << value;
    refuse(name, what.str());
}

Vec3 Columns::vector(const char* name, size_t row) const {
    const double* values = find(name, 3);
    return values ? load(values + 3 * row) : Vec3{};
}

void Columns::fill(Factor& factor, size_t row) const {
    factor.at = vector("points", row);
    const double extra = number("extra", row, 0, 1e300);
    const double* covs = find("covs", 9);
    if (!covs) refuse("covs", "expected one matrix for each measurement, got none");
    factor.set_noise(covariance(covs + 9 * row, extra), extra);
    factor.log_outlier = number("log_outlier", row, -1e300, 1e300);
}

void Columns::set_direction(Factor& factor, size_t row, const Vec3& direction) const {
    factor.direction = direction;
    factor.oriented = squared(direction) > 0;
    factor.direction_sd = number("normal_sds", row, factor.oriented ? 1e-12 : -1e300, 1e300);
}

RegisteredKind::RegisteredKind(const char* name, FactorMaker make, int landmark) {
    kinds()[name] = {std::move(make)};
    if (landmark) codes()[name] = landmark;
}

Factors make_factors(const std::string& kind, const Columns& columns) {
    const auto found = kinds().find(kind);
    if (found != kinds().end()) return found->second.make(columns);
    std::string known;
    for (const auto& [name, entry] : kinds()) known += (known.empty() ? "" : ", ") + name;
    refuse("kind", "expected one of " + known + ", got " + kind);
}

[[noreturn]] void refuse_argument(const std::string& name, const std::string& what) {
    throw std::invalid_argument(name + ": " + what + ".");
}

Arrays::Arrays(std::map<std::string, Columns::Array> given) : arrays(std::move(given)) {
    for (const auto& [name, array] : arrays) {
        size_t size = 1;
        for (const size_t n : array.shape) size *= n;
        for (size_t k = 0; k < size; ++k)
            if (!std::isfinite(array.data[k])) refuse(name, "expected finite numbers, got nan or inf");
    }
}

bool Arrays::has(const char* name) const {
    const auto found = arrays.find(name);
    if (found == arrays.end()) return false;
    for (const size_t n : found->second.shape)
        if (!n) return false;
    return true;
}

const Columns::Array& Arrays::get(const char* name) const {
    const auto found = arrays.find(name);
    if (found == arrays.end()) refuse(name, "expected an array, got none");
    return found->second;
}

double Arrays::number(const char* name, double least, double most) const {
    const Columns::Array& array = get(name);
    for (const size_t n : array.shape)
        if (n != 1) refuse(name, "expected one number");
    const double value = array.data[0];
    if (value >= least && value <= most) return value;
    std::ostringstream what;
    what << "expected a number from " << least << " to " << most << ", got " << value;
    refuse(name, what.str());
}

std::vector<Vec3> Arrays::vectors(const char* name) const {
    const Columns::Array& array = get(name);
    if (array.shape.size() != 2 || array.shape[1] != 3) refuse(name, "expected rows of three numbers");
    std::vector<Vec3> out(array.shape[0]);
    for (size_t k = 0; k < out.size(); ++k) out[k] = load(array.data + 3 * k);
    return out;
}

std::vector<double> Arrays::numbers(const char* name, std::vector<size_t> shape) const {
    const Columns::Array& array = get(name);
    if (array.shape != shape) refuse(name, "expected an array of another shape");
    size_t size = 1;
    for (const size_t n : shape) size *= n;
    return std::vector<double>(array.data, array.data + size);
}

RegisteredTerm::RegisteredTerm(const char* name, TermMaker make) { terms()[name] = std::move(make); }

std::shared_ptr<PoseTerm> make_term(const std::string& kind, const Arrays& arrays, int first) {
    const auto found = terms().find(kind);
    if (found != terms().end()) return found->second(arrays, first);
    std::string known;
    for (const auto& [name, entry] : terms()) known += (known.empty() ? "" : ", ") + name;
    refuse("kind", "expected one of " + known + ", got " + kind);
}

const std::map<std::string, int>& landmark_codes() { return codes(); }

}  // namespace tanteo
