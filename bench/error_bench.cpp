// Error samples to memory, eq. (14): this library, the same maths in vector instructions, and what others write.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <vector>

#include "classic.hpp"
#include "clratio/error.hpp"
#include "native.hpp"

namespace {

using namespace clratio;

constexpr std::size_t samples = std::size_t{1} << 26;
const Canonical law = canonical({.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35});

/// Runs fill(first, out) over fresh indices into the same memory, which is touched before.
template <class T, class Fill> void measure(benchmark::State& state, std::size_t count, Fill fill) {
    std::vector<T> out(count);
    std::uint64_t first = 0;
    fill(first, std::span(out));
    for (auto _ : state) fill(first += count, std::span(out));
    state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * count));
}

template <class T> void clratio_samples(benchmark::State& state, Generator generator) {
    const Engine engine;
    measure<T>(state, samples / (sizeof(T) / sizeof(float)), [&](std::uint64_t first, std::span<T> out) {
        error_samples(engine, law, {.seed = 1, .generator = generator}, first, out);
    });
}

void error_samples_float(benchmark::State& state, Generator generator) { clratio_samples<float>(state, generator); }
void error_samples_double(benchmark::State& state, Generator generator) { clratio_samples<double>(state, generator); }

bool same_work(const peers::NativeSet& set, Generator generator) {
    const Stream stream{.seed = 1, .generator = generator};
    std::vector<float> out(4096);
    peers::native_samples(set, law, stream, 0, out);
    std::uint64_t i = 0;
    return std::ranges::all_of(out, [&](float x) { return x == error_sample(law, stream, i++); });
}

void native(benchmark::State& state, Generator generator) {
    const auto* set = peers::native_set();
    if (!set) return state.SkipWithError("this machine has neither AVX-512 nor AVX2");
    state.SetLabel(set->name);
    if (!same_work(*set, generator)) return state.SkipWithError("the native samples are not the library's");
    measure<float>(state, samples, [&](std::uint64_t first, std::span<float> out) {
        peers::native_samples(*set, law, {.seed = 1, .generator = generator}, first, out);
    });
}

void random123(benchmark::State& state) {
    measure<float>(state, samples / 4,
                   [](std::uint64_t first, std::span<float> out) { peers::random123_samples(law, 1, first, out); });
}

void standard_library(benchmark::State& state) {
    measure<float>(state, samples / 8,
                   [](std::uint64_t first, std::span<float> out) { peers::standard_samples(law, 1 + first, out); });
}

BENCHMARK_CAPTURE(error_samples_float, pcg4d3x, Generator::pcg4d3x)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(native, pcg4d3x, Generator::pcg4d3x)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(error_samples_float, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(native, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK(random123)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK(standard_library)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(error_samples_double, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();

}  // namespace
