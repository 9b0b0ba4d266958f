// A read-only array that owns its values, or refers to a buffer that the caller keeps alive, such as a mapped file.
#pragma once
#include <cstddef>
#include <utility>
#include <vector>

namespace tanteo {

template <class T>
class Array {
  public:
    Array() = default;
    Array(std::vector<T> values) : own(std::move(values)), first(own.data()), count(own.size()) {}
    Array(const T* values, size_t size) : first(values), count(size) {}
    Array(const Array&) = delete;  // a copy would point into the original
    Array& operator=(const Array&) = delete;
    Array(Array&&) = default;  // a moved vector keeps its address
    Array& operator=(Array&&) = default;

    size_t size() const { return count; }
    bool empty() const { return !count; }
    const T* data() const { return first; }
    const T& operator[](size_t k) const { return first[k]; }
    const T* begin() const { return first; }
    const T* end() const { return first + count; }

  private:
    std::vector<T> own;
    const T* first = nullptr;
    size_t count = 0;
};

}  // namespace tanteo
