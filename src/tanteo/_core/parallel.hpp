// Loops on all processors. Items are independent, so the results do not depend on the number of threads.
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

constexpr std::chrono::microseconds WORTH_THREADS{500};  // a shorter loop would end before other threads start

// The number of processors, limited by OMP_NUM_THREADS if that is a number.
size_t most_threads();

// Calls work(k) for all k below count; make() returns the work of a thread with its state. The first items run on the calling
// thread. If no more threads are available, fewer are used; an exception of one is thrown here.
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
    } catch (const std::system_error&) {  // no more threads are available
    }
    guarded([&] { run(here); });
    for (std::thread& other : others) other.join();
    if (failure) std::rethrow_exception(failure);
}

}  // namespace tanteo
