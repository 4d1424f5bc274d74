#include "clratio/combine.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "moments_state.hpp"
#include "support/image_pair.hpp"
#include "support/oclgrind.hpp"
#include "support/refused.hpp"
#include "support/samples.hpp"
#include "support/shapes.hpp"
#include "support/theory.hpp"
#include "support/twin.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();

/// Sample rows of the vectors as batches of one value each.
Moments moments_of(const Engine& engine, const std::vector<float>& m, const std::vector<float>& t, double weight = 1) {
    Moments s(engine, 1, {.ratios = true});
    for (std::size_t k = 0; k < m.size(); ++k) s.add(std::span(&m[k], 1), std::span(&t[k], 1), weight);
    return s;
}

}  // namespace

TEST(Combine, stateless_has_the_twins_bits_at_every_shape) {
    const Pair p = make_pair_of(1);
    for (const auto& shape : all_shapes()) {
        const Engine engine(shape.options);
        for (const Zero zero : {Zero::mc_mean, Zero::zero, Zero::one}) {
            const Combined out = combine_pair(engine, p, zero);
            FlagCounts want;
            for (std::size_t i = 0; i < values; ++i) {
                const auto e = device::clr_read_means(p.m[i], p.t[i], p.tau[i], static_cast<std::uint32_t>(zero));
                ASSERT_EQ(std::bit_cast<std::uint32_t>(e.value), std::bit_cast<std::uint32_t>(out.estimate[i]))
                    << shape.name;
                ASSERT_EQ(e.flags, out.flag_image[i]) << shape.name;
                want.zero_denominator += (e.flags & CLR_FLAG_ZERO_DENOMINATOR) != 0;
                want.zero_tau += (e.flags & CLR_FLAG_ZERO_TAU) != 0;
                want.any += e.flags != 0;
            }
            EXPECT_EQ(out.flags.zero_denominator, want.zero_denominator) << shape.name;
            EXPECT_EQ(out.flags.zero_tau, want.zero_tau) << shape.name;
            EXPECT_EQ(out.flags.total(), want.any) << shape.name;
            EXPECT_GT(want.zero_denominator, 0u);
            EXPECT_GT(want.zero_tau, 0u);
        }
    }
}

// 1.5 ulp and 0.5 ulp from the same number.
TEST(Combine, one_batch_of_moments_gives_the_stateless_value) {
    const Pair p = make_pair_of(2);
    const Engine engine;
    Moments s(engine, values);
    s.add(p.m, p.t, 64);
    const Combined out = combine(s, Tau(std::span<const float>(p.tau))), stateless = combine_pair(engine, p);
    for (std::size_t i = 0; i < values; ++i)
        EXPECT_NEAR(out.estimate[i], stateless.estimate[i], 2 * 0x1p-23f * std::fabs(out.estimate[i]));
    EXPECT_EQ(out.flags.no_error_bar, values);
    EXPECT_EQ(out.flags.zero_denominator, stateless.flags.zero_denominator);
}

TEST(Combine, read_out_has_the_twins_bits_at_every_shape) {
    std::vector<Pair> batches;
    for (std::uint64_t k = 1; k <= 6; ++k) batches.push_back(make_pair_of(k));
    batches[2].m[17] = not_a_number;
    std::vector<TwinValue> twin(values);
    for (std::size_t k = 0; k < batches.size(); ++k)
        for (std::size_t i = 0; i < values; ++i) twin[i].add(batches[k].m[i], batches[k].t[i], static_cast<double>(k + 1));
    const std::vector<float>& tau = batches[0].tau;
    for (const auto& shape : all_shapes()) {
        Moments s(Engine(shape.options), values, {.ratios = true});
        for (std::size_t k = 0; k < batches.size(); ++k) s.add(batches[k].m, batches[k].t, static_cast<double>(k + 1));
        for (const auto estimator : {Estimator::ratio, Estimator::mean, Estimator::mean_of_ratios}) {
            const bool has_error = estimator != Estimator::mean_of_ratios;
            const Combined out = combine(s, Tau(std::span<const float>(tau)),
                                         {.estimator = estimator, .zero = Zero::one, .standard_error = has_error});
            for (std::size_t i = 0; i < values; ++i) {
                const auto e = read_twin(twin[i], tau[i], static_cast<std::uint32_t>(estimator), CLR_ZERO_ONE);
                ASSERT_EQ(std::bit_cast<std::uint32_t>(e.value), std::bit_cast<std::uint32_t>(out.estimate[i]))
                    << shape.name;
                ASSERT_EQ(e.flags, out.flag_image[i]) << shape.name << " value " << i;
                if (has_error) {
                    ASSERT_EQ(std::bit_cast<std::uint32_t>(e.error), std::bit_cast<std::uint32_t>(out.standard_error[i]))
                        << shape.name << " value " << i;
                }
            }
            EXPECT_EQ(out.flags.skipped, 1u);
        }
    }
}

// Inputs are rounded to float on the way in, 6e-8 relative each, and the estimates are smooth in them. The standard error
// comes out of a difference of second moments, which amplifies that; 3e-6 and 1e-7 tau bound it over this group.
TEST(Combine, estimates_and_errors_match_the_vectors) {
    const Engine engine;
    int errors = 0;
    for (const auto& v : theory("ratio_variants")) {
        const auto m = v.at("m").get<std::vector<float>>(), t = v.at("t").get<std::vector<float>>();
        const auto tau = v.at("tau").get<float>();
        const Moments s = moments_of(engine, m, t);
        const auto& want = v.at("out");
        const auto expect = [&](float got, const char* name) {
            if (!want.contains(name)) return;
            const auto x = want.at(name).get<double>();
            EXPECT_NEAR(got, x, 1e-6 * std::fabs(x)) << v.at("note") << ": " << name;
        };
        const Combined ratio = combine(s, tau, {.standard_error = true});
        expect(ratio.estimate[0], "R");
        expect(combine(s, tau, {.estimator = Estimator::mean_of_ratios}).estimate[0], "mean_of_ratios");
        if (!want.contains("var_delta")) continue;
        const double error = std::sqrt(want.at("var_delta").get<double>());
        EXPECT_NEAR(ratio.standard_error[0], error, 3e-6 * error + 1e-7 * static_cast<double>(tau)) << v.at("note");
        ++errors;
    }
    EXPECT_GE(errors, 5);
}

TEST(Combine, equal_means_give_tau_exactly_and_no_error) {
    Samples draw(3);
    const Engine engine;
    Moments s(engine, values);
    for (int k = 0; k < 20; ++k) {
        const auto t = floats(values, [&] { return draw.lognormal(1); });
        s.add(t, t);
    }
    const auto tau = floats(values, [&] { return draw.uniform(); });
    const Combined out = combine(s, Tau(std::span<const float>(tau)), {.standard_error = true});
    EXPECT_EQ(bits(out.estimate), bits(tau));
    EXPECT_EQ(out.standard_error, std::vector<float>(values, 0.0f));
}

TEST(Combine, the_smallest_means_have_their_ratio) {
    const Engine engine;
    cl_device_fp_config config = 0;
    clGetDeviceInfo(engine.device(), CL_DEVICE_SINGLE_FP_CONFIG, sizeof config, &config, nullptr);
    if (!(config & CL_FP_DENORM)) GTEST_SKIP() << "this device takes subnormal numbers for 0";
    Moments s(engine, 4);
    const std::vector<float> t{0x1p-130f, 0x1p-126f, 0x1p-100f, 0x1p-149f}, m{0x1p-131f, 0x1p-127f, 0x1p-101f, 0x1p-149f};
    s.add(m, t);
    const auto estimate = combine(s, 3.0f).estimate;
    EXPECT_EQ(estimate, (std::vector<float>{1.5f, 1.5f, 1.5f, 3.0f}));
}

TEST(Combine, m_between_0_and_t_stays_between_0_and_tau) {
    const Engine engine;
    for (std::uint64_t seed : {1, 2, 3}) {
        Samples draw(seed);
        Moments s(engine, 100'000);
        for (int k = 0; k < 8; ++k) {
            const auto t = floats(s.size(), [&] { return draw.lognormal(2); });
            auto m = t;
            for (auto& x : m) x = draw.uniform() < 0.8 ? x : x * static_cast<float>(draw.uniform());
            s.add(m, t);
        }
        const float tau = 0.7f;
        std::size_t outside = 0;
        for (const float x : combine(s, tau).estimate) outside += x < 0 || x > tau * (1 + 0x1p-23f);
        EXPECT_EQ(outside, 0u);
    }
}

// Whole vectors that begin on a multiple of 64 bytes go past the caches; one element further none does.
TEST(Combine, large_results_past_the_caches_have_the_bits_of_others) {
    constexpr std::uint64_t count = (1u << 20) + 37;
    const Engine engine;
    const Pair p = make_pair_of(2, count), other = make_pair_of(3, count);
    Moments s(engine, count);
    s.add(p.m, p.t);
    s.add(other.m, other.t);
    const Buffer tau = Buffer::from_host(engine, std::as_bytes(std::span(p.tau)));
    const auto read_out = [&](std::uint64_t offset) {
        std::vector<float> both;
        std::vector<float> untouched(count + 1, -7.0f);
        const Buffer value = Buffer::copy_of(engine, std::as_bytes(std::span(untouched))),
                     error = Buffer::copy_of(engine, std::as_bytes(std::span(untouched)));
        wait(
            Event(combine(s, {tau.mem(), 0, count}, {{value.mem(), offset, count}, {error.mem(), offset, count}, nullptr})));
        for (const Buffer& from : {value, error}) {
            std::vector<float> got(count + 1);
            from.read(std::as_writable_bytes(std::span(got)));
            EXPECT_EQ(got[offset == 0 ? count : 0], -7.0f);
            both.insert(both.end(), got.begin() + static_cast<std::ptrdiff_t>(offset),
                        got.begin() + static_cast<std::ptrdiff_t>(offset + count));
        }
        return bits(both);
    };
    const auto past = read_out(0), into = read_out(1);
    EXPECT_TRUE(past == into);
    EXPECT_FALSE(read_out(0) == bits(std::vector<float>(2 * count, -7.0f))) << "the planted fault: nothing was written";
}

TEST(Combine, zero_tau_takes_the_impulse_guard) {
    const Engine engine;
    const std::vector<float> m{3, 0, 3}, t{2, 0, -1}, tau{0, 0, 0};
    const Combined out = combine(engine, m, t, Tau(std::span<const float>(tau)));
    EXPECT_EQ(out.estimate[0], 1.0f);  // 3 / (2 + 1)
    EXPECT_EQ(out.estimate[1], 0.0f);
    EXPECT_EQ(out.estimate[2], 3.0f);  // t + 1 == 0: the plain mean
    EXPECT_EQ(out.flag_image[0], CLR_FLAG_ZERO_TAU);
    EXPECT_EQ(out.flag_image[2], CLR_FLAG_ZERO_TAU | CLR_FLAG_ZERO_DENOMINATOR);
}

TEST(Combine, zero_policies_of_the_mean_of_ratios_count_batches) {
    const Engine engine;
    Moments s(engine, 1, {.ratios = true});
    for (const auto& [m, t] : {std::pair{1.0f, 2.0f}, {3.0f, 0.0f}, {0.0f, 0.0f}, {3.0f, 4.0f}})
        s.add(std::span(&m, 1), std::span(&t, 1));
    const auto with = [&](Zero zero) {
        return combine(s, 2.0f, {.estimator = Estimator::mean_of_ratios, .zero = zero}).estimate[0];
    };
    EXPECT_EQ(with(Zero::zero), (1.0f + 0 + 0 + 1.5f) / 4);
    EXPECT_EQ(with(Zero::mc_mean), (1.0f + 3 + 0 + 1.5f) / 4);
    EXPECT_EQ(with(Zero::one), (1.0f + 2 + 2 + 1.5f) / 4);
}

TEST(Combine, no_data_and_nonfinite_values_are_flagged) {
    const Engine engine;
    const std::vector<float> bad{not_a_number, 1}, good{1, 1};
    Moments skip(engine, 2), propagate(engine, 2, {.nonfinite = NonFinite::propagate});
    for (auto* s : {&skip, &propagate}) {
        s->add(bad, good);
        s->add(bad, good);
    }
    const Combined skipped = combine(skip, 1.0f), propagated = combine(propagate, 1.0f);
    EXPECT_EQ(skipped.estimate[0], 0.0f);
    EXPECT_EQ(skipped.flag_image[0], CLR_FLAG_NO_DATA | CLR_FLAG_SKIPPED | CLR_FLAG_NO_ERROR_BAR);
    EXPECT_EQ(skipped.flags.no_data, 1u);
    EXPECT_TRUE(std::isnan(propagated.estimate[0]));
    EXPECT_EQ(propagated.flags.nonfinite, 1u);
    EXPECT_EQ(propagated.flag_image[1], 0u);
}

TEST(Combine, tau_is_a_number_one_a_channel_or_an_image) {
    const Pair p = make_pair_of(1);
    const Engine engine;
    const std::vector<float> each{0.25f, 0.5f, 2.0f};
    std::vector<float> image(values);
    for (std::size_t i = 0; i < values; ++i) image[i] = each[i % 3];
    EXPECT_EQ(bits(combine(engine, p.m, p.t, Tau(each)).estimate),
              bits(combine(engine, p.m, p.t, Tau(std::span<const float>(image))).estimate));
    EXPECT_EQ(bits(combine(engine, p.m, p.t, 0.5f).estimate),
              bits(combine(engine, p.m, p.t, Tau(std::vector<float>{0.5f, 0.5f, 0.5f})).estimate));
    EXPECT_THROW(combine(engine, p.m, p.t, not_a_number), InvalidArgument);
    EXPECT_THROW(combine(engine, p.m, p.t, Tau(std::vector<float>{1, 1})), InvalidArgument);
    EXPECT_THROW(combine(engine, p.m, p.t, Tau(std::span(image).first(5))), InvalidArgument);
}

namespace {

/// SE rule for regroupings: within `ulps`, or both below the rounding noise of the subtraction that makes it.
void expect_same_error(float a, float b, double noise, int ulps, const std::string& name) {
    if (static_cast<double>(a) < noise && static_cast<double>(b) < noise) return;
    EXPECT_LE(std::abs(static_cast<std::int64_t>(std::bit_cast<std::uint32_t>(a)) -
                       static_cast<std::int64_t>(std::bit_cast<std::uint32_t>(b))),
              ulps)
        << name << ": " << a << " and " << b;
}

struct HardCase {
    const char* name;
    void (*draw)(Samples&, float& m, float& t);
};

const HardCase hard_cases[] = {
    {"m signed, mean 1e-4, sd 1",
     [](Samples& s, float& m, float& t) {
         t = static_cast<float>(s.lognormal(0.5));
         m = static_cast<float>(1e-4 + s.normal());
     }},
    {"m = .3 t (1 + 1e-3 z)",
     [](Samples& s, float& m, float& t) {
         t = static_cast<float>(s.lognormal(0.5));
         m = static_cast<float>(0.3 * static_cast<double>(t) * (1 + 1e-3 * s.normal()));
     }},
    {"m = .3f t",
     [](Samples& s, float& m, float& t) {
         t = static_cast<float>(s.lognormal(0.5));
         m = 0.3f * t;
     }},
    {"m = t", [](Samples& s, float& m, float& t) { m = t = static_cast<float>(s.lognormal(0.5)); }}};

}  // namespace

TEST(Combine, any_grouping_merged_agrees) {
    constexpr std::size_t lanes = 64, batches = 1000;
    const Engine engine;
    for (const auto& hard : hard_cases) {
        Samples draw(1);
        Moments one_by_one(engine, lanes);
        std::vector<Moments> parts;
        for (int k = 0; k < 8; ++k) parts.emplace_back(engine, lanes);
        for (std::size_t k = 0; k < batches; ++k) {
            std::vector<float> m(lanes), t(lanes);
            for (std::size_t i = 0; i < lanes; ++i) hard.draw(draw, m[i], t[i]);
            one_by_one.add(m, t, static_cast<double>(1 + k % 7));
            parts[k * 8 / batches].add(m, t, static_cast<double>(1 + k % 7));
        }
        for (std::size_t k = 1; k < parts.size(); ++k) parts[0].merge(parts[k]);
        const float tau = 1.7f;
        const auto a = combine(one_by_one, tau, {.standard_error = true});
        const auto b = combine(parts[0], tau, {.standard_error = true});
        const auto plain = combine(one_by_one, tau, {.estimator = Estimator::mean, .standard_error = true});
        const auto t_bits = one_by_one.bits(&StatePlanes::t), tt = one_by_one.bits(&StatePlanes::tt);
        for (std::size_t i = 0; i < lanes; ++i) {
            const auto ia = std::bit_cast<std::int32_t>(a.estimate[i]), ib = std::bit_cast<std::int32_t>(b.estimate[i]);
            EXPECT_LE(std::abs(ia - ib), 2) << hard.name;
            const double mean_t = static_cast<double>(std::bit_cast<float>(t_bits[i]));
            const double r = static_cast<double>(plain.estimate[i]) / mean_t;
            const double var_m = std::pow(static_cast<double>(plain.standard_error[i]), 2);
            const double var_t = static_cast<double>(std::bit_cast<float>(tt[i])) / ((batches - 1) * one_by_one.weight());
            const double noise = 1e-6 * static_cast<double>(tau) * std::sqrt(var_m + r * r * var_t) / mean_t;
            expect_same_error(a.standard_error[i], b.standard_error[i], noise, 3, hard.name);
        }
    }
}

namespace {

/// Means and error bars of many values at once, for batches whose means have variance 1 / weight.
struct Weighted {
    double variance_of_mean = 0, mean_of_squared_error = 0;
};

Weighted simulate(const Engine& engine, const std::vector<double>& weights, std::size_t lanes) {
    Samples draw(1);
    Moments s(engine, lanes);
    for (const double w : weights) {
        const auto m = floats(lanes, [&] { return 3 + draw.normal() / std::sqrt(w); });
        s.add(m, m, w);
    }
    const auto out = combine(s, 1.0f, {.estimator = Estimator::mean, .standard_error = true});
    Weighted r;
    for (std::size_t i = 0; i < lanes; ++i) {
        r.variance_of_mean += std::pow(static_cast<double>(out.estimate[i]) - 3, 2) / static_cast<double>(lanes);
        r.mean_of_squared_error += std::pow(static_cast<double>(out.standard_error[i]), 2) / static_cast<double>(lanes);
    }
    return r;
}

}  // namespace

// Weights are sample counts: the variance of the mean is 1/W, and M2 / ((K-1) W) has that expectation.
TEST(Combine, error_bars_of_weighted_batches_match_simulation) {
    constexpr std::size_t lanes = 100'000;
    const Engine engine;
    for (const std::vector<double>& weights :
         {std::vector<double>{1, 1, 1, 1, 16, 16, 16, 16}, std::vector<double>{1, 2, 4, 8, 16, 32, 64, 128}}) {
        double sum = 0, squares = 0;
        for (double w : weights) {
            sum += w;
            squares += w * w;
        }
        const Weighted got = simulate(engine, weights, lanes);
        const double n = static_cast<double>(lanes), freedom = static_cast<double>(weights.size() - 1);
        const double z = 5;  // two checks at 6e-7 each
        EXPECT_NEAR(got.variance_of_mean * sum, 1, z * std::sqrt(2 / n));
        const double tolerance = z * std::sqrt(2 / (freedom * n));
        EXPECT_NEAR(got.mean_of_squared_error * sum, 1, tolerance);
        const double second_moment = got.mean_of_squared_error * freedom * sum;
        const double reliability = second_moment / (sum - squares / sum) * squares / (sum * sum);
        EXPECT_GT(std::fabs(reliability * sum - 1), tolerance) << "planted fault: the reliability form";
    }
}

namespace {

void run_every_kernel(const EngineOptions& options) {
    const Engine engine(options);
    const Pair p = make_pair_of(1, 13);
    Moments a(engine, 13, {.ratios = true}), b(engine, 13, {.ratios = true});
    a.add(p.m, p.t);
    b.add(p.m, p.t, 2);
    a.merge(b);
    Moments strict(engine, 13, {.nonfinite = NonFinite::fail});
    strict.add(p.m, p.t);
    EXPECT_EQ(combine(a, 1.0f, {.standard_error = true}).estimate.size(), 13u);
    EXPECT_EQ(combine(engine, p.m, p.t, 1.0f).estimate.size(), 13u);
    EXPECT_TRUE(engine.self_test());
}

}  // namespace

// oclgrind reports neither correctly rounded division nor fma: there the self-test stands in for them.
TEST(CombineSmall, every_kernel) {
    using Path = EngineOptions::Path;
    const auto same_bits = Require::same_bits;
    run_every_kernel({.require = same_bits, .width = 4, .path = Path::ranges, .work_items = 2, .disk_cache = false});
    run_every_kernel({.require = same_bits, .width = 1, .path = Path::groups, .work_items = 4, .disk_cache = false});
}

// The planted fault: an output three elements short. Never run but under oclgrind.
TEST(CombineSmall, DISABLED_a_store_out_of_bounds) {
    const Engine engine({.width = 4, .path = EngineOptions::Path::ranges, .work_items = 1, .disk_cache = false});
    const Buffer in = Buffer::zeroed(engine, 8 * sizeof(float)), out(engine, 5 * sizeof(float));
    const View view{in.mem(), 0, 8};
    wait(Launch(engine, "combine", "clr_combine")
             .view(view)
             .view(view)
             .view(view)
             .view({out.mem(), 0, 8})
             .arg(cl_mem{})
             .arg(cl_mem{})
             .arg(CLR_ZERO_MC_MEAN)
             .run_ranges(8));
}

TEST(Combine, kernels_are_clean_under_oclgrind) { expect_clean_under_oclgrind("combine_test", "CombineSmall.*"); }

TEST(Combine, oclgrind_sees_a_store_out_of_bounds) {
    const auto report =
        under_oclgrind("combine_test", "CombineSmall.DISABLED_a_store_out_of_bounds", "--gtest_also_run_disabled_tests");
    if (!report) GTEST_SKIP() << "oclgrind is not installed (Debian: apt install oclgrind)";
    EXPECT_GT(report->complaints(), 0) << report->output;
}
