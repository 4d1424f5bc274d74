// Independent tasks on all of the host's threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <future>
#include <thread>
#include <vector>

namespace tool {

/// task(i) for each i below `count`, in any order and at the same time. Throws what the first that failed threw, once all
/// have ended.
template <class Task> void in_parallel(std::size_t count, Task task) {
    const std::size_t threads = std::min<std::size_t>(count, std::max(1u, std::thread::hardware_concurrency()));
    std::vector<std::future<void>> done;
    for (std::size_t t = 0; t < threads; ++t)
        done.push_back(std::async(std::launch::async, [&task, count, threads, t] {
            for (std::size_t i = t; i < count; i += threads) task(i);
        }));
    for (auto& d : done) d.get();
}

}  // namespace tool
