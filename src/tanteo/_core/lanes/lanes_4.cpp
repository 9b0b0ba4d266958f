// Four lanes: AVX2.
#if defined(TANTEO_X86_64)
#define LANES 4
#include "lanes/lane_loops.hpp"

namespace tanteo {
const LaneKernels KERNELS_4 = KERNELS;
}  // namespace tanteo
#endif
