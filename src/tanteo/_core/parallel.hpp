// Loops on all processors. Items are independent, so the results do not depend on the number of threads.
#pragma once
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>

namespace tanteo {

constexpr std::chrono::microseconds WORTH_THREADS{100};  // a shorter loop would end before another thread wakes up

// The number of processors, limited by OMP_NUM_THREADS if that is a number.
size_t most_threads();

// Calls work() on this thread, and at the same time on up to `others` threads of a pool that stays, as far as these are
// idle. Returns once all calls have returned. No call may throw.
void together(size_t others, const std::function<void()>& work);

// Calls work(k) for all k below count; make() returns the work of a thread with its state. The first items run on the calling
// thread. An exception of one is thrown here.
template <class Make>
void for_all(size_t count, const Make& make) {
    if (!count) return;
    auto here = make();
    const auto start = std::chrono::steady_clock::now();
    size_t first = 0;
    while (first < count) {
        here(first++);
        if (std::chrono::steady_clock::now() - start > WORTH_THREADS) break;
    }
    const size_t others = first < count ? std::min(most_threads(), count - first) - 1 : 0;
    if (!others) {
        while (first < count) here(first++);
        return;
    }
    std::atomic<size_t> next{first};
    std::atomic<bool> is_first{true};
    std::exception_ptr failure;
    std::mutex one_at_a_time;
    const auto run = [&](auto& work) {
        for (size_t k; (k = next.fetch_add(1)) < count;) work(k);
    };
    together(others, [&] {
        try {
            if (is_first.exchange(false)) {
                run(here);
            } else {
                auto own = make();
                run(own);
            }
        } catch (...) {
            const std::lock_guard<std::mutex> lock(one_at_a_time);
            failure = std::current_exception();
            next = count;
        }
    });
    if (failure) std::rethrow_exception(failure);
}

}  // namespace tanteo
