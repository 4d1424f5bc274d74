// Words, uniform and normal numbers of a stream, to memory; beside them the normals of Boost.Compute on the same device.
#include <benchmark/benchmark.h>

#include <vector>

#include "boost_compute.hpp"
#include "clratio/stream.hpp"

namespace {

using namespace clratio;

constexpr std::size_t draws = std::size_t{1} << 26;

template <class T, class Fill> void measure(benchmark::State& state, Fill fill) {
    const Engine engine;
    std::vector<T> out(draws * sizeof(float) / sizeof(T));
    std::uint64_t first = 0;
    fill(engine, first, std::span(out));
    for (auto _ : state) fill(engine, first += out.size(), std::span(out));
    state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * out.size()));
    state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations() * out.size() * sizeof(T)));
}

void words(benchmark::State& state, Generator generator) {
    measure<std::uint32_t>(state, [=](const Engine& engine, std::uint64_t first, std::span<std::uint32_t> out) {
        fill_words(engine, {.seed = 1, .generator = generator}, first, out);
    });
}

template <class T> void uniforms(benchmark::State& state, Generator generator) {
    measure<T>(state, [=](const Engine& engine, std::uint64_t first, std::span<T> out) {
        fill_uniforms(engine, {.seed = 1, .generator = generator}, first, out);
    });
}

template <class T> void normals(benchmark::State& state, Generator generator) {
    measure<T>(state, [=](const Engine& engine, std::uint64_t first, std::span<T> out) {
        fill_normals(engine, {.seed = 1, .generator = generator}, first, out);
    });
}

void normals_float(benchmark::State& state, Generator generator) { normals<float>(state, generator); }
void normals_double(benchmark::State& state, Generator generator) { normals<double>(state, generator); }
void uniforms_float(benchmark::State& state, Generator generator) { uniforms<float>(state, generator); }

void boost_compute_normals(benchmark::State& state) {
    constexpr std::size_t count = draws / 8;
    const auto fill = peers::boost_normals(Engine{}, count);
    fill();
    for (auto _ : state) fill();
    state.SetItemsProcessed(static_cast<std::int64_t>(state.iterations() * count));
}

BENCHMARK_CAPTURE(words, pcg4d3x, Generator::pcg4d3x)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(words, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(uniforms_float, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(normals_float, pcg4d3x, Generator::pcg4d3x)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(normals_float, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(normals_double, philox, Generator::philox)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK(boost_compute_normals)->MeasureProcessCPUTime()->UseRealTime();

}  // namespace
