#include "clratio/estimator.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "clratio/combine.hpp"
#include "support/grouped.hpp"
#include "support/oclgrind.hpp"
#include "support/refused.hpp"
#include "support/samples.hpp"
#include "support/shapes.hpp"
#include "support/theory.hpp"
#include "support/twin.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

constexpr double z95 = 1.959963984540054;

/// Contiguous groups of equal size, as the vectors form them.
std::vector<Statistics> grouped(const std::vector<double>& m, const std::vector<double>& t, std::size_t groups) {
    std::vector<Statistics> all(groups);
    for (std::size_t i = 0; i < m.size(); ++i) all[i * groups / m.size()].add(m[i], t[i]);
    return all;
}

void expect_close(double got, double want, const std::string& what, double tolerance = 1e-12) {
    EXPECT_NEAR(got, want, tolerance * std::max(std::fabs(want), 1e-300)) << what;
}

Statistics statistics_of(const nlohmann::json& v) {
    return {v["w"], v["w"], v["w2"], v["mean_m"], v["mean_t"], v["M2m"], v["M2t"], v["Cmt"], 0};
}

}  // namespace

TEST(Estimator, reference_matches_the_vectors) {
    int variants = 0, told_apart = 0;
    for (const auto& v : theory("ratio_variants")) {
        const auto m = v.at("m").get<std::vector<double>>(), t = v.at("t").get<std::vector<double>>();
        const double tau = v.at("tau");
        const auto& want = v.at("out");
        const std::string note = v.at("note");
        // Differences that cancel to nothing are judged on the scale of what they are made of.
        const auto check = [&](const char* name, double got, double scale = 0) {
            if (!want.contains(name)) return;
            const double x = want.at(name);
            EXPECT_NEAR(got, x, 1e-12 * std::max(std::fabs(x), scale)) << note << ": " << name;
            ++variants;
        };
        const auto one = grouped(m, t, 1);
        const Statistics& s = one[0];
        check("R", estimate(one, Estimator::ratio, tau));
        check("hartley_ross", estimate(one, Estimator::hartley_ross, tau));
        check("mean_of_ratios", estimate(one, Estimator::mean_of_ratios, tau));
        check("beale", estimate(one, Estimator::beale, tau));
        check("tin", estimate(one, Estimator::tin, tau));
        if (want.contains("tin"))
            told_apart += std::fabs(estimate(one, Estimator::beale, tau) / want.at("tin").get<double>() - 1) > 1e-12;
        check("reg", estimate(one, Estimator::regression, tau));
        check("beta", s.c_mt / s.m2_t);
        const double r = s.mean_m / s.mean_t, of_mean = (s.m2_m + r * r * s.m2_t) * s.scale();
        check("bias_est", bias_of_ratio(s, tau), std::fabs(tau * r * s.m2_t * s.scale() / (s.mean_t * s.mean_t)));
        if (want.contains("var_delta")) {
            const double error = standard_error(one, Estimator::ratio, tau), slope = tau / s.mean_t;
            check("var_delta", error * error, of_mean * slope * slope);
            const double reg = standard_error(one, Estimator::regression, tau);
            check("var_reg", reg * reg, of_mean);
            const Interval delta = delta_interval(s, tau, z95), fieller = fieller_interval(s, tau, z95);
            const double width = std::sqrt(of_mean) * std::fabs(slope);
            EXPECT_NEAR(delta.lower, want["ci_delta"][0].get<double>(), 1e-7 * width) << note;
            EXPECT_NEAR(delta.upper, want["ci_delta"][1].get<double>(), 1e-7 * width) << note;
            const std::string kind = want.at("fieller_kind");
            EXPECT_EQ(kind, fieller.kind == IntervalKind::bounded     ? "bounded"
                            : fieller.kind == IntervalKind::exclusive ? "exclusive"
                                                                      : "whole line")
                << note;
            if (want["ci_fieller"].is_array()) {
                EXPECT_NEAR(fieller.lower, want["ci_fieller"][0].get<double>(), 1e-7 * width) << note;
                EXPECT_NEAR(fieller.upper, want["ci_fieller"][1].get<double>(), 1e-7 * width) << note;
            }
        }
        for (const auto& [name, groups] : {std::pair{"2", std::size_t{2}}, {"4", 4}, {"loo", m.size()}}) {
            if (m.size() % groups != 0) continue;
            const auto all = grouped(m, t, groups);
            check(("jack_" + std::string(name)).c_str(), estimate(all, Estimator::jackknife, tau));
            check(("mickey_" + std::string(name)).c_str(), estimate(all, Estimator::mickey, tau));
            const double error = standard_error(all, Estimator::jackknife, tau);
            check(("jackvar_" + std::string(name)).c_str(), error * error, of_mean * tau * tau / (s.mean_t * s.mean_t));
        }
    }
    EXPECT_GT(variants, 80);
    EXPECT_GE(told_apart, 4) << "planted fault: Beale's estimate in the place of Tin's";
}

TEST(Estimator, reference_merges_as_the_vectors) {
    int merges = 0, caught = 0;
    for (const auto& v : theory("chan_merge")) {
        Statistics a = statistics_of(v.at("A"));
        const Statistics b = statistics_of(v.at("B")), want = statistics_of(v.at("merged"));
        // The means come rounded to double: by 2^-53 of the offset each, which shifts their distance and what it adds.
        const double largest = std::max({std::fabs(want.mean_m), std::fabs(want.mean_t), std::fabs(a.mean_m),
                                         std::fabs(a.mean_t), std::fabs(b.mean_m), std::fabs(b.mean_t)});
        const double spread = a.weight * b.weight / want.weight, shift = 0x1p-52 * largest;
        const double apart = std::fabs(b.mean_m - a.mean_m) + std::fabs(b.mean_t - a.mean_t);
        const double rounded = 2 * spread * shift * (apart + shift);
        const double between = (b.mean_m - a.mean_m) * (b.mean_m - a.mean_m) * spread;
        a.merge(b);
        // A mean of values around an offset is a double near that offset.
        const double offset = std::max(std::fabs(want.mean_m), std::fabs(want.mean_t));
        expect_close(a.weight, want.weight, "weight");
        expect_close(a.weight2, want.weight2, "weight2");
        EXPECT_NEAR(a.mean_m, want.mean_m, 1e-12 * std::max(1.0, offset));
        EXPECT_NEAR(a.mean_t, want.mean_t, 1e-12 * std::max(1.0, offset));
        EXPECT_NEAR(a.m2_m, want.m2_m, rounded + 1e-12 * want.m2_m);
        EXPECT_NEAR(a.m2_t, want.m2_t, rounded + 1e-12 * want.m2_t);
        EXPECT_NEAR(a.c_mt, want.c_mt, rounded + 1e-12 * std::fabs(want.c_mt));
        caught += std::fabs(a.m2_m - between - want.m2_m) > rounded + 1e-12 * want.m2_m;
        ++merges;
    }
    EXPECT_GE(merges, 7);
    EXPECT_GE(caught, 5) << "planted fault: the distance of the means is left out";
}

TEST(Estimator, expansion_matches_the_vectors) {
    for (const auto& v : theory("delta_method")) {
        const double mu = v["mu"], x = v["sm"].get<double>() / mu, y = v["st"].get<double>() / v["tau"].get<double>();
        const RelativeMoments c{x * x, v["rho"].get<double>() * x * y, y * y, v["C21"], v["C12"], v["C03"]};
        const Expansion got = expand_ratio(c, v["N"]);
        expect_close(mu * got.bias, v["bias"], v.dump());
        expect_close(mu * mu * got.variance, v["var"], v.dump());
        EXPECT_NEAR(got.mse, got.variance + std::pow((y * y - c.c11) / v["N"].get<double>(), 2), 1e-12);
    }
}

TEST(Estimator, student_quantiles_are_right_and_checked) {
    expect_close(student_quantile(0.95, 1), std::tan(0.475 * 3.14159265358979323846), "Cauchy");
    expect_close(student_quantile(0.95, 1e12), z95, "the normal limit", 1e-11);
    refused([] { student_quantile(1, 3); }, "level");
    refused([] { student_quantile(0.5, 0); }, "freedom");
}

// ---- the device

namespace {

CombineOptions all_of(Estimator e, IntervalMethod method = IntervalMethod::fieller) {
    CombineOptions o{.estimator = e};
    o.standard_error = e != Estimator::mean_of_ratios;
    o.bias = o.interval = o.gain = o.needed = true;
    o.method = method;
    o.relative_target = 0.01f;
    return o;
}

MomentsOptions with_weights(bool reliability) {
    MomentsOptions o = everything;
    if (reliability) o.weights = Weights::reliability;
    return o;
}

/// Estimates come out of at most a dozen float operations on numbers no larger than the estimate and 8 of its errors: 2^-24
/// each. Slopes of the cross-fit have a bound of their own.
double allowed(std::span<const Statistics> groups, Estimator e, double tau) {
    const double size =
        std::fabs(estimate(groups, Estimator::ratio, tau)) + 8 * standard_error(groups, Estimator::ratio, tau);
    return 12 * 0x1p-24 * size + (e == Estimator::crossfit_regression ? crossfit_bound(groups, tau) : 0);
}

/// Over all values: the largest |got - want| over what is allowed, and the largest relative error of the error bar.
struct Worst {
    double value = 0, error = 0;
};

Worst worst_of(const GroupedInput& in, const Combined& out, Estimator e, Estimator oracle, bool reliability) {
    Worst worst;
    for (std::size_t i = 0; i < values; ++i) {
        const auto groups = reference(in, i);
        const double tau = static_cast<double>(taus[i]);
        const double want = estimate(groups, oracle, tau, reliability);
        const double error = standard_error(groups, oracle, tau, reliability);
        const double off = std::fabs(static_cast<double>(out.estimate[i]) - want);
        worst.value = std::max(worst.value, off / allowed(groups, e, tau));
        if (e != Estimator::mean_of_ratios)
            worst.error = std::max(worst.error, std::fabs(static_cast<double>(out.standard_error[i]) / error - 1));
    }
    return worst;
}

}  // namespace

// Errors are roots of differences of second moments in two-float, then five float operations: 4 ulp.
TEST(Estimator, device_matches_the_reference_in_double) {
    const Engine engine;
    for (const std::uint64_t seed : {1, 2, 3, 4}) {
        const bool reliability = seed == 4;
        const GroupedInput in = input_of(seed);
        const Moments s = moments_of(engine, in, with_weights(reliability));
        for (const Estimator e : all_estimators()) {
            const Combined out = combine(s, Tau(std::span<const float>(taus)), all_of(e));
            const Worst worst = worst_of(in, out, e, e, reliability);
            EXPECT_LE(worst.value, 1) << name_of(e) << " seed " << seed;
            EXPECT_LE(worst.error, 8 * 0x1p-24) << name_of(e) << " seed " << seed;
            if (e == Estimator::ratio) continue;
            EXPECT_GT(worst_of(in, out, e, Estimator::ratio, reliability).value, 1)
                << "planted fault: the ratio in place of " << name_of(e);
            if (e != Estimator::hartley_ross) continue;
            EXPECT_GT(worst_of(in, out, e, Estimator::ratio, reliability).error, 8 * 0x1p-24)
                << "planted fault: the error bar of the ratio";
        }
        for (const Estimator e : {Estimator::beale, Estimator::tin}) {
            const Combined out = combine(s, Tau(std::span<const float>(taus)), all_of(e));
            const Worst other = worst_of(in, out, e, e, !reliability);
            EXPECT_GT(other.value, 1) << "planted fault: weights of the other kind";
            EXPECT_GT(other.error, 8 * 0x1p-24) << "planted fault: weights of the other kind";
        }
    }
}

TEST(Estimator, device_bias_gain_and_need_match_the_reference) {
    const Engine engine;
    const GroupedInput in = input_of(1);
    for (const bool reliability : {false, true}) {
        const Combined out = combine(moments_of(engine, in, with_weights(reliability)), Tau(std::span<const float>(taus)),
                                     all_of(Estimator::ratio));
        std::size_t caught = 0;
        for (std::size_t i = 0; i < values; ++i) {
            Statistics s;
            for (const auto& g : reference(in, i)) s.merge(g);
            const double tau = static_cast<double>(taus[i]), r = s.mean_m / s.mean_t;
            const double part = tau * r * s.m2_t * s.scale(reliability) / (s.mean_t * s.mean_t);
            const double bias = static_cast<double>(out.bias[i]);
            EXPECT_NEAR(bias, bias_of_ratio(s, tau, reliability), 8 * 0x1p-24 * part);
            caught += std::fabs(bias - bias_of_ratio(s, tau, !reliability)) > 8 * 0x1p-24 * part;
            const double gain = (s.m2_m - r * (2 * s.c_mt - r * s.m2_t)) / s.m2_m;
            EXPECT_NEAR(static_cast<double>(out.gain[i]), gain, 8 * 0x1p-24 * gain);
            const double excess = static_cast<double>(out.standard_error[i]) / (0.01 * static_cast<double>(out.estimate[i]));
            EXPECT_NEAR(static_cast<double>(out.needed[i]), batch_count * (excess * excess - 1),
                        1e-6 * batch_count * excess * excess);
        }
        EXPECT_GT(caught, values / 2) << "planted fault: weights of the other kind";
    }
}

TEST(Estimator, device_intervals_match_the_reference) {
    const Engine engine;
    for (const auto& [batches, reliability] :
         std::vector<std::pair<std::size_t, bool>>{{3, false}, {4, false}, {8, false}, {23, false}, {4, true}, {23, true}}) {
        const GroupedInput in = input_of(2, batches);
        const Moments s = moments_of(engine, in, with_weights(reliability));
        const double q = student_quantile(0.95, static_cast<double>(batches - 1));
        const Combined delta =
            combine(s, Tau(std::span<const float>(taus)), all_of(Estimator::ratio, IntervalMethod::delta));
        const Combined fieller = combine(s, Tau(std::span<const float>(taus)), all_of(Estimator::ratio));
        std::size_t kinds[3] = {0, 0, 0}, caught = 0, compared = 0, caught_fieller = 0;
        for (std::size_t i = 0; i < values; ++i) {
            Statistics all;
            for (const auto& g : reference(in, i)) all.merge(g);
            const double tau = static_cast<double>(taus[i]);
            const Interval d = delta_interval(all, tau, q, reliability), f = fieller_interval(all, tau, q, reliability);
            const double width = d.upper - d.lower + std::fabs(d.upper);
            EXPECT_NEAR(static_cast<double>(delta.lower[i]), d.lower, 16 * 0x1p-24 * width);
            EXPECT_NEAR(static_cast<double>(delta.upper[i]), d.upper, 16 * 0x1p-24 * width);
            const double other = delta_interval(all, tau, q, !reliability).upper;
            caught += std::fabs(static_cast<double>(delta.upper[i]) - other) > 16 * 0x1p-24 * width;
            ++kinds[fieller.kind[i]];
            // Near g = 1 the ends run off to infinity: their error is that of 1 - g.
            const double g = q * q * all.m2_t * all.scale(reliability) / (all.mean_t * all.mean_t);
            const double condition = (1 + g) / std::fabs(1 - g);
            if (condition > 1e4) continue;
            ASSERT_EQ(fieller.kind[i], static_cast<std::uint32_t>(f.kind)) << batches << " batches, value " << i;
            if (f.kind == IntervalKind::whole_line) {
                EXPECT_EQ(fieller.upper[i], std::numeric_limits<float>::infinity());
                continue;
            }
            const double size = condition * (std::fabs(f.lower) + std::fabs(f.upper) + width);
            EXPECT_NEAR(static_cast<double>(fieller.lower[i]), f.lower, 32 * 0x1p-24 * size);
            EXPECT_NEAR(static_cast<double>(fieller.upper[i]), f.upper, 32 * 0x1p-24 * size);
            ++compared;
            const double of_other = fieller_interval(all, tau, q, !reliability).upper;
            caught_fieller += !(std::fabs(static_cast<double>(fieller.upper[i]) - of_other) <= 32 * 0x1p-24 * size);
        }
        EXPECT_GT(kinds[0], 0u);
        EXPECT_GT(caught, values / 2) << "planted fault: weights of the other kind";
        EXPECT_GT(caught_fieller, compared / 2) << "planted fault: weights of the other kind";
        if (batches == 3) {
            EXPECT_GT(kinds[1] + kinds[2], 0u) << "no unbounded interval was tried";
        }
    }
}

TEST(Estimator, device_has_the_twins_bits_at_every_shape) {
    GroupedInput in = with_fireflies(input_of(3, 11));
    in.m[4][9] = in.t[7][300] = std::numeric_limits<float>::quiet_NaN();
    std::vector<std::vector<TwinValue>> twin;
    for (std::size_t i = 0; i < values; ++i) twin.push_back(twins(in, i));
    for (const auto& shape : all_shapes()) {
        const Moments s = moments_of(Engine(shape.options), in, everything);
        for (const Estimator e : all_estimators()) {
            const CombineOptions options = all_of(e, IntervalMethod::delta);
            const Combined out = combine(s, Tau(std::span<const float>(taus)), options);
            device::clr_question ask{};
            ask.estimator = static_cast<std::uint32_t>(e);
            ask.interval = CLR_INTERVAL_DELTA;
            ask.relative_target = options.relative_target;
            ask.outputs = 511;
            const bool regresses = e == Estimator::regression || e == Estimator::crossfit_regression;
            std::size_t differ = 0;
            const auto same = [](float a, float b) {
                return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
            };
            for (std::size_t i = 0; i < values; ++i) {
                const auto trials = device::clr_trials(join_twin(twin[i], taus[i], ask), taus[i], ask);
                const auto q = static_cast<float>(student_quantile(0.95, trials - (regresses ? 2.0 : 1.0)));
                const auto want = read_twin(twin[i], taus[i], ask, q);
                differ += !same(out.estimate[i], want.value) || !same(out.bias[i], want.bias) ||
                          !same(out.lower[i], want.lower) || !same(out.upper[i], want.upper) ||
                          !same(out.gain[i], want.gain) || !same(out.needed[i], want.needed) || out.kind[i] != want.kind ||
                          out.flag_image[i] != want.flags;
                if (options.standard_error) differ += !same(out.standard_error[i], want.error);
            }
            ASSERT_EQ(differ, 0u) << shape.name << ", " << name_of(e);
            EXPECT_EQ(out.flags.skipped, 2u);
        }
    }
}

// A program for one estimator leaves out what it does not need, and nothing else.
TEST(Estimator, programs_of_one_estimator_have_the_bits_of_the_general_one) {
    const Moments s = moments_of(Engine{}, input_of(1), everything);
    for (const Estimator e : all_estimators()) {
        const CombineOptions general = all_of(e);
        const CombineOptions one{.estimator = e, .standard_error = general.standard_error};
        const Combined a = combine(s, Tau(std::span<const float>(taus)), general);
        const Combined b = combine(s, Tau(std::span<const float>(taus)), one);
        EXPECT_EQ(a.estimate, b.estimate) << name_of(e);
        EXPECT_EQ(a.standard_error, b.standard_error) << name_of(e);
    }
}

TEST(Estimator, too_few_batches_fall_back_and_say_so) {
    const Engine engine;
    const GroupedInput in = input_of(2, 1);
    const Moments s = moments_of(engine, in, everything);
    const auto read = [&](Estimator e) { return combine(s, Tau(std::span<const float>(taus)), {.estimator = e}); };
    const Combined ratio = read(Estimator::ratio), mean = read(Estimator::mean);
    for (const Estimator e : {Estimator::beale, Estimator::tin, Estimator::hartley_ross, Estimator::jackknife,
                              Estimator::mickey, Estimator::regression, Estimator::crossfit_regression}) {
        const Combined out = read(e);
        const bool regresses = e == Estimator::regression || e == Estimator::crossfit_regression;
        EXPECT_EQ(out.estimate, regresses ? mean.estimate : ratio.estimate) << name_of(e);
        EXPECT_EQ(out.flags.fell_back, values) << name_of(e);
    }
    EXPECT_EQ(ratio.flags.fell_back, 0u);
}

TEST(Estimator, gain_of_a_constant_m_is_infinite_where_t_varies) {
    const Engine engine;
    Moments s(engine, 4);
    for (const float x : {1.0f, 2.0f, 4.0f}) {
        const std::vector<float> m{1, 1, x, 0}, t{x, 1, 1, x};
        s.add(m, t);
    }
    const float infinite = std::numeric_limits<float>::infinity();
    EXPECT_EQ(combine(s, 1.0f, {.gain = true}).gain, (std::vector<float>{infinite, 1, 1, 1})) << "the last m is 0";
}

TEST(Estimator, no_residual_spread_is_flagged_with_an_interval_and_with_need) {
    const Engine engine;
    Samples draw(1);
    Moments s(engine, 2);
    for (int k = 0; k < 5; ++k) {
        const auto t = static_cast<float>(draw.lognormal(1));
        const std::vector<float> m{t, t * static_cast<float>(draw.uniform())}, control{t, t};
        s.add(m, control);
    }
    const Combined out = combine(s, 1.0f, {.interval = true, .method = IntervalMethod::delta});
    EXPECT_EQ(out.flag_image[0], CLR_FLAG_NO_SPREAD);
    EXPECT_EQ(out.flag_image[1], 0u);
    EXPECT_EQ(combine(s, 1.0f, {.needed = true, .target = .1f}).flag_image, out.flag_image);
    EXPECT_EQ(out.lower[0], 1.0f);
    EXPECT_EQ(out.upper[0], 1.0f);
}

// theory.md 4: with weights that are not sample counts, batches of one variance.
TEST(Estimator, reliability_weights_have_their_own_error_bar) {
    constexpr std::size_t lanes = 100'000;
    const Engine engine;
    const std::vector<double> weights{1, 1, 1, 1, 16, 16, 16, 16};
    for (const bool skip : {false, true}) {
        Samples draw(2);
        const auto make = [&](Weights w) {
            return Moments(engine, lanes, {.nonfinite = skip ? NonFinite::skip : NonFinite::propagate, .weights = w});
        };
        Moments reliable = make(Weights::reliability), counted = make(Weights::samples);
        for (const double w : weights) {
            const auto m = floats(lanes, [&] { return draw.normal(); });
            const std::vector<float> t(lanes, 1);
            reliable.add(m, t, w);
            counted.add(m, t, w);
        }
        const auto squared_error = [](const Moments& s) {
            const Combined out = combine(s, 1.0f, {.estimator = Estimator::mean, .standard_error = true});
            double sum = 0;
            for (const float e : out.standard_error) sum += static_cast<double>(e) * static_cast<double>(e);
            return sum / static_cast<double>(lanes);
        };
        // The variance of sum w x / W is sum w^2 / W^2; seven degrees of freedom at most, four at least.
        const double truth = (4 * 1 + 4 * 256.0) / (68.0 * 68.0), tolerance = 5 * std::sqrt(2 / (3.0 * lanes));
        EXPECT_NEAR(squared_error(reliable) / truth, 1, tolerance);
        EXPECT_GT(std::fabs(squared_error(counted) / truth - 1), tolerance) << "planted fault: sample counts";
    }
}

// theory.md 3.2: the sum is linear in m with coefficients of at least 0. Slow: 10^8 states.
namespace {
std::size_t outside(const Engine& engine, std::uint64_t seed, std::size_t lanes, std::size_t batches, Estimator e) {
    Samples draw(seed);
    Moments s(engine, lanes, {.nonfinite = NonFinite::propagate});
    for (std::size_t k = 0; k < batches; ++k) {
        const auto t = floats(lanes, [&] { return draw.lognormal(2); });
        auto m = t;
        for (auto& x : m) {
            const double u = draw.uniform();
            x = u < 0.6 ? x : u < 0.8 ? 0 : x * static_cast<float>(draw.uniform());
        }
        s.add(m, t);
    }
    const float tau = 0.7f;
    std::size_t count = 0;
    for (const float x : combine(s, tau, {.estimator = e}).estimate) count += x < 0 || x > tau * (1 + 0x1p-23f);
    return count;
}
}  // namespace

TEST(Estimator, ratio_and_beale_stay_between_0_and_tau) {
    const Engine engine;
    for (const std::uint64_t seed : {1, 2, 3})
        for (const std::size_t batches : {2, 3, 8}) {
            EXPECT_EQ(outside(engine, seed, 100'000, batches, Estimator::ratio), 0u);
            EXPECT_EQ(outside(engine, seed, 100'000, batches, Estimator::beale), 0u);
            EXPECT_GT(outside(engine, seed, 100'000, batches, Estimator::tin), 0u)
                << "planted fault: an estimator that leaves";
        }
}

TEST(Estimator, SlowRatio_and_beale_of_10_to_8_states_stay_between_0_and_tau) {
    const Engine engine;
    for (std::uint64_t seed = 1; seed <= 25; ++seed)
        for (const std::size_t batches : {2, 5}) {
            EXPECT_EQ(outside(engine, seed, 2'000'000, batches, Estimator::ratio), 0u);
            EXPECT_EQ(outside(engine, seed, 2'000'000, batches, Estimator::beale), 0u);
        }
}

TEST(Estimator, misuse_is_refused_by_name) {
    const Engine engine;
    Moments plain(engine, 4);
    const std::vector<float> x(4, 1);
    plain.add(x, x);
    const auto read = [&](CombineOptions o) { combine(plain, 1.0f, o); };
    refused([&] { read({.estimator = Estimator::hartley_ross}); }, "hartley-ross: make the Moments with .ratios = true");
    refused([&] { read({.estimator = Estimator::jackknife}); }, "jackknife: make the Moments with .groups of 2 to 16");
    refused([&] { read({.interval = true, .level = 1}); }, "level");
    refused([&] { read({.needed = true, .target = -1}); }, "target");
    refused(
        [&] {
            read({
                .estimator = Estimator::mean_of_ratios,
                .standard_error = true,
            });
        },
        "mean-of-ratios");
    refused([&] { Moments(engine, 4, {.groups = 17}); }, "groups: expected 1 to 16, got 17");
    refused([&] { Moments(engine, 4, {.groups = 0}); }, "groups");
    Moments other(engine, 4, {.groups = 2});
    refused([&] { plain.merge(other); }, "the same options");
}

TEST(EstimatorSmall, every_estimator) {
    using Path = EngineOptions::Path;
    GroupedInput in = input_of(1, 3);
    for (auto* of : {&in.m, &in.t})
        for (auto& v : *of) v.resize(13);
    for (const EngineOptions& options :
         {EngineOptions{.width = 4, .path = Path::ranges, .work_items = 2, .disk_cache = false},
          EngineOptions{.width = 1, .path = Path::groups, .work_items = 4, .disk_cache = false}}) {
        Moments s(Engine(options), 13, {.ratios = true, .groups = 2});
        for (std::size_t k = 0; k < 3; ++k) s.add(in.m[k], in.t[k]);
        for (const Estimator e : all_estimators()) EXPECT_EQ(combine(s, 1.0f, all_of(e)).estimate.size(), 13u);
        Moments two(Engine(options), 13, {.groups = 2});  // neither slope is told by one batch: the others are asked
        for (std::size_t k = 0; k < 2; ++k) two.add(in.m[k], in.t[k]);
        EXPECT_EQ(combine(two, 1.0f, all_of(Estimator::crossfit_regression)).estimate.size(), 13u);
    }
}

TEST(Estimator, kernels_are_clean_under_oclgrind) { expect_clean_under_oclgrind("estimator_test", "EstimatorSmall.*"); }
