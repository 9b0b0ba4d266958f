// One lane, on every processor and compiler.
#define LANES 1
#include "lanes/lane_loops.hpp"

namespace tanteo {
const LaneKernels KERNELS_1 = KERNELS;
}  // namespace tanteo
