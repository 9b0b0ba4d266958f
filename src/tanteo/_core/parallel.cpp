#include "parallel.hpp"

#include <algorithm>
#include <cstdlib>

namespace tanteo {

size_t most_threads() {
    static const size_t most = [] {
        const size_t there = std::max(std::thread::hardware_concurrency(), 1u);
        const char* stated = std::getenv("OMP_NUM_THREADS");
        const long limit = stated ? std::strtol(stated, nullptr, 10) : 0;
        return limit > 0 ? std::min<size_t>(there, static_cast<size_t>(limit)) : there;
    }();
    return most;
}

}  // namespace tanteo
