// Loops on all processors: what is done for each item stands alone, so the numbers are the same on any of them.
#pragma once
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace tanteo {

constexpr std::chrono::microseconds WORTH_THREADS{500};  // a loop that takes less ends before others have begun

// The number of processors, limited by OMP_NUM_THREADS if that is a number.
size_t most_threads();

// Does work(k) for all k below count; make() gives the work, once to each thread, with what it keeps from item to item.
// The first items are done here. Threads that are not to be had are done without; what one throws is thrown here.
template <class Make>
void for_all(size_t count, const Make& make) {
    auto here = make();
    const auto start = std::chrono::steady_clock::now();
    size_t first = 0;
    while (first < count) {
        here(first++);
        if (std::chrono::steady_clock::now() - start > WORTH_THREADS) break;
    }
    std::atomic<size_t> next{first};
    std::exception_ptr failure;
    std::mutex one_at_a_time;
    const auto run = [&](auto& work) {
        for (size_t k; (k = next.fetch_add(1)) < count;) work(k);
    };
    const auto guarded = [&](const auto& what) {
        try {
            what();
        } catch (...) {
            const std::lock_guard<std::mutex> lock(one_at_a_time);
            failure = std::current_exception();
            next = count;
        }
    };
    std::vector<std::thread> others;
    const size_t wanted = first < count ? std::min(most_threads(), count - first) - 1 : 0;
    try {
        others.reserve(wanted);
        while (others.size() < wanted)
            others.emplace_back([&] {
                guarded([&] {
                    auto own = make();
                    run(own);
                });
            });
    } catch (const std::system_error&) {  // no more of them
    }
    guarded([&] { run(here); });
    for (std::thread& other : others) other.join();
    if (failure) std::rethrow_exception(failure);
}

}  // namespace tanteo
