// Stateless combine, tau an image or a number: values/s and bytes/s beside the in-place scaling of as many bytes. Writing
// over m, which is allowed, is in place as the limit is; another output costs the memory a third stream, not counted here. A
// mix only reads and writes as combine does.
#include "support/device.hpp"

using namespace clratio;
using namespace clratio::bench;

namespace {

std::uint64_t values_of(const benchmark::State& state) { return static_cast<std::uint64_t>(state.range(0)); }

// m, t and the output are one float a value each; so is an image of tau.
std::uint64_t bytes_moved(std::uint64_t n, bool tau_image) { return (tau_image ? 16 : 12) * n; }

enum class Output { over_m, apart };

void stateless(benchmark::State& state, bool tau_image, Output output) {
    const Engine engine;
    const std::uint64_t n = values_of(state);
    if (!fits(state, engine, bytes_moved(n, tau_image), 4 * n)) return;
    const Array m(engine, n, 0.5f), t(engine, n, 1.0f), tau(engine, tau_image ? n : 1, 1.0f),
        other(engine, output == Output::apart ? n : 1, 0.0f);
    const View tau_of_each = tau_image ? tau.view() : View{tau.mem(), 0, n, 0, 1};
    const View out = output == Output::apart ? other.view() : m.view();
    const auto run = [&] { finish(combine(engine, m.view(), t.view(), tau_of_each, {out, {}, nullptr})); };
    run();
    for (auto _ : state) run();
    report(state, n, bytes_moved(n, tau_image));
}

void limit(benchmark::State& state, bool tau_image) { scaling_limit(state, bytes_moved(values_of(state), tau_image)); }

void mix(benchmark::State& state, Mix m) { mixed_limit(state, values_of(state), m); }

void sizes(benchmark::internal::Benchmark* b) {
    b->RangeMultiplier(10)->Range(100000, 100000000)->MeasureProcessCPUTime()->UseRealTime();
}

}  // namespace

BENCHMARK_CAPTURE(limit, tau_image, true)->Apply(sizes);
BENCHMARK_CAPTURE(mix, tau_image, {3, 1, true})->Apply(sizes);
BENCHMARK_CAPTURE(mix, tau_image_apart, {3, 1})->Apply(sizes);
BENCHMARK_CAPTURE(mix, tau_number, {2, 1, true})->Apply(sizes);
BENCHMARK_CAPTURE(stateless, tau_image, true, Output::over_m)->Apply(sizes);
BENCHMARK_CAPTURE(stateless, tau_image_apart, true, Output::apart)->Apply(sizes);
BENCHMARK_CAPTURE(limit, tau_number, false)->Apply(sizes);
BENCHMARK_CAPTURE(stateless, tau_number, false, Output::over_m)->Apply(sizes);
