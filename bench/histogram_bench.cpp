// Error samples drawn and counted in one go.
#include <benchmark/benchmark.h>

#include <vector>

#include "clratio/histogram.hpp"
#include "native.hpp"

namespace {

using namespace clratio;

constexpr std::uint64_t samples = std::uint64_t{1} << 27;
const Bins bins{-2, 4, 1024};
const ErrorModel model{.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35};

void count(benchmark::State& state, Generator generator, std::uint64_t models, Precision precision) {
    const Engine engine;
    const std::vector<Canonical> laws(models, canonical(model));
    std::vector<std::uint64_t> rows(models * (bins.count + 3));
    const std::uint64_t each = samples / models;
    add_error_counts(engine, laws, {.seed = 1, .generator = generator}, {0, each}, bins, rows, {.precision = precision});
    std::uint64_t first = 0;
    for (auto _ : state) {
        add_error_counts(engine, laws, {.seed = 1, .generator = generator}, {first, each}, bins, rows,
                         {.precision = precision});
        first += each;
    }
    state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * models * each));
}

void native_count(benchmark::State& state, const peers::NativeSet* set, Generator generator) {
    if (!set) return state.SkipWithError("no AVX2");
    std::vector<std::uint64_t> row(bins.count + 3);
    const peers::Binning binning{-2, 4, 1024 / 6.0f, 1024};
    std::uint64_t first = 0;
    for (auto _ : state) {
        peers::native_histogram(*set, canonical(model), {.seed = 1, .generator = generator}, first, samples, binning, row);
        first += samples;
    }
    state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * samples));
}

BENCHMARK_CAPTURE(count, pcg4d3x, Generator::pcg4d3x, 1, Precision::single_precision)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(native_count, pcg4d3x, peers::native_set(), Generator::pcg4d3x)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(count, pcg4d3x_10000_models, Generator::pcg4d3x, 10000, Precision::single_precision)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(count, philox, Generator::philox, 1, Precision::single_precision)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(native_count, philox, peers::native_set(), Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(count, philox_10000_models, Generator::philox, 10000, Precision::single_precision)
    ->MeasureProcessCPUTime()
    ->UseRealTime();
BENCHMARK_CAPTURE(count, philox_double, Generator::philox, 1, Precision::double_precision)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

}  // namespace
