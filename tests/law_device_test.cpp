// The law on the device: against 40-digit numbers, the host twin bit for bit, and misuse.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>

#include "clratio/law.hpp"
#include "launch.hpp"
#include "support/oclgrind.hpp"
#include "support/samples.hpp"
#include "support/theory.hpp"

using namespace clratio;
using clratio::test::model_of;
using clratio::test::text;
using clratio::test::theory;

namespace {

using Twin = float (*)(device::clr_law_lanes, float);
using Call = void (*)(const Engine&, Law, std::span<const ErrorModel>, std::span<const float>, std::span<float>);

struct Quantity {
    const char* name;
    Law law;
    Call call;
    Twin twin;
};

const Quantity quantities[] = {{"pdf", Law::exact, law_pdf, device::clr_law_pdf},
                               {"log_pdf", Law::exact, law_log_pdf, device::clr_law_log_pdf},
                               {"cdf", Law::exact, law_cdf, device::clr_law_cdf},
                               {"sf", Law::exact, law_sf, device::clr_law_sf},
                               {"published pdf", Law::published, law_pdf, device::clr_law_published_pdf},
                               {"published log_pdf", Law::published, law_log_pdf, device::clr_law_published_log_pdf},
                               {"mc pdf", Law::mc, law_pdf, device::clr_law_pdf},
                               {"mc cdf", Law::mc, law_cdf, device::clr_law_cdf}};

const std::vector<ErrorModel> models = {{1, 2, .5, .5},         {.5, 1, .5, .35},        {-1, 2, .5, .5, .5},
                                        {1, 0, .3, .2},         {3, 1, .1, .3, .99},     {1, 2, .5, 2, .6},
                                        {1, 2, .5, 0},          {1, 2, .5, .5, 1},       {.25, 2, .125, 1, 1},
                                        {1, 2, .5, .5, 0, 256}, {1e4, 3e4, 2e3, 5e3, .9}};

// 61 values of every size, the special ones among them: 61 is no multiple of a width.
std::vector<float> points() {
    std::vector<float> x = {0.f, -0.f, 1e-30f, -1e-30f, 1e6f, -1e6f, 1e20f, -1e30f, INFINITY, -INFINITY, NAN, 2.f, 1e-42f};
    for (int i = 0; i < 48; ++i) x.push_back(static_cast<float>(-3.1 + i * .127));
    return x;
}

device::clr_law_lanes lanes(const device::clr_law& m) { return {m.s, m.a, m.b, m.inverse_sd, m.half_turn}; }

std::vector<float> twin(const Quantity& q, std::span<const ErrorModel> all, std::span<const float> x) {
    std::vector<float> out;
    for (const auto& model : all) {
        const auto m = lanes(ErrorLaw(q.law, model).device_form());
        for (float v : x) out.push_back(q.twin(m, v));
    }
    return out;
}

// A NaN has many bit patterns; all others must be the same.
bool same(float a, float b) {
    return (std::isnan(a) && std::isnan(b)) || std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}

int differences(std::span<const float> a, std::span<const float> b) {
    int n = 0;
    for (std::size_t i = 0; i < a.size(); ++i) n += !same(a[i], b[i]);
    return n;
}

std::vector<float> run(const Engine& engine, const Quantity& q, std::span<const ErrorModel> all, std::span<const float> x) {
    std::vector<float> out(all.size() * x.size());
    q.call(engine, q.law, all, x, out);
    return out;
}

float one(Call call, Law law, const ErrorModel& model, double x) {
    static const Engine engine;
    const float at = static_cast<float>(x);
    float out = 0;
    call(engine, law, {&model, 1}, {&at, 1}, {&out, 1});
    return out;
}

struct Worst {
    double error = 0;
    std::uint32_t bits = 0;
    void add(double e, float x) {
        if (e > error) *this = {e, std::bit_cast<std::uint32_t>(x)};
    }
};

double ulps(float got, double want) {
    const int e = std::max(std::ilogb(want), -126);
    return std::abs(static_cast<double>(got) - want) / std::ldexp(1, e - 23);
}

}  // namespace

TEST(Exponential, exp_is_within_its_stated_error) {
    Worst normal, subnormal;
    for (std::uint64_t i = 0; i < 0x80000000u; i += 997)
        for (const std::uint32_t sign : {0u, 0x80000000u}) {
            const float x = std::bit_cast<float>(static_cast<std::uint32_t>(i) | sign);
            if (!(std::abs(x) < 104 && x < 88.72f)) continue;
            (x < -87.3f ? subnormal : normal).add(ulps(device::clr_exp(x), std::exp(static_cast<double>(x))), x);
        }
    EXPECT_LE(normal.error, 1.1) << std::hex << normal.bits;
    EXPECT_LE(subnormal.error, 2) << std::hex << subnormal.bits;
    EXPECT_EQ(device::clr_exp(0.f), 1.f);
    EXPECT_EQ(device::clr_exp(-INFINITY), 0.f);
    EXPECT_EQ(device::clr_exp(-1e30f), 0.f);
    EXPECT_EQ(device::clr_exp(INFINITY), INFINITY);
    EXPECT_EQ(device::clr_exp(88.8f), INFINITY);
    EXPECT_TRUE(std::isnan(device::clr_exp(NAN)));
}

TEST(Exponential, log_is_within_its_stated_error) {
    Worst worst;
    for (std::uint32_t i = 1; i < 0x7f800000u; i += 997) {
        const float x = std::bit_cast<float>(i);
        const double want = std::log(static_cast<double>(x));
        worst.add(want == 0 ? std::abs(device::clr_log(x)) * 1e9 : ulps(device::clr_log(x), want), x);
    }
    EXPECT_LE(worst.error, 1.1) << std::hex << worst.bits;
    EXPECT_EQ(device::clr_log(1.f), 0.f);
    EXPECT_EQ(device::clr_log(0.f), -INFINITY);
    EXPECT_EQ(device::clr_log(INFINITY), INFINITY);
    EXPECT_TRUE(std::isnan(device::clr_log(-1.f)));
    EXPECT_TRUE(std::isnan(device::clr_log(NAN)));
}

TEST(Exponential, erfc_is_within_its_stated_error) {
    Worst worst;
    for (std::uint32_t i = 0; i < std::bit_cast<std::uint32_t>(9.15f); i += 997) {
        const float x = std::bit_cast<float>(i);
        worst.add(std::abs(device::clr_erfc(x) / std::erfc(static_cast<double>(x)) - 1), x);
    }
    EXPECT_LE(worst.error, 6e-7) << std::hex << worst.bits;
    EXPECT_EQ(device::clr_erfc(11.f), 0.f);
    EXPECT_EQ(device::clr_erfc(INFINITY), 0.f);
    EXPECT_TRUE(std::isnan(device::clr_erfc(NAN)));
}

// What law.hpp states; theory, section 7, asks for 2e-6 of the peak and 1e-6.
TEST(LawDevice, is_the_vectors) {
    Worst density, published, probability, log_density;
    for (const auto& v : theory("density")) {
        const ErrorModel model = model_of(v);
        const ErrorLaw exact(Law::exact, model), paper(Law::published, model);
        const double x = v["x"], pdf = v["pdf"], log_pdf = v["logpdf"], eq22 = v["eq22"], below = v["cdf"], above = v["sf"];
        const float at = static_cast<float>(x);
        const double peak = exact.pdf(exact.modes()[0]), paper_peak = paper.pdf(paper.modes()[0]);
        density.add(std::abs(one(law_pdf, Law::exact, model, x) - pdf) / peak, at);
        published.add(std::abs(one(law_pdf, Law::published, model, x) - eq22) / paper_peak, at);
        probability.add(std::abs(one(law_cdf, Law::exact, model, x) - below), at);
        probability.add(std::abs(one(law_sf, Law::exact, model, x) - above), at);
        log_density.add(std::abs(one(law_log_pdf, Law::exact, model, x) - log_pdf) / (1 + std::abs(log_pdf)), at);
    }
    EXPECT_LE(density.error, 5e-7) << std::hex << density.bits;
    EXPECT_LE(published.error, 5e-7) << std::hex << published.bits;
    EXPECT_LE(probability.error, 2e-7) << std::hex << probability.bits;
    EXPECT_LE(log_density.error, 1e-6) << std::hex << log_density.bits;
}

// Where s or |a| / b is large, their rounding to float is what counts.
TEST(LawDevice, wide_denominators_and_narrow_residuals_lose_what_is_stated) {
    const Engine engine;
    test::Samples draw(1);
    Worst density, probability, log_density;
    for (int k = 0; k < 500; ++k) {
        const double s = std::pow(10, 6 * draw.uniform() - 3), a = std::pow(10, 6 * draw.uniform() - 2);
        const ErrorModel model{(k % 2 ? a : -a) / s, 1, 1, s};
        const ErrorLaw law(Law::exact, model);
        const double beyond = std::max({1., s / 6, a / 6}), peak = law.pdf(law.modes().front());
        std::vector<float> x;
        for (const double size : {0., 1e-6, 1e-3, .03, .1, .3, .6, 1., 1.5, 2., 3., 5., 30., 1e3, 1e6})
            for (const double sign : {-1., 1.}) x.push_back(static_cast<float>(sign * size * law.scale()));
        std::vector<float> pdf(x.size()), log_pdf(x.size()), cdf(x.size());
        law_pdf(engine, Law::exact, {&model, 1}, x, pdf);
        law_log_pdf(engine, Law::exact, {&model, 1}, x, log_pdf);
        law_cdf(engine, Law::exact, {&model, 1}, x, cdf);
        for (std::size_t i = 0; i < x.size(); ++i) {
            const double want = law.log_pdf(x[i]);
            density.add(std::abs(pdf[i] - law.pdf(x[i])) / peak / beyond, x[i]);
            probability.add(std::abs(cdf[i] - law.cdf(x[i])) / beyond, x[i]);
            log_density.add(std::abs(log_pdf[i] - want) / (1 + std::abs(want)) / beyond, x[i]);
        }
    }
    EXPECT_LE(density.error, 5e-7) << std::hex << density.bits;
    EXPECT_LE(probability.error, 2e-7) << std::hex << probability.bits;
    EXPECT_LE(log_density.error, 1e-6) << std::hex << log_density.bits;
}

TEST(LawDevice, published_law_fails_the_exact_laws_test) {
    int caught = 0;
    for (const auto& v : theory("density")) {
        const ErrorLaw exact(Law::exact, model_of(v));
        const double peak = exact.pdf(exact.modes()[0]), pdf = v["pdf"];
        caught += std::abs(one(law_pdf, Law::published, model_of(v), v["x"]) - pdf) > 5e-7 * peak;
    }
    EXPECT_GT(caught, 60);
}

TEST(LawDevice, same_bits_as_the_host_twin_at_every_width) {
    const auto x = points();
    const auto compare = [&](const EngineOptions& options) {
        const Engine engine(options);
        for (const auto& q : quantities)
            EXPECT_EQ(differences(run(engine, q, models, x), twin(q, models, x)), 0)
                << q.name << " width " << options.width << " items " << options.work_items;
    };
    for (const int width : {1, 2, 4, 8, 16})
        for (const std::uint32_t items : {1u, 3u})
            compare({.width = width, .path = EngineOptions::Path::ranges, .work_items = items});
    for (const int width : {1, 4}) compare({.width = width, .path = EngineOptions::Path::groups, .work_items = 4});
}

TEST(LawDevice, the_bit_comparison_sees_one_ulp) {
    const auto x = points();
    auto changed = twin(quantities[0], models, x);
    changed[17] = std::nextafter(changed[17], 1e9f);
    EXPECT_EQ(differences(run(Engine(), quantities[0], models, x), changed), 1);
}

TEST(LawDevice, a_model_for_each_value) {
    const Engine engine;
    std::vector<ErrorModel> each;
    std::vector<float> x, want;
    for (int i = 0; i < 100; ++i) {
        each.push_back({1 + .01 * i, 2, .5, .5});
        x.push_back(static_cast<float>(-1 + .02 * i));
        want.push_back(device::clr_law_cdf(lanes(ErrorLaw(Law::exact, each.back()).device_form()), x.back()));
    }
    std::vector<float> out(100);
    law_cdf(engine, Law::exact, each, x, out);
    EXPECT_EQ(differences(out, want), 0);
}

TEST(LawDevice, event_form_on_strided_views) {
    const Engine engine;
    const std::vector<float> x = {0, 9, .5f, 9, -1, 9};
    const std::vector<ErrorModel> two = {{1, 2, .5, .5}, {.5, 1, .5, .35}};
    std::vector<float> out(12, 7.f);
    const Buffer xb = Buffer::from_host(engine, std::as_bytes(std::span(x)));
    const Buffer ob = Buffer::onto_host(engine, std::as_writable_bytes(std::span(out)));
    ob.write(std::as_bytes(std::span<const float>(out)));
    wait(Event(law_pdf(engine, Law::exact, two, {xb.mem(), 0, 3, 2, 1}, {ob.mem(), 0, 6, 2, 1})));
    ob.publish();
    const std::vector<float> wanted = twin(quantities[0], two, std::vector<float>{0, .5f, -1});
    for (std::size_t i = 0; i < 6; ++i) {
        EXPECT_TRUE(same(out[2 * i], wanted[i])) << i;
        EXPECT_EQ(out[2 * i + 1], 7.f) << i;
    }
}

TEST(LawDevice, edge_cases) {
    const ErrorModel point{.25, 2, .125, 1, 1}, normal{1, 2, .5, 0};
    EXPECT_EQ(one(law_pdf, Law::exact, point, 0), INFINITY);
    EXPECT_EQ(one(law_pdf, Law::exact, point, 1e-6), 0);
    EXPECT_EQ(one(law_cdf, Law::exact, point, 0), 1);
    EXPECT_EQ(one(law_cdf, Law::exact, point, -1e-6), 0);
    EXPECT_EQ(one(law_log_pdf, Law::exact, point, .1), -INFINITY);
    EXPECT_NEAR(one(law_cdf, Law::exact, normal, 0), .5, 1e-7);
    EXPECT_EQ(one(law_cdf, Law::exact, normal, INFINITY), 1);
    EXPECT_EQ(one(law_pdf, Law::exact, normal, -INFINITY), 0);
    EXPECT_TRUE(std::isnan(one(law_pdf, Law::exact, normal, NAN)));
    EXPECT_TRUE(std::isnan(one(law_sf, Law::exact, point, NAN)));
}

// Small enough for oclgrind's interpreter: a whole vector, a remainder, and lanes of two models in one vector.
TEST(LawSmall, every_kernel) {
    const std::vector<ErrorModel> two = {{1, 2, .5, .5}, {.5, 1, .5, .35}};
    const std::vector<float> x = {0.f, -1.5f, .25f, 3.f, NAN};
    for (const int width : {1, 4}) {
        const Engine engine({.width = width, .path = EngineOptions::Path::ranges, .work_items = 2, .disk_cache = false});
        for (const auto& q : quantities)
            EXPECT_EQ(differences(run(engine, q, two, x), twin(q, two, x)), 0) << q.name << " width " << width;
    }
}

TEST(LawDevice, kernels_are_clean_under_oclgrind) { test::expect_clean_under_oclgrind("law_device_test", "LawSmall.*"); }

// The planted fault: half of the results have no place in the buffer. Never run but under oclgrind.
TEST(LawSmall, DISABLED_a_store_out_of_bounds) {
    const Engine engine({.width = 1, .path = EngineOptions::Path::ranges, .work_items = 1, .disk_cache = false});
    const auto law = ErrorLaw(Law::exact, {1, 2, .5, .5}).device_form();
    const std::vector<float> x(8);
    const Buffer models_buffer = Buffer::copy_of(engine, std::as_bytes(std::span(&law, 1)));
    const Buffer xb = Buffer::copy_of(engine, std::as_bytes(std::span(x)));
    const Buffer out(engine, 4 * sizeof(float));
    const device::clr_law_task task{{0, 1, 1}, {0, 1, 1}, 8, 0, 0};
    wait(Launch(engine, "law", "clr_each_law_pdf").arg(models_buffer).arg(xb).arg(out).arg(task).run_ranges(8));
}

TEST(LawDevice, oclgrind_sees_a_store_out_of_bounds) {
    const auto report = test::under_oclgrind("law_device_test", "LawSmall.DISABLED_a_store_out_of_bounds",
                                             "--gtest_also_run_disabled_tests");
    if (!report) GTEST_SKIP() << "oclgrind is not installed (Debian: apt install oclgrind)";
    EXPECT_EQ(report->complaints(), 4) << report->output;
}

TEST(LawDevice, misuse_is_refused) {
    const Engine engine;
    const std::vector<ErrorModel> two = {{1, 2, .5, .5}, {.5, 1, .5, .35}};
    std::vector<float> x(3), out(6), odd(5), four(4);
    EXPECT_THROW(law_pdf(engine, Law::exact, {}, x, out), InvalidArgument);
    EXPECT_THROW(law_pdf(engine, Law::exact, two, x, odd), InvalidArgument);
    EXPECT_THROW(law_pdf(engine, Law::exact, two, four, out), InvalidArgument);
    EXPECT_THROW(law_pdf(engine, Law::exact, two, {}, std::span<float>{}), InvalidArgument);
    EXPECT_THROW(law_pdf(engine, Law::integral, two, x, out), InvalidArgument);
    EXPECT_THROW(law_cdf(engine, Law::published, two, x, out), InvalidArgument);
    EXPECT_THROW(law_pdf(engine, Law::exact, std::vector<ErrorModel>{{1, 2, -1, .5}}, x, four), InvalidArgument);
    EXPECT_THROW(law_pdf(engine, Law::exact, std::vector<ErrorModel>{{1, 2, 1e-42, 0}}, x, x), InvalidArgument);
    const Buffer small(engine, 8);
    EXPECT_THROW(law_pdf(engine, Law::exact, two, View{small.mem(), 0, 3}, View{small.mem(), 0, 6}), InvalidArgument);
}
