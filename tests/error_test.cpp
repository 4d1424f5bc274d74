#include "clratio/error.hpp"

#include <gtest/gtest.h>

#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <cstring>
#include <limits>

#include "clratio/device/error.h"
#include "embedded.hpp"
#include "support/oclgrind.hpp"
#include "support/raw_kernel.hpp"
#include "support/refused.hpp"
#include "support/shapes.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

// Typical, correlated, tau = 0 with its impulse, negative, tiny sigma_t, rho = 1, Monte Carlo.
std::vector<Canonical> laws() {
    return {canonical({.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35}),
            canonical({.mu = 1, .tau = 2, .sigma_m = .5, .sigma_t = .5, .rho = .9, .n = 16}),
            canonical({.mu = 1, .tau = 0, .sigma_m = .3, .sigma_t = .2}),
            canonical({.mu = -.5, .tau = -1, .sigma_m = .2, .sigma_t = .3, .rho = -.4}),
            canonical({.mu = 3, .tau = 1, .sigma_m = .5, .sigma_t = 1e-8}),
            canonical({.mu = 1, .tau = 1, .sigma_m = .2, .sigma_t = .5, .rho = 1}),
            monte_carlo_canonical({.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35, .n = 4})};
}

std::vector<float> host_samples(const Canonical& law, const Stream& s, std::uint64_t first, std::size_t count) {
    std::vector<float> v(count);
    for (std::size_t i = 0; i < count; ++i) v[i] = error_sample(law, s, first + i);
    return v;
}

template <class T> bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

double reference_normal(std::uint32_t h) {
    const bool negative = h < 0x80000000u;
    const double z = 1.4142135623730951 * boost::math::erfc_inv((2.0 * (negative ? h : ~h) + 1) * 0x1p-32);
    return negative ? -z : z;
}

// Eq. (14) as the supplement writes it, in double, from the same words: M, T, then (tau + i) M / (T + i) - mu.
// Tolerance: each z within 6e-7 relative and five roundings of 2^-24, carried through to X.
bool is_equation_14(const ErrorModel& e, const Stream& stream, const std::vector<float>& got, std::uint64_t first) {
    Stream words = stream;
    words.domain = Domain::error;
    for (std::size_t i = 0; i < got.size(); ++i) {
        const double z1 = reference_normal(word(words, 2 * (first + i))),
                     z2 = reference_normal(word(words, 2 * (first + i) + 1));
        const double root = std::sqrt(static_cast<double>(e.n)), impulse = e.tau == 0, c = e.tau + impulse;
        // Z2 is the relative denominator's noise: T = tau + sign(c) sigma_t Z2.
        const double sign = c < 0 ? -1 : 1;
        const double m = e.mu + e.sigma_m / root * (sign * e.rho * z2 + std::sqrt(1 - e.rho * e.rho) * z1);
        const double t = e.tau + sign * e.sigma_t / root * z2;
        const double want = c * m / (t + impulse) - e.mu;
        const double u = (t + impulse) / c, s = e.sigma_t / std::abs(c) / root;
        const double noise = e.sigma_m / root * (std::abs(z1) + std::abs(z2)) + std::abs(e.mu * s * z2);
        const double scale = (noise + std::abs(want) * (1 + std::abs(s * z2))) / std::abs(u);
        if (!(std::abs(static_cast<double>(got[i]) - want) <= (6e-7 + 5 * 0x1p-24) * scale)) return false;
    }
    return true;
}

const std::vector<std::uint64_t> starts{0, 1, 33, (1ull << 32) - 501, (1ull << 33) - 700, end_of_stream - 1003};

}  // namespace

TEST(Error, samples_have_the_same_bits_in_every_shape_and_range) {
    constexpr std::size_t count = 1003;
    for (const auto generator : {Generator::philox, Generator::pcg4d3x}) {
        const Stream stream{1, 2, generator};
        for (const auto& shape : all_shapes()) {
            const Engine engine(shape.options);
            for (const std::uint64_t first : starts) {
                std::vector<float> got(count);
                error_samples(engine, laws()[1], stream, first, got);
                ASSERT_TRUE(same_bits(got, host_samples(laws()[1], stream, first, count)))
                    << shape.name << " from " << first;
            }
        }
    }
}

namespace {

void expect_the_hosts_samples(const Engine& engine, const Canonical& law, const Stream& stream, std::size_t count) {
    std::vector<float> f(count);
    std::vector<double> d(count), want(count);
    error_samples(engine, law, stream, 11, f);
    error_samples(engine, law, stream, 11, d);
    for (std::size_t i = 0; i < count; ++i) want[i] = error_sample_double(law, stream, 11 + i);
    EXPECT_TRUE(same_bits(f, host_samples(law, stream, 11, count)));
    EXPECT_TRUE(same_bits(d, want));
}

}  // namespace

TEST(Error, every_law_has_the_hosts_bits_in_float_and_double) {
    const Engine engine;
    for (const auto& law : laws()) expect_the_hosts_samples(engine, law, {2}, 5000);
}

TEST(ErrorSmall, every_kernel) {
    for (const auto generator : {Generator::philox, Generator::pcg4d3x})
        for (const auto& shape : smallest_shapes())
            expect_the_hosts_samples(Engine(shape.options), laws()[1], {2, 0, generator}, 21);
}

TEST(Error, kernels_are_clean_under_oclgrind) { expect_clean_under_oclgrind("error_test", "ErrorSmall.*"); }

TEST(Error, a_range_is_its_parts) {
    const Engine engine;
    std::vector<float> whole(3000), parts(3000);
    error_samples(engine, laws()[0], {3}, 100, whole);
    std::size_t at = 0;
    for (const std::size_t part : {1, 2, 30, 967, 2000}) {
        error_samples(engine, laws()[0], {3}, 100 + at, std::span(parts).subspan(at, part));
        at += part;
    }
    EXPECT_TRUE(same_bits(whole, parts));
}

TEST(Error, samples_are_equation_14) {
    const Engine engine;
    const std::vector<ErrorModel> models{{.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35},
                                         {.mu = 1, .tau = 2, .sigma_m = .5, .sigma_t = .5, .rho = .9, .n = 16},
                                         {.mu = 1, .tau = 0, .sigma_m = .3, .sigma_t = .2},
                                         {.mu = -.5, .tau = -1, .sigma_m = .2, .sigma_t = .3, .rho = -.4}};
    for (const auto& model : models)
        for (const std::uint64_t seed : {1, 2, 3}) {
            std::vector<float> got(20000);
            error_samples(engine, canonical(model), {seed}, 5, got);
            EXPECT_TRUE(is_equation_14(model, {seed}, got, 5)) << "mu " << model.mu << " tau " << model.tau;
        }
}

TEST(Error, equation_14_catches_planted_faults) {
    const Engine engine;
    const ErrorModel model{.mu = 1, .tau = 2, .sigma_m = .5, .sigma_t = .5, .rho = -.3};
    const auto passes = [&](std::string_view from, std::string_view to) {
        constexpr std::uint64_t count = 4096;
        const Buffer out(engine, count * sizeof(float));
        RawKernel(engine, replaced(flatten_kernel("error"), from, to), "clr_error_samples", "-DCLR_GENERATOR=CLR_PHILOX")
            .arg(out)
            .arg(device::clr_layout{0, 1, 1})
            .arg(to_float(canonical(model)))
            .arg(device::clr_stream{1, 0, CLR_DOMAIN_ERROR})
            .arg(cl_ulong{0})
            .arg(cl_ulong{count})
            .arg(cl_ulong{0})
            .arg(device::clr_range{count / 2, count / 2 / static_cast<std::uint64_t>(engine.width())})
            .run(1, 1);
        return is_equation_14(model, {1}, contents<float>(out), 0);
    };
    EXPECT_TRUE(passes("kernel", "kernel"));
    EXPECT_FALSE(passes("z2.n * z1.d", "z1.n * z2.d"));
    EXPECT_FALSE(passes("(clr_real)(law.s), z2.n, z2.d", "(clr_real)(law.s), z1.n, z2.d"));
    EXPECT_FALSE(passes("clr_error_sample(law, w.w2, w.w3)", "clr_error_sample(law, w.w0, w.w1)"));
}

TEST(Error, monte_carlo_samples_are_scaled_normals) {
    const ErrorModel model{.mu = 7, .tau = 1, .sigma_m = 3, .sigma_t = 2, .n = 9};
    for (std::uint64_t i = 0; i < 1000; ++i) {
        const double z = normal({1, 0, Generator::philox, Domain::error}, 2 * i);
        EXPECT_NEAR(error_sample(monte_carlo_canonical(model), {1}, i), z, 4 * 0x1p-24 * std::abs(z));
    }
}

TEST(Error, bad_parameters_are_refused_by_name) {
    const Engine engine;
    std::vector<float> out(4);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    refused([] { canonical({.sigma_m = -1}); }, "sigma_m: expected");
    refused([=] { canonical({.sigma_t = nan}); }, "sigma_t: expected");
    refused([] { canonical({.sigma_m = 1, .rho = 1.5}); }, "rho: expected");
    refused([] { canonical({.n = 0}); }, "n: expected");
    refused([&] { error_samples(engine, Canonical{-1, 0, 1}, {1}, 0, out); }, "s: expected");
    refused([&] { error_samples(engine, Canonical{1, nan, 1}, {1}, 0, out); }, "a: expected");
    refused([&] { error_samples(engine, Canonical{1, 0, 1}, {1}, end_of_stream - 2, out); }, "range: expected");
    refused(
        [&] {
            error_samples(engine, Canonical{1, 0, 1}, {1ull << 40, 0, Generator::pcg4d3x}, 0, out);
        },
        "seed: expected");
}
