// Samples of a scene a second, only those whose rays hit the medium: this library, and the same maths in vector
// instructions.
#include <benchmark/benchmark.h>

#include <numeric>

#include "clratio/medium.hpp"
#include "medium_state.hpp"
#include "native_medium.hpp"

namespace {

using namespace clratio;

constexpr Frame frame{200, 150};
constexpr std::uint32_t samples = 1024;  // the set-up of a ray, which the native version leaves out, is then a small part

// Half of the rays in the light, some in the shadow of slats and of a ball.
Scene scene() {
    Scene s;
    s.medium = {{{-2, 0, -2}, {2, 2.5, 2}}, {.25, .35, .5}, {.2375, .315, .425}, .4, {10, 9.5, 9}, {.3, .85, .45}};
    s.camera = {{.6, 1.5, -6.2}, {.05, 1.2, 0}, 38};
    for (int i = 0; i < 5; ++i) s.boxes.push_back({{-2.1 + .6 * i, 2.6, -2.5}, {-1.8 + .6 * i, 2.66, 4.5}});
    s.spheres.push_back({{.6, 1.2, .3}, .3});
    return s;
}

const MediumScene& on_device() {
    static const MediumScene s(Engine{}, scene(), frame);
    return s;
}

std::int64_t hits() {
    const auto& rows = on_device().state().row_hits;
    return std::accumulate(rows.begin(), rows.end(), std::int64_t{0});
}

void report(benchmark::State& state, std::int64_t drawn) { state.SetItemsProcessed(state.iterations() * drawn * hits()); }

void image(benchmark::State& state, Sampling sampling, Generator generator) {
    std::uint64_t seed = 0;
    render(on_device(), {sampling}, {seed, 0, generator}, samples);
    for (auto _ : state) benchmark::DoNotOptimize(render(on_device(), {sampling}, {++seed, 0, generator}, samples));
    report(state, samples);
}

// Images of 1, 2, 4, .. 64 samples of one stream, their errors counted and summed.
void errors(benchmark::State& state, Sampling sampling, Generator generator) {
    constexpr std::uint64_t seeds = 4;
    const MediumErrorOptions options{.generator = generator};
    std::uint64_t seed = 0;
    const auto run = [&] {
        return medium_errors(on_device(), {sampling}, {seed += seeds, seeds}, {}, {-.25, .25, 256}, options);
    };
    run();
    for (auto _ : state) benchmark::DoNotOptimize(run());
    report(state, 64 * seeds);
}

bool same_work(const peers::NativeSet& set, const std::vector<peers::MediumPixels>& pixels,
               const std::vector<peers::MediumSums>& sums) {
    for (std::size_t i = 0; i < pixels.size(); i += 7) {
        const std::uint32_t x = pixels[i].pixel % frame.width, y = pixels[i].pixel / frame.width;
        const auto want = render_pixel(on_device(), {}, {1}, samples, x, y);
        for (std::size_t c = 0; c < 3; ++c) {
            const std::size_t to = on_device().state().device.channel[c];
            if (sums[i].m[c][0] * (1.0f / samples) != want.m[to] || sums[i].t[c][0] * (1.0f / samples) != want.t[to])
                return false;
        }
    }
    return set.medium != nullptr;
}

void native(benchmark::State& state) {
    const auto* set = peers::native_set();
    if (!set) return state.SkipWithError("this machine has neither AVX-512 nor AVX2");
    state.SetLabel(set->name);
    const auto& s = on_device().state();
    const auto pixels = peers::medium_pixels(s.device, s.occluders, set->lanes);
    std::vector<peers::MediumSums> sums(pixels.size());
    std::uint64_t seed = 1;
    peers::native_medium(*set, s.device, pixels, {seed}, samples, sums);
    if (!same_work(*set, pixels, sums)) return state.SkipWithError("the native samples are not the library's");
    for (auto _ : state) peers::native_medium(*set, s.device, pixels, {++seed}, samples, sums);
    report(state, samples);
}

#define CLRATIO_MEASURE(function, name, sampling, generator)                                                                \
    BENCHMARK_CAPTURE(function, name, sampling, generator)->MeasureProcessCPUTime()->UseRealTime()

CLRATIO_MEASURE(image, wvds_mis_philox, Sampling::wvds_mis, Generator::philox);
BENCHMARK(native)->Name("native/wvds_mis_philox")->MeasureProcessCPUTime()->UseRealTime();
CLRATIO_MEASURE(image, wvds_mis_pcg4d3x, Sampling::wvds_mis, Generator::pcg4d3x);
CLRATIO_MEASURE(image, uni_philox, Sampling::uni, Generator::philox);
CLRATIO_MEASURE(image, ds_philox, Sampling::ds, Generator::philox);
CLRATIO_MEASURE(image, dsa_philox, Sampling::dsa, Generator::philox);
CLRATIO_MEASURE(image, dsm_philox, Sampling::dsm, Generator::philox);
CLRATIO_MEASURE(image, wvds_mean_philox, Sampling::wvds_mean, Generator::philox);
CLRATIO_MEASURE(image, wvds_min_philox, Sampling::wvds_min, Generator::philox);
CLRATIO_MEASURE(errors, wvds_mis_philox, Sampling::wvds_mis, Generator::philox);
CLRATIO_MEASURE(errors, uni_philox, Sampling::uni, Generator::philox);

}  // namespace
