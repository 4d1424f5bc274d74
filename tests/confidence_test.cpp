// Error bars and intervals where they are easily wrong: other degrees of freedom, extreme weights and scales, batches that
// agree, nothing known.
#include <gtest/gtest.h>

#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>

#include "clratio/combine.hpp"
#include "support/grouped.hpp"
#include "support/refused.hpp"
#include "support/samples.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

constexpr float infinite = std::numeric_limits<float>::infinity();

CombineOptions with_everything(Estimator e, IntervalMethod method) {
    CombineOptions o{.estimator = e, .standard_error = true, .bias = true, .interval = true, .gain = true, .needed = true};
    o.method = method;
    o.relative_target = 0.01f;
    return o;
}

Combined read(const GroupedInput& in, const CombineOptions& options, MomentsOptions state = everything) {
    return combine(moments_of(Engine{}, in, state), Tau(std::span<const float>(taus)), options);
}

double widths_in_errors(const Combined& out, std::size_t i) {
    return static_cast<double>((out.upper[i] - out.lower[i]) / (2 * out.standard_error[i]));
}

/// One value from one list of m and one of t.
Combined read_one(const std::vector<float>& m, const std::vector<float>& t, float tau, const CombineOptions& options,
                  MomentsOptions state = {.ratios = true, .groups = 2}) {
    Moments s(Engine{}, 1, state);
    for (std::size_t k = 0; k < m.size(); ++k) s.add({&m[k], 1}, {&t[k], 1});
    return combine(s, tau, options);
}

}  // namespace

// The jackknife's own error is made of as many numbers as there are groups. Width and error are rounded: 2^-22 of each.
TEST(Confidence, the_jackknife_counts_groups) {
    for (const std::size_t batches : {3, 23, 40}) {
        const auto groups = static_cast<double>(std::min<std::size_t>(batches, group_count));
        const Combined out = read(input_of(1, batches), with_everything(Estimator::jackknife, IntervalMethod::delta));
        const double want = student_quantile(0.95, groups - 1);
        for (std::size_t i = 0; i < values; ++i) {
            if (out.flag_image[i] & (CLR_FLAG_FELL_BACK | CLR_FLAG_NO_SPREAD)) continue;
            const double room =
                0x1p-22 * want * (1 + std::fabs(static_cast<double>(out.estimate[i] / out.standard_error[i])));
            EXPECT_NEAR(widths_in_errors(out, i), want, room) << batches << " batches, value " << i;
        }
        if (batches == 23) {
            EXPECT_GT(want, 1.3 * student_quantile(0.95, 22)) << "planted fault: batches counted";
        }
    }
}

TEST(Confidence, fieller_is_the_ratios_whatever_the_estimator) {
    const GroupedInput in = input_of(2, 6);
    const Combined ratio = read(in, with_everything(Estimator::ratio, IntervalMethod::fieller));
    for (const Estimator e : {Estimator::mean, Estimator::regression, Estimator::hartley_ross}) {
        const Combined out = read(in, with_everything(e, IntervalMethod::fieller));
        EXPECT_EQ(out.lower, ratio.lower) << name_of(e);
        EXPECT_EQ(out.upper, ratio.upper) << name_of(e);
        EXPECT_EQ(out.kind, ratio.kind) << name_of(e);
    }
    CombineOptions wider = with_everything(Estimator::ratio, IntervalMethod::fieller);
    wider.level = 1 - 2 * (1 - boost::math::cdf(boost::math::students_t(5), student_quantile(0.95, 4)));
    EXPECT_NE(read(in, wider).lower, ratio.lower) << "planted fault: the quantile of K - 2";
}

// t = 1 + .3 z, m = .5 t + .2 z': 5 errors of a share of 40000 values, and an error bar's bias of 1/32 of itself.
TEST(Confidence, the_jackknife_of_two_groups_covers_what_it_says) {
    constexpr std::size_t replicates = 40000, batches = 32;
    Samples draw(78);
    Moments s(Engine{}, replicates, {.groups = 2});
    for (std::size_t k = 0; k < batches; ++k) {
        const auto t = floats(replicates, [&] { return 1 + 0.3 * draw.normal(); });
        auto m = floats(replicates, [&] { return 0.2 * draw.normal(); });
        for (std::size_t i = 0; i < replicates; ++i) m[i] += 0.5f * t[i];
        s.add(m, t);
    }
    const Combined out = combine(s, 1.0f, with_everything(Estimator::jackknife, IntervalMethod::delta));
    const auto for_batches = static_cast<float>(student_quantile(0.95, batches - 1));
    double covered = 0, of_batches = 0;
    for (std::size_t i = 0; i < replicates; ++i) {
        covered += out.lower[i] <= 0.5f && out.upper[i] >= 0.5f;
        of_batches += std::fabs(out.estimate[i] - 0.5f) <= for_batches * out.standard_error[i];
    }
    const double room = 5 * std::sqrt(0.95 * 0.05 / replicates) + 0.05 / batches;
    EXPECT_NEAR(covered / replicates, 0.95, room);
    EXPECT_LT(of_batches / replicates, 0.75) << "planted fault: the quantile of batches";
}

// Of 40000 estimates the variance is known to sqrt(2 / 40000) of itself where they are normal; 64 batches of a lognormal
// leave an excess below 1, and a bias of the error bar of a few of 1/64: 5 sqrt(3 / 40000) + 6/64 in all.
TEST(Confidence, error_bars_are_as_large_as_the_errors) {
    constexpr std::size_t replicates = 40000, batches = 64;
    Samples draw(77);
    std::vector<std::vector<float>> m, t;
    for (std::size_t k = 0; k < batches; ++k) {
        m.push_back(floats(replicates, [&] { return draw.lognormal(0.6); }));
        t.push_back(floats(replicates, [&] { return draw.lognormal(0.6); }));
    }
    Moments s(Engine{}, replicates, {.ratios = true, .groups = 8});
    std::vector<HostBatch> all;
    for (std::size_t k = 0; k < batches; ++k) all.push_back({m[k], t[k]});
    s.add(all);
    const auto variance_over_error = [&](Estimator e, Estimator bar) {
        const Combined values_of = combine(s, 1.0f, {.estimator = e});
        const Combined errors_of = combine(s, 1.0f, {.estimator = bar, .standard_error = true});
        double mean = 0, square = 0, error = 0;
        for (std::size_t i = 0; i < replicates; ++i) {
            const auto x = static_cast<double>(values_of.estimate[i]), se = static_cast<double>(errors_of.standard_error[i]);
            mean += x / replicates;
            square += x * x / replicates;
            error += se * se / replicates;
        }
        return (square - mean * mean) / error;
    };
    const double room = 5 * std::sqrt(3.0 / replicates) + 6.0 / batches;
    for (const Estimator e : {Estimator::mean, Estimator::ratio, Estimator::beale, Estimator::hartley_ross,
                              Estimator::jackknife, Estimator::mickey, Estimator::regression})
        EXPECT_NEAR(variance_over_error(e, e), 1, room) << name_of(e);
    EXPECT_GT(variance_over_error(Estimator::hartley_ross, Estimator::ratio), 1 + 3 * room)
        << "planted fault: Hartley and Ross with the error bar of the ratio";
}

// Weights as trust have no unit. A power of two scales every sum exactly.
TEST(Confidence, reliability_weights_have_no_unit) {
    const MomentsOptions state{.weights = Weights::reliability};
    const CombineOptions options = with_everything(Estimator::beale, IntervalMethod::delta);
    const GroupedInput in = input_of(3);
    const Combined want = read(in, options, state);
    for (const double unit : {0x1p-60, 0x1p-30, 0x1p40, 0x1p57}) {
        GroupedInput scaled = in;
        for (double& w : scaled.weight) w *= unit;
        const Combined out = read(scaled, options, state);
        EXPECT_EQ(out.estimate, want.estimate) << unit;
        EXPECT_EQ(out.standard_error, want.standard_error) << unit;
        EXPECT_EQ(out.bias, want.bias) << unit;
        EXPECT_EQ(out.lower, want.lower) << unit;
    }
    const auto unit = 0x1p57f;
    EXPECT_TRUE(std::isinf(unit * (4 * unit * unit - unit * unit))) << "planted fault: third powers of weights";
}

// W - W2 / W of weights w, 1, 1 is 4 where w is large: of two floats of W, 48 bits, nothing is left of it above 2^46.
TEST(Confidence, a_batch_that_outweighs_all_others_has_no_error_bar) {
    const CombineOptions options{.standard_error = true};
    const auto outweighed = [&](double weight, Weights weights) {
        Moments s(Engine{}, 1, {.weights = weights});
        for (const float m : {1.0f, 2.0f, 4.0f}) {
            const float t = 1;
            s.add({&m, 1}, {&t, 1}, m == 1 ? weight : 1);
        }
        return combine(s, 1.0f, options);
    };
    for (const auto& [weight, known] : {std::pair{0x1p30, true}, {0x1p37, true}, {0x1p45, false}, {0x1p59, false}}) {
        const Combined out = outweighed(weight, Weights::reliability);
        EXPECT_EQ(std::isfinite(out.standard_error[0]), known) << weight;
        EXPECT_EQ(out.flags.no_error_bar, known ? 0u : 1u) << weight;
        // M2 = 1 + 9, to w^-1; Var = M2 W2 / (W (W^2 - W2)). Both sums are exact here, W2 / W is good to 2^-43 of W, so that
        // W - W2 / W = 4 is to 2^-45 W of itself, and its root to half of that. 2^-20: four roundings of floats.
        if (known) {
            EXPECT_NEAR(out.standard_error[0] / std::sqrt(10.0 / 4), 1, 0x1p-46 * weight + 0x1p-20);
        }
        EXPECT_TRUE(std::isfinite(outweighed(weight, Weights::samples).standard_error[0]))
            << "planted fault: no bar beside any such weight";
    }
}

// m and t in other units, likewise: m / t is 2^-80 of what it was, its square below every float.
TEST(Confidence, intervals_hold_at_every_scale) {
    constexpr float small = 0x1p-40f, large = 0x1p40f;
    const GroupedInput in = input_of(2, 4);
    GroupedInput scaled = in;
    for (auto& batch : scaled.m)
        for (float& x : batch) x *= small;
    for (auto& batch : scaled.t)
        for (float& x : batch) x *= large;
    for (const auto method : {IntervalMethod::fieller, IntervalMethod::delta}) {
        const CombineOptions options = with_everything(Estimator::ratio, method);
        const std::vector<float> tau(values, taus[0] * large);
        const Combined want = read(in, options);
        const Combined out = combine(moments_of(Engine{}, scaled, everything), Tau(std::span<const float>(tau)), options);
        EXPECT_EQ(out.kind, want.kind);
        std::size_t differ = 0;
        for (std::size_t i = 0; i < values; ++i)
            differ += out.lower[i] != want.lower[i] * small || out.upper[i] != want.upper[i] * small;
        EXPECT_EQ(differ, 0u);
    }
    EXPECT_EQ(small * small / (large * large), 0) << "planted fault: squares of m over squares of t";
}

// One batch is lit, the others are black: every residual is 0, whatever the quotient rounds to.
TEST(Confidence, batches_that_agree_have_no_spread) {
    Samples draw(9);
    for (const std::size_t batches : {2, 7, 40}) {
        GroupedInput in;
        for (std::size_t k = 0; k < batches; ++k) {
            in.m.push_back(std::vector<float>(values, 0.0f));
            in.t.push_back(in.m.back());
            in.weight.push_back(static_cast<double>(1 + k % 4));
        }
        in.t[batches / 2] = floats(values, [&] { return draw.lognormal(1); });
        for (std::size_t i = 0; i < values; ++i)
            in.m[batches / 2][i] = in.t[batches / 2][i] * static_cast<float>(draw.uniform());
        for (const MomentsOptions& state : {MomentsOptions{}, MomentsOptions{.groups = 2}}) {
            const Combined out = read(in, with_everything(Estimator::ratio, IntervalMethod::delta), state);
            EXPECT_EQ(out.flags.no_spread, values) << batches << " batches, " << state.groups << " groups";
            EXPECT_EQ(out.standard_error, std::vector<float>(values, 0.0f));
            for (const float e : out.standard_error) EXPECT_FALSE(std::signbit(e));
            EXPECT_EQ(read(in, with_everything(Estimator::ratio, IntervalMethod::fieller), state).flags.no_spread, values);
        }
        for (std::size_t i = 0; i < values; ++i) in.m[0][i] = 1e-5f * in.m[batches / 2][i];
        EXPECT_EQ(read(in, with_everything(Estimator::ratio, IntervalMethod::delta), {}).flags.no_spread, 0u)
            << "planted fault: a spread of 1e-5 of m's is taken for none, " << batches;
    }
}

TEST(Confidence, where_nothing_is_known_all_is_needed) {
    const float nan = std::numeric_limits<float>::quiet_NaN();
    const CombineOptions options = with_everything(Estimator::ratio, IntervalMethod::delta);
    EXPECT_EQ(read_one({nan, nan}, {1, 1}, 1, options).needed[0], infinite) << "no batch left";
    EXPECT_EQ(read_one({1}, {1}, 1, options).needed[0], infinite) << "one batch";
    EXPECT_EQ(read_one({}, {}, 1, options).needed[0], infinite) << "an empty state";
    EXPECT_EQ(read_one({1, 2}, {1e-30f, 1e-30f}, 1e30f, options).needed[0], infinite) << "an infinite estimate";
    EXPECT_EQ(read_one({1, 1, 1}, {1, 1, 1}, 1, options).needed[0], 0) << "planted fault: infinite wherever asked";
    const Combined averaged = read_one({1, 2}, {1, 1}, 1, with_everything(Estimator::mean_of_ratios, IntervalMethod::delta));
    EXPECT_EQ(averaged.standard_error[0], infinite) << "the mean of ratios has none";
}

// Where sums of squares leave the range of float, it is said.
TEST(Confidence, what_overflows_is_not_called_constant) {
    const std::vector<float> m{1e20f, 2e20f, 4e20f}, t{2e20f, 3e20f, 3e20f};
    for (const Estimator e : {Estimator::regression, Estimator::crossfit_regression}) {
        const Combined out = read_one(m, t, 2e20f, with_everything(e, IntervalMethod::delta));
        EXPECT_NE(out.flag_image[0] & (CLR_FLAG_NONFINITE | CLR_FLAG_FELL_BACK), 0u) << name_of(e);
        EXPECT_TRUE(std::isnan(out.gain[0])) << name_of(e);
    }
    const Combined out = read_one({1, 2, 4}, {2, 3, 3}, 2, with_everything(Estimator::regression, IntervalMethod::delta));
    EXPECT_EQ(out.flag_image[0], 0u) << "planted fault: flagged at any scale";
}

TEST(Confidence, where_tau_is_0_the_jackknife_is_the_ratio_with_its_error_bar) {
    const std::vector<float> m{.1f, .2f, .35f, .3f}, t{.2f, .1f, .4f, .3f};
    const auto of = [&](Estimator e) { return read_one(m, t, 0, with_everything(e, IntervalMethod::delta)); };
    for (const Estimator e : {Estimator::jackknife, Estimator::hartley_ross}) {
        EXPECT_EQ(of(e).estimate, of(Estimator::ratio).estimate) << name_of(e);
        EXPECT_EQ(of(e).standard_error, of(Estimator::ratio).standard_error) << name_of(e);
        EXPECT_EQ(of(e).lower, of(Estimator::ratio).lower) << name_of(e);
    }
}

TEST(Confidence, unknown_words_are_refused) {
    const Moments s(Engine{}, 1);
    const auto unknown = static_cast<Estimator>(10);
    refused([&] { name_of(unknown); }, "estimator: expected one of all_estimators(), got 10");
    refused([&] { combine(s, 1.0f, {.estimator = unknown}); }, "estimator");
    refused([&] { combine(s, 1.0f, {.zero = static_cast<Zero>(3)}); }, "zero");
    CombineOptions method;
    method.method = static_cast<IntervalMethod>(2);
    refused([&] { combine(s, 1.0f, method); }, "method");
    refused([] { student_quantile(0.95, 1e-3); }, "freedom");
    EXPECT_TRUE(std::isfinite(student_quantile(1 - 1e-15, 0.5)));
}
