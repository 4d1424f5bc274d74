// Error samples to memory, eq. (14).
#include <benchmark/benchmark.h>

#include <vector>

#include "clratio/error.hpp"

namespace {

using namespace clratio;

constexpr std::size_t samples = std::size_t{1} << 26;
const ErrorModel model{.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35};

void error_samples_to_memory(benchmark::State& state, Generator generator) {
    const Engine engine;
    std::vector<float> out(samples);
    const auto law = canonical(model);
    std::uint64_t first = 0;
    for (auto _ : state) {
        error_samples(engine, law, {.seed = 1, .generator = generator}, first, out);
        first += samples;
    }
    state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * samples));
}
BENCHMARK_CAPTURE(error_samples_to_memory, pcg4d3x, Generator::pcg4d3x)->UseRealTime();
BENCHMARK_CAPTURE(error_samples_to_memory, philox, Generator::philox)->UseRealTime();

}  // namespace
