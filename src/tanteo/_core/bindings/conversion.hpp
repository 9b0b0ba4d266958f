// Conversions that all bindings share: arrays in and out, and errors for invalid arrays.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "vec.hpp"

namespace tanteo {

namespace nb = nanobind;

using Doubles = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Ints = nb::ndarray<const int32_t, nb::c_contig, nb::device::cpu>;
using Floats = nb::ndarray<const float, nb::c_contig, nb::device::cpu>;
using Starts = nb::ndarray<const int64_t, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<nb::numpy, double>;
using OutInts = nb::ndarray<nb::numpy, int32_t>;

template <class T>
nb::ndarray<nb::numpy, T> array_of(std::vector<T> values, std::vector<size_t> shape) {
    auto* kept = new std::vector<T>(std::move(values));
    nb::capsule owner(kept, [](void* p) noexcept { delete static_cast<std::vector<T>*>(p); });
    return nb::ndarray<nb::numpy, T>(kept->data(), shape.size(), shape.data(), owner);
}

template <class T>
nb::ndarray<nb::numpy, T> list_of(std::vector<T> values) {
    const size_t count = values.size();
    return array_of(std::move(values), {count});
}

[[noreturn]] inline void refuse(const char* name, const std::string& what) {
    throw std::invalid_argument(std::string(name) + ": " + what + ".");
}

constexpr size_t ANY = static_cast<size_t>(-1);  // any number of rows

inline std::string as_text(const std::vector<size_t>& sizes) {
    std::string out = "(";
    for (size_t k = 0; k < sizes.size(); ++k) out += (k ? ", " : "") + (sizes[k] == ANY ? "n" : std::to_string(sizes[k]));
    return out + (sizes.size() == 1 ? ",)" : ")");
}

// Checks every array of numbers: it has the required shape, or is equally empty, and is finite.
// Returns its rows.
inline size_t expect(const Doubles& a, const char* name, std::initializer_list<size_t> sizes) {
    const size_t rows = *sizes.begin() == ANY && a.ndim() ? a.shape(0) : *sizes.begin();
    size_t count = rows, axis = 1;
    bool ok = a.ndim() > 0;
    for (auto size = sizes.begin() + 1; size != sizes.end(); ++size, ++axis) {
        count *= *size;
        ok = ok && (a.size() == 0 || (axis < a.ndim() && a.shape(axis) == *size));
    }
    ok = ok && a.size() == count && (count == 0 || (a.ndim() == sizes.size() && a.shape(0) == rows));
    if (!ok) {
        std::vector<size_t> got;
        for (size_t k = 0; k < a.ndim(); ++k) got.push_back(a.shape(k));
        refuse(name, "expected an array " + as_text(sizes) + ", got " + as_text(got));
    }
    for (size_t k = 0; k < count; ++k)
        if (!std::isfinite(a.data()[k])) refuse(name, "expected finite numbers, got nan or inf");
    return rows;
}

// A number between two limits.
inline double expect(double value, const char* name, double least, double most) {
    if (!(value >= least && value <= most)) {
        std::ostringstream what;
        what << "expected a number from " << least << " to " << most << ", got " << value;
        refuse(name, what.str());
    }
    return value;
}

// Checks an array of integers: limits and required length.
inline std::vector<int> expect(const Ints& a, const char* name, size_t count, int64_t least, int64_t most) {
    if (count != ANY && a.size() != count)
        refuse(name, "expected " + std::to_string(count) + " numbers, got " + std::to_string(a.size()));
    for (size_t k = 0; k < a.size(); ++k)
        if (a.data()[k] < least || a.data()[k] > most)
            refuse(name, "expected numbers from " + std::to_string(least) + " to " + std::to_string(most) + ", got " +
                             std::to_string(a.data()[k]));
    return std::vector<int>(a.data(), a.data() + a.size());
}

inline std::vector<double> doubles(const Doubles& a, const char* name, std::initializer_list<size_t> sizes) {
    expect(a, name, sizes);
    return std::vector<double>(a.data(), a.data() + a.size());
}

inline std::vector<Vec3> vectors(const Doubles& a, const char* name) {
    std::vector<Vec3> out(expect(a, name, {ANY, 3}));
    for (size_t k = 0; k < out.size(); ++k) out[k] = load(a.data() + 3 * k);
    return out;
}

inline Vec3 vector(const Doubles& a, const char* name) {
    expect(a, name, {3});
    return load(a.data());
}

inline std::vector<Pose> poses(const Doubles& Ts, const char* name = "poses") {
    std::vector<Pose> out(expect(Ts, name, {ANY, 4, 4}));
    for (size_t k = 0; k < out.size(); ++k) out[k] = load_pose(Ts.data() + 16 * k);
    return out;
}

inline Out poses_out(const std::vector<Pose>& all) {
    std::vector<double> out(16 * all.size());
    for (size_t k = 0; k < all.size(); ++k) store_pose(all[k], &out[16 * k]);
    return array_of(std::move(out), {all.size(), 4, 4});
}

}  // namespace tanteo
