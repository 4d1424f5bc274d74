// Error samples drawn and counted in one go: this library, and the same maths in vector instructions.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "clratio/histogram.hpp"
#include "native.hpp"

namespace {

using namespace clratio;

constexpr std::uint64_t samples = std::uint64_t{1} << 27;
const Bins bins{-2, 4, 1024};
const Canonical law = canonical({.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35});

/// Runs count(first) over fresh samples, once before the clock starts.
template <class Count> void measure(benchmark::State& state, std::uint64_t step, std::uint64_t items, Count count) {
    std::uint64_t first = 0;
    count(first);
    for (auto _ : state) count(first += step);
    state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * items));
}

void fused(benchmark::State& state, Generator generator, std::uint64_t models, Precision precision) {
    const Engine engine;
    const std::vector<Canonical> laws(models, law);
    std::vector<std::uint64_t> rows(models * (bins.count + 3));
    const std::uint64_t each = samples / models;
    measure(state, each, models * each, [&](std::uint64_t first) {
        add_error_counts(engine, laws, {.seed = 1, .generator = generator}, {first, each}, bins, rows,
                         {.precision = precision});
    });
}

void one_model(benchmark::State& state, Generator generator) { fused(state, generator, 1, Precision::single_precision); }
void one_model_double(benchmark::State& state, Generator generator) {
    fused(state, generator, 1, Precision::double_precision);
}

/// 13 samples a bin.
void models_10000(benchmark::State& state, Generator generator) {
    fused(state, generator, 10000, Precision::single_precision);
}

constexpr peers::Binning binning{-2, 4, 1024 / 6.0f, 1024};

bool same_work(const peers::NativeSet& set, const Stream& stream) {
    constexpr std::uint64_t count = 1 << 16;
    std::vector<std::uint64_t> row(bins.count + 3);
    peers::native_histogram(set, law, stream, 0, count, binning, row);
    return std::ranges::equal(std::span(row).first(bins.count),
                              error_histogram(Engine{}, law, stream, {0, count}, bins).bins);
}

void native(benchmark::State& state, Generator generator) {
    const auto* set = peers::native_set();
    if (!set) return state.SkipWithError("this machine has neither AVX-512 nor AVX2");
    state.SetLabel(set->name);
    if (!same_work(*set, {.seed = 1, .generator = generator}))
        return state.SkipWithError("the native counts are not the library's");
    std::vector<std::uint64_t> row(bins.count + 3);
    measure(state, samples, samples, [&](std::uint64_t first) {
        peers::native_histogram(*set, law, {.seed = 1, .generator = generator}, first, samples, binning, row);
    });
}

void values_in_memory(benchmark::State& state) {
    const Engine engine;
    std::vector<float> values(samples / 4);
    error_samples(engine, law, {.seed = 1}, 0, values);
    measure(state, 0, values.size(), [&](std::uint64_t) { benchmark::DoNotOptimize(histogram(engine, values, bins)); });
}

BENCHMARK_CAPTURE(one_model, pcg4d3x, Generator::pcg4d3x)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(native, pcg4d3x, Generator::pcg4d3x)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(models_10000, pcg4d3x, Generator::pcg4d3x)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(one_model, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(native, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(models_10000, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(one_model_double, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK(values_in_memory)->MeasureProcessCPUTime()->UseRealTime();

}  // namespace
