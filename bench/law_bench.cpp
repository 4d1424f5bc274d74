// Densities and probabilities of the exact law: points/s in float on the device, in double on one core of the host.
#include <benchmark/benchmark.h>

#include <vector>

#include "clratio/law.hpp"
#include "support/device.hpp"

namespace {

using namespace clratio;

constexpr std::uint64_t points_on_device = 1 << 22, points_on_host = 1 << 12;
const ErrorModel model{.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35};

/// `count` points from -2 to 4.
std::vector<float> points(std::uint64_t count) {
    std::vector<float> x(count);
    for (std::uint64_t i = 0; i < count; ++i) x[i] = -2 + 6 * (static_cast<float>(i) + .5f) / static_cast<float>(count);
    return x;
}

using OnDevice = void (*)(const Engine&, Law, std::span<const ErrorModel>, std::span<const float>, std::span<float>);

void device(benchmark::State& state, OnDevice law) {
    const Engine engine;
    const auto x = points(points_on_device);
    std::vector<float> out(x.size());
    law(engine, Law::exact, {&model, 1}, x, out);
    for (auto _ : state) law(engine, Law::exact, {&model, 1}, x, out);
    bench::report(state, x.size(), 8 * x.size());
}

void host(benchmark::State& state, double (ErrorLaw::*law)(double) const) {
    const ErrorLaw exact(Law::exact, model);
    const auto x = points(points_on_host);
    double sum = 0;
    for (auto _ : state)
        for (const float at : x) benchmark::DoNotOptimize(sum += (exact.*law)(at));
    bench::report(state, x.size(), 8 * x.size());
}

BENCHMARK_CAPTURE(device, pdf, OnDevice{law_pdf})->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(host, pdf, &ErrorLaw::pdf)->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(device, cdf, OnDevice{law_cdf})->MeasureProcessCPUTime()->UseRealTime();
BENCHMARK_CAPTURE(host, cdf, &ErrorLaw::cdf)->MeasureProcessCPUTime()->UseRealTime();

}  // namespace
