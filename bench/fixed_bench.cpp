// Fixed-point moments: adding, merging, turning into Moments, beside Moments and the in-place scaling of as many bytes.
#include "support/device.hpp"

using namespace clratio;
using namespace clratio::bench;

namespace {

std::uint64_t values_of(const benchmark::State& state) { return static_cast<std::uint64_t>(state.range(0)); }

std::uint64_t add_bytes(std::uint64_t n, std::uint64_t batches) {
    return 8 * n * batches + 2 * FixedMoments::state_bytes(n);
}

/// Arrays of m and t, and the batches over them.
struct Input {
    Input(const Engine& engine, std::uint64_t n, std::size_t count) {
        for (std::size_t k = 0; k < count; ++k) {
            arrays.emplace_back(engine, n, 0.3f);
            arrays.emplace_back(engine, n, 1.1f);
            batches.push_back({arrays[2 * k].view(), arrays[2 * k + 1].view()});
        }
    }
    std::vector<Array> arrays;
    std::vector<Batch> batches;
};

bool room(benchmark::State& state, const Engine& engine, std::uint64_t bytes) {
    return fits(state, engine, bytes, 16 * Moments::plane_stride(values_of(state)));
}

template <class Kind> void add(benchmark::State& state, std::size_t count) {
    const Engine engine;
    const std::uint64_t n = values_of(state), bytes = 8 * n * count + 2 * Kind::state_bytes(n);
    if (!room(state, engine, bytes)) return;
    Kind sum(engine, n);
    const Input in(engine, n, count);
    finish(sum.add(in.batches, {}));
    for (auto _ : state) finish(sum.add(in.batches, {}));
    report(state, n * count, bytes);
}

template <class Kind> void merge(benchmark::State& state) {
    const Engine engine;
    const std::uint64_t n = values_of(state);
    if (!room(state, engine, 2 * Kind::state_bytes(n))) return;
    Kind a(engine, n), b(engine, n);
    const Input in(engine, n, 1);
    finish(a.add(in.batches, {}));
    finish(b.add(in.batches, {}));
    finish(a.merge(b, {}));
    for (auto _ : state) finish(a.merge(b, {}));
    report(state, n, 3 * Kind::state_bytes(n));
}

constexpr auto add_fixed = add<FixedMoments>;
constexpr auto add_two_float = add<Moments>;
void merge_fixed(benchmark::State& state) { merge<FixedMoments>(state); }
void merge_two_float(benchmark::State& state) { merge<Moments>(state); }

void moments(benchmark::State& state) {
    const Engine engine;
    const std::uint64_t n = values_of(state), bytes = FixedMoments::state_bytes(n) + Moments::state_bytes(n);
    if (!room(state, engine, bytes)) return;
    FixedMoments sum(engine, n);
    Moments out(engine, n);
    const Input in(engine, n, 3);
    finish(sum.add(in.batches, {}));
    finish(sum.moments(out, {}));
    for (auto _ : state) finish(sum.moments(out, {}));
    report(state, n, bytes);
}

void limit(benchmark::State& state) { scaling_limit(state, add_bytes(values_of(state), 1)); }

void sizes(benchmark::internal::Benchmark* b) {
    b->RangeMultiplier(10)->Range(100000, 10000000)->MeasureProcessCPUTime()->UseRealTime();
}

}  // namespace

BENCHMARK(limit)->Apply(sizes);
BENCHMARK_CAPTURE(add_fixed, 1, 1)->Apply(sizes);
BENCHMARK_CAPTURE(add_fixed, 8, 8)->Apply(sizes);
BENCHMARK_CAPTURE(add_two_float, 1, 1)->Apply(sizes);
BENCHMARK_CAPTURE(add_two_float, 8, 8)->Apply(sizes);
BENCHMARK(merge_fixed)->Apply(sizes);
BENCHMARK(merge_two_float)->Apply(sizes);
BENCHMARK(moments)->Apply(sizes);
