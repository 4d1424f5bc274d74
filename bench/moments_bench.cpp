// Adding batches, merging, reading out: values/s and bytes/s beside the in-place scaling of as many bytes, and a pass that
// only reads and writes as they do.
#include "support/device.hpp"

using namespace clratio;
using namespace clratio::bench;

namespace {

constexpr MomentsOptions propagating{.nonfinite = NonFinite::propagate};
constexpr MomentsOptions skipping{.nonfinite = NonFinite::skip};

std::uint64_t values_of(const benchmark::State& state) { return static_cast<std::uint64_t>(state.range(0)); }

std::uint64_t add_bytes(std::uint64_t n, std::uint64_t batches, MomentsOptions o) {
    return 8 * n * batches + 2 * Moments::state_bytes(n, o);
}

void add(benchmark::State& state, std::size_t batches, MomentsOptions options, bool read_out) {
    const Engine engine;
    const std::uint64_t n = values_of(state);
    if (!fits(state, engine, Moments::state_bytes(n, options) + 8 * n * batches + (read_out ? 8 * n : 0),
              Moments::plane_bytes(n)))
        return;
    Moments moments(engine, n, options);
    std::vector<Array> arrays;
    std::vector<Batch> all;
    for (std::size_t k = 0; k < batches; ++k) {
        arrays.emplace_back(engine, n, 0.5f);
        arrays.emplace_back(engine, n, 1.0f);
        all.push_back({arrays[2 * k].view(), arrays[2 * k + 1].view()});
    }
    const Array tau(engine, read_out ? n : 1, 1.0f), out(engine, read_out ? n : 1, 0.0f);
    const auto run = [&] {
        finish(read_out ? add_and_combine(moments, all, tau.view(), {out.view(), {}, nullptr}) : moments.add(all, {}));
    };
    run();
    for (auto _ : state) run();
    report(state, n * batches, add_bytes(n, batches, options) + (read_out ? 8 * n : 0));
}

void merge(benchmark::State& state, MomentsOptions options) {
    const Engine engine;
    const std::uint64_t n = values_of(state);
    if (!fits(state, engine, 2 * Moments::state_bytes(n, options), Moments::plane_bytes(n))) return;
    Moments a(engine, n, options), b(engine, n, options);
    const Array m(engine, n, 0.5f), t(engine, n, 1.0f);
    const Batch batch{m.view(), t.view()};
    finish(a.add(std::span(&batch, 1), {}));
    finish(b.add(std::span(&batch, 1), {}));
    finish(a.merge(b, {}));
    for (auto _ : state) finish(a.merge(b, {}));
    report(state, n, 3 * Moments::state_bytes(n, options));
}

void read_out(benchmark::State& state, MomentsOptions options) {
    const Engine engine;
    const std::uint64_t n = values_of(state);
    if (!fits(state, engine, Moments::state_bytes(n, options) + 12 * n, Moments::plane_bytes(n))) return;
    Moments moments(engine, n, options);
    const Array tau(engine, n, 1.0f), out(engine, n, 0.0f), error(engine, n, 0.0f);
    const Batch batch{tau.view(), tau.view()};
    for (int k = 0; k < 3; ++k) finish(moments.add(std::span(&batch, 1), {}));
    const auto run = [&] { finish(combine(moments, tau.view(), {out.view(), error.view(), nullptr})); };
    run();
    for (auto _ : state) run();
    report(state, n, Moments::state_bytes(n, options) + 12 * n);
}

void limit(benchmark::State& state) { scaling_limit(state, add_bytes(values_of(state), 1, propagating)); }

void mix(benchmark::State& state, Mix m) { mixed_limit(state, values_of(state), m); }

void sizes(benchmark::internal::Benchmark* b) {
    b->RangeMultiplier(10)->Range(100000, 100000000)->MeasureProcessCPUTime()->UseRealTime();
}

}  // namespace

BENCHMARK(limit)->Apply(sizes);
BENCHMARK_CAPTURE(mix, add_1, {12, 10, true})->Apply(sizes);
BENCHMARK_CAPTURE(mix, add_8, {26, 10, true})->Apply(sizes);
BENCHMARK_CAPTURE(mix, add_1_skip, {13, 13, true})->Apply(sizes);
BENCHMARK_CAPTURE(mix, add_8_skip, {27, 13, true})->Apply(sizes);
BENCHMARK_CAPTURE(mix, add_1_and_read_out, {13, 12, true})->Apply(sizes);
BENCHMARK_CAPTURE(mix, merge, {20, 10, true})->Apply(sizes);
BENCHMARK_CAPTURE(mix, read_out, {11, 2})->Apply(sizes);
BENCHMARK_CAPTURE(mix, read_out_skip, {14, 2})->Apply(sizes);
BENCHMARK_CAPTURE(add, 1, 1, propagating, false)->Apply(sizes);
BENCHMARK_CAPTURE(add, 8, 8, propagating, false)->Apply(sizes);
BENCHMARK_CAPTURE(add, 1_skip, 1, skipping, false)->Apply(sizes);
BENCHMARK_CAPTURE(add, 8_skip, 8, skipping, false)->Apply(sizes);
BENCHMARK_CAPTURE(add, 1_and_read_out, 1, propagating, true)->Apply(sizes);
BENCHMARK_CAPTURE(merge, propagate, propagating)->Apply(sizes);
BENCHMARK_CAPTURE(read_out, propagate, propagating)->Apply(sizes);
BENCHMARK_CAPTURE(read_out, skip, skipping)->Apply(sizes);
