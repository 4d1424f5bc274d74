#include "classic.hpp"

#include <Random123/boxmuller.hpp>
#include <Random123/philox.h>

#include <algorithm>
#include <random>
#include <thread>
#include <vector>

namespace peers {
namespace {

template <class Work> void on_all_cores(std::size_t count, Work work) {
    const std::size_t threads = std::max(1u, std::thread::hardware_concurrency()), each = (count + threads - 1) / threads;
    std::vector<std::jthread> pool;
    for (std::size_t t = 0; t < threads; ++t)
        pool.emplace_back(work, t, std::min(count, t * each), std::min(count, (t + 1) * each));
}

struct FloatLaw {
    explicit FloatLaw(const clratio::Canonical& c) : law(clratio::to_float(c)) {}
    float operator()(float z1, float z2) const { return (law.a * z2 + law.b * z1) / (1 + law.s * z2); }
    clratio::device::clr_canonical law;
};

}  // namespace

void random123_samples(const clratio::Canonical& law, std::uint64_t seed, std::uint64_t first, std::span<float> out) {
    on_all_cores(out.size(), [&, x = FloatLaw(law)](std::size_t, std::size_t begin, std::size_t end) {
        r123::Philox4x32 philox;
        const r123::Philox4x32::key_type key{{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)}};
        for (std::size_t i = begin; i < end; i += 2) {
            const std::uint64_t block = (first + i) / 2;
            const auto w = philox({{static_cast<std::uint32_t>(block), static_cast<std::uint32_t>(block >> 32), 0, 0}}, key);
            const auto z = r123::boxmuller(w[0], w[1]);
            out[i] = x(z.x, z.y);
            if (i + 1 == end) break;
            const auto y = r123::boxmuller(w[2], w[3]);
            out[i + 1] = x(y.x, y.y);
        }
    });
}

void standard_samples(const clratio::Canonical& law, std::uint64_t seed, std::span<float> out) {
    on_all_cores(out.size(), [&, x = FloatLaw(law)](std::size_t thread, std::size_t begin, std::size_t end) {
        std::mt19937 engine(static_cast<std::uint32_t>(seed + thread));
        std::normal_distribution<float> normal;
        for (std::size_t i = begin; i < end; ++i) {
            const float z1 = normal(engine), z2 = normal(engine);
            out[i] = x(z1, z2);
        }
    });
}

}  // namespace peers
