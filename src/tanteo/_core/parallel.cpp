#include "parallel.hpp"

#include <algorithm>
#include <condition_variable>
#include <cstdlib>
#include <list>
#include <system_error>
#include <thread>

#ifdef _WIN32
#include <process.h>
#define getpid _getpid
#else
#include <unistd.h>
#endif

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

namespace {

// Threads that wait for loops of others. A thread joins a loop only while fewer threads run loops than there are processors:
// Python threads run loops of several parts at a time, which leaves none idle.
class Pool {
  public:
    Pool() {
        try {
            for (size_t k = 1; k < most_threads(); ++k) std::thread([this] { wait(); }).detach();
        } catch (const std::system_error&) {  // no more threads are available
        }
    }

    void run(size_t others, const std::function<void()>& work) {
        Loop own{&work, others, 0};
        std::list<Loop*>::iterator place;
        {
            const std::lock_guard<std::mutex> lock(mutex);
            place = loops.insert(loops.end(), &own);
            ++running;
        }
        for (size_t k = 0; k < others; ++k) offered.notify_one();
        work();
        std::unique_lock<std::mutex> lock(mutex);
        loops.erase(place);
        --running;
        if (!loops.empty()) offered.notify_one();
        ended.wait(lock, [&] { return own.joined == 0; });
    }

  private:
    struct Loop {
        const std::function<void()>* work;
        size_t wanted, joined;  // threads that may still join, and those that run it
    };
    std::mutex mutex;
    std::condition_variable offered, ended;
    std::list<Loop*> loops;
    size_t running = 0;  // threads in all loops, those that offer one included

    [[noreturn]] void wait() {
        std::unique_lock<std::mutex> lock(mutex);
        for (;;) {
            const auto open = running < most_threads()
                                  ? std::find_if(loops.begin(), loops.end(), [](const Loop* one) { return one->wanted > 0; })
                                  : loops.end();
            if (open == loops.end()) {
                offered.wait(lock);
                continue;
            }
            Loop& loop = **open;
            --loop.wanted;
            ++loop.joined;
            ++running;
            lock.unlock();
            (*loop.work)();
            lock.lock();
            --running;
            if (--loop.joined == 0) ended.notify_all();
        }
    }
};

// The pool of this process. It is never destroyed, as its threads wait in it, and a process that was forked has none of them.
Pool& pool() {
    static std::mutex mutex;
    static Pool* known = nullptr;
    static auto owner = getpid();
    const std::lock_guard<std::mutex> lock(mutex);
    if (!known || owner != getpid()) {
        known = new Pool;
        owner = getpid();
    }
    return *known;
}

}  // namespace

void together(size_t others, const std::function<void()>& work) { pool().run(others, work); }

}  // namespace tanteo
