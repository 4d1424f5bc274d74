// Error samples to memory, eq. (14).
#include <benchmark/benchmark.h>

#include <vector>

#include "clratio/error.hpp"
#include "native.hpp"

namespace {

using namespace clratio;

constexpr std::size_t samples = std::size_t{1} << 26;
const ErrorModel model{.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35};

void error_samples_to_memory(benchmark::State& state, Generator generator) {
    const Engine engine;
    std::vector<float> out(samples);
    const auto law = canonical(model);
    error_samples(engine, law, {.seed = 1, .generator = generator}, 0, out);
    std::uint64_t first = 0;
    for (auto _ : state) {
        error_samples(engine, law, {.seed = 1, .generator = generator}, first, out);
        first += samples;
    }
    state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * samples));
}
BENCHMARK_CAPTURE(error_samples_to_memory, pcg4d3x, Generator::pcg4d3x)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(error_samples_to_memory, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();

void native_samples_to_memory(benchmark::State& state, const peers::NativeSet* set, Generator generator) {
    if (!set) return state.SkipWithError("no AVX2");
    std::vector<float> out(samples);
    std::uint64_t first = 0;
    for (auto _ : state) {
        peers::native_samples(*set, canonical(model), {.seed = 1, .generator = generator}, first, out);
        first += samples;
    }
    state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * samples));
}
BENCHMARK_CAPTURE(native_samples_to_memory, pcg4d3x, peers::native_set(), Generator::pcg4d3x)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(native_samples_to_memory, philox, peers::native_set(), Generator::philox)->MeasureProcessCPUTime()->UseRealTime();

}  // namespace
