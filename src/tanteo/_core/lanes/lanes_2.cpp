// Two lanes: SSE2 and NEON.
#if defined(__GNUC__)
#define LANES 2
#include "lanes/lane_loops.hpp"

namespace tanteo {
const LaneKernels KERNELS_2 = KERNELS;
}  // namespace tanteo
#endif
