// Eight lanes: AVX-512.
#if defined(TANTEO_X86_64)
#define LANES 8
#include "lanes/lane_loops.hpp"

namespace tanteo {
const LaneKernels KERNELS_8 = KERNELS;
}  // namespace tanteo
#endif
