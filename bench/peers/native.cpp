#include "native.hpp"
#include "native_medium.hpp"

#include <algorithm>
#include <mutex>
#include <thread>
#include <vector>

namespace peers {
namespace {

constexpr std::uint64_t step = 32;

/// Calls work(thread, first, count) for parts of a multiple of `step`, each on its own thread.
template <class Work> void on_all_cores(std::uint64_t count, Work work) {
    const std::uint64_t threads = std::max(1u, std::thread::hardware_concurrency());
    const std::uint64_t each = (count / step + threads - 1) / threads * step;
    std::vector<std::jthread> pool;
    for (std::uint64_t t = 0; t < threads; ++t) {
        const std::uint64_t begin = std::min(count, t * each);
        pool.emplace_back(work, begin, std::min(each, count - begin));
    }
}

}  // namespace

const NativeSet* native_set() {
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) return &native_avx512;
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return &native_avx2;
    return nullptr;
}

void native_samples(const NativeSet& set, const clratio::Canonical& law, const clratio::Stream& stream, std::uint64_t first,
                    std::span<float> out) {
    on_all_cores(out.size(), [&](std::uint64_t begin, std::uint64_t count) {
        set.samples(clratio::to_float(law), stream, first + begin, count, out.data() + begin);
    });
}

void native_histogram(const NativeSet& set, const clratio::Canonical& law, const clratio::Stream& stream,
                      std::uint64_t first, std::uint64_t count, Binning binning, std::span<std::uint64_t> totals) {
    std::mutex mutex;
    on_all_cores(count, [&](std::uint64_t begin, std::uint64_t part) {
        std::vector<std::uint32_t> row(binning.bins + 3);
        set.histogram(clratio::to_float(law), stream, first + begin, part, binning, row.data());
        const std::scoped_lock lock(mutex);
        for (std::size_t i = 0; i < row.size(); ++i) totals[i] += row[i];
    });
}

void native_medium(const NativeSet& set, const clratio::device::clr_medium& scene, const std::vector<MediumPixels>& pixels,
                   const clratio::Stream& stream, std::uint32_t samples, std::vector<MediumSums>& out) {
    on_all_cores(pixels.size() * step, [&](std::uint64_t begin, std::uint64_t count) {
        set.medium(scene, pixels.data() + begin / step, count / step, stream, samples, out.data() + begin / step);
    });
}

}  // namespace peers
