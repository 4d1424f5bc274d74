// Reading each estimator out of a state, with its error or alone: values/s and bytes/s beside two limits of as many bytes:
// reading and adding up what the planes read, and scaling in place.
#include "support/device.hpp"

using namespace clratio;
using namespace clratio::bench;

namespace {

constexpr std::uint32_t groups = 8;

std::uint64_t values_of(const benchmark::State& state) { return static_cast<std::uint64_t>(state.range(0)); }

MomentsOptions options_for(Estimator e) {
    const Needs needs = needs_of(e);
    return {.nonfinite = NonFinite::propagate, .ratios = needs.ratios, .groups = needs.groups ? groups : 1};
}

/// What each value needs: the planes that the estimator uses, tau, the estimate and its error.
Mix mix_of(Estimator e) {
    if (e == Estimator::mean) return {4, 2};
    if (e == Estimator::mean_of_ratios) return {7, 1};
    if (e == Estimator::hartley_ross) return {13, 2};
    const std::uint32_t planes = e == Estimator::jackknife ? 4 : 10;  // its error is that of the groups' means
    return {planes * options_for(e).groups + 1, 2};
}

/// The same of the ratio or mickey alone: the means are enough.
Mix alone_mix_of(Estimator e) { return {4 * options_for(e).groups + 1, 1}; }

std::uint64_t bytes_moved(std::uint64_t n, Mix m) { return 4 * n * (m.reads + m.writes); }

void read_out(benchmark::State& state, Estimator e, bool has_error, Mix moved) {
    const Engine engine;
    const std::uint64_t n = values_of(state);
    if (!fits(state, engine, Moments::state_bytes(n, options_for(e)) + 16 * n, 8 * groups * n)) return;
    Moments moments(engine, n, options_for(e));
    const Array t(engine, n, 1.5f), tau(engine, n, 1.0f), out(engine, n, 0.0f), error(engine, n, 0.0f);
    const Batch batch{tau.view(), t.view()};
    for (std::uint32_t k = 0; k < 2 * groups; ++k) finish(moments.add(std::span(&batch, 1), {}));
    const auto run = [&] {
        finish(combine(moments, tau.view(), {out.view(), has_error ? error.view() : View{}, nullptr}, {.estimator = e}));
    };
    run();
    for (auto _ : state) run();
    report(state, n, bytes_moved(n, moved));
}

void in_place(benchmark::State& state) { scaling_limit(state, bytes_moved(values_of(state), mix_of(Estimator::ratio))); }

void mix(benchmark::State& state, Mix m) { mixed_limit(state, values_of(state), m); }

void sizes(benchmark::internal::Benchmark* b) {
    b->RangeMultiplier(10)->Range(100000, 10000000)->MeasureProcessCPUTime()->UseRealTime();
}

const bool registered = [] {
    benchmark::RegisterBenchmark("limit", in_place)->Apply(sizes);
    for (const Estimator e : all_estimators()) {
        const bool has_error = e != Estimator::mean_of_ratios;
        benchmark::RegisterBenchmark(("mix/" + name_of(e)).c_str(), mix, mix_of(e))->Apply(sizes);
        benchmark::RegisterBenchmark(("read_out/" + name_of(e)).c_str(), read_out, e, has_error, mix_of(e))->Apply(sizes);
    }
    for (const Estimator e : {Estimator::ratio, Estimator::mickey}) {
        benchmark::RegisterBenchmark(("mix_alone/" + name_of(e)).c_str(), mix, alone_mix_of(e))->Apply(sizes);
        benchmark::RegisterBenchmark(("alone/" + name_of(e)).c_str(), read_out, e, false, alone_mix_of(e))->Apply(sizes);
    }
    return true;
}();

}  // namespace
