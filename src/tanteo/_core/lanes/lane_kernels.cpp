#include "lanes/lane_kernels.hpp"

#include <atomic>

namespace tanteo {

namespace {

// From narrow to wide.
std::vector<const LaneKernels*> supported() {
    std::vector<const LaneKernels*> all{&KERNELS_1};
#if defined(__GNUC__)
    all.push_back(&KERNELS_2);
#endif
#if defined(TANTEO_X86_64)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2")) all.push_back(&KERNELS_4);
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        all.push_back(&KERNELS_8);
#endif
    return all;
}

std::atomic<const LaneKernels*>& current() {
    static std::atomic<const LaneKernels*> kernels{supported().back()};
    return kernels;
}

}  // namespace

const LaneKernels& lane_kernels() { return *current().load(std::memory_order_relaxed); }

std::vector<int> lane_widths() {
    std::vector<int> widths;
    for (const LaneKernels* kernels : supported()) widths.push_back(kernels->width);
    return widths;
}

bool set_lane_width(int width) {
    for (const LaneKernels* kernels : supported())
        if (kernels->width == width) {
            current() = kernels;
            return true;
        }
    return false;
}

}  // namespace tanteo
