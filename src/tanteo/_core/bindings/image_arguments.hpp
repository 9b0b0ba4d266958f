// Arguments and results that the bindings for images share.
#pragma once
#include <algorithm>
#include <vector>

#include "bindings/conversion.hpp"
#include "image/image_edge.hpp"

namespace tanteo {

using Flags = nb::ndarray<const bool, nb::c_contig, nb::device::cpu>;
using OutFlags = nb::ndarray<nb::numpy, bool>;

inline OutFlags flags_of(const std::vector<char>& values, std::vector<size_t> shape) {
    bool* kept = new bool[values.size()];
    std::copy(values.begin(), values.end(), kept);
    nb::capsule owner(kept, [](void* p) noexcept { delete[] static_cast<bool*>(p); });
    return OutFlags(kept, shape.size(), shape.data(), owner);
}

inline Lens lens_of(const Doubles& camera) {
    expect(camera, "camera", {12});
    const double* c = camera.data();
    Lens lens{c[0], c[1], c[2], c[3], {}};
    std::copy(c + 4, c + 12, lens.k);
    return lens;
}

void offer_image_choices(nb::module_& m);  // image_choice_bindings.cpp

}  // namespace tanteo
