#include "clratio/device/groups.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "support/grouped.hpp"
#include "support/twin.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

/// Where sums over groups would cancel: m is a line in t up to 1e-3. A third of the values has t = 0, another tau = 0, some
/// both.
GroupedInput near_a_line() {
    Samples draw(5);
    GroupedInput in;
    for (std::size_t k = 0; k < batch_count; ++k) {
        in.t.push_back(floats(values, [&] { return 4 + draw.uniform(); }));
        in.m.push_back(in.t.back());
        for (auto& x : in.m.back()) x = 0.3f + 0.5f * x + 1e-3f * static_cast<float>(draw.uniform());
        for (std::size_t i = 0; i < values; i += 3) in.t.back()[i] = 0;
        in.weight.push_back(static_cast<double>(1 + k % 4));
    }
    return in;
}

/// Error bars with a fault: without what lies between groups, or with the residual of means not about the joint one.
enum class Fault { within_alone, no_offset };

float error_with(Fault fault, std::span<const TwinValue> groups, float tau) {
    device::clr_question ask{};
    ask.outputs = CLR_WRITE_ERROR;
    auto j = join_twin(groups, tau, ask);
    if (fault == Fault::within_alone) j.spread = device::clr_spread_of(j.all.moments, j.q.quotient);
    if (fault == Fault::no_offset) {
        auto folds = device::clr_folds_begin(j.all.moments, j.q, tau);
        folds.offset = {0, 0};
        for (const auto& g : groups)
            folds =
                device::clr_fold(folds, j.all.moments, j.q, g.record.moments, device::clr_part_of(g.record.weight, j.whole));
        j.spread = device::clr_spread_of_groups(j.all.moments, j.q.quotient, folds);
    }
    return device::clr_read_out(j, batch_count, tau, 0, ask).error;
}

std::vector<float> partly_zero() {
    std::vector<float> tau = taus;
    for (std::size_t i = 0; i < values; ++i)
        if (i % 3 == 1 || i % 9 == 0) tau[i] = 0;
    return tau;
}

}  // namespace

// Both read-outs round a dozen times, and the second moments between groups are float sums: 16 ulp of an error bar in all.
// About the line, second moments of 2^-46 precision cancel down to 5e-6 of themselves: 2^-28, a 64th of that.
TEST(Groups, together_say_what_all_batches_do) {
    const Engine engine;
    const GroupedInput in = near_a_line();
    const std::vector<float> tau = partly_zero();
    for (const Estimator e : {Estimator::ratio, Estimator::mean, Estimator::beale, Estimator::regression}) {
        const CombineOptions options{.estimator = e, .standard_error = true, .bias = true, .gain = true};
        const Combined one = combine(moments_of(engine, in, {}), Tau(std::span<const float>(tau)), options);
        const Combined five =
            combine(moments_of(engine, in, {.groups = group_count}), Tau(std::span<const float>(tau)), options);
        for (std::size_t i = 0; i < values; ++i) {
            Statistics all;
            for (const auto& g : reference(in, i)) all.merge(g);
            const auto near = [&](float a, float b, double ulps, double also = 0) {
                const double size = std::fabs(static_cast<double>(b)) + also;
                EXPECT_NEAR(static_cast<double>(a), static_cast<double>(b), ulps * 0x1p-24 * size) << name_of(e) << ' ' << i;
            };
            near(five.estimate[i], one.estimate[i], 4, std::fabs(all.mean_t - static_cast<double>(tau[i])));
            near(five.standard_error[i], one.standard_error[i], 16);
            near(five.gain[i], one.gain[i], 32);
            if (std::isfinite(one.bias[i])) near(five.bias[i], one.bias[i], 32);
            if (e != Estimator::ratio) continue;
            const auto groups = twins(in, i);
            const auto caught = [&](Fault fault) {
                return std::fabs(error_with(fault, groups, tau[i]) / one.standard_error[i] - 1) > 16 * 0x1p-24f;
            };
            EXPECT_TRUE(caught(Fault::within_alone)) << "planted fault: nothing between groups, value " << i;
            if (i % 3 == 0 || tau[i] == 0) {
                EXPECT_TRUE(caught(Fault::no_offset)) << "planted fault: residuals about 0, value " << i;
            }
        }
    }
}

namespace {

/// The joint mean of m over groups from `near` on, less that in double, and the groups' mean distance from `near`.
struct JointMean {
    double error, distance;
};

JointMean joint_mean(std::span<const TwinValue> groups, device::clr_moments near, double want) {
    device::clr_two weight{};
    for (const auto& g : groups) weight = device::clr_two_add(weight, g.record.weight);
    const auto whole = device::clr_whole_of(weight);
    auto all = device::clr_pool_begin(near);
    double distance = 0;
    for (const auto& g : groups) {
        const auto part = device::clr_part_of(g.record.weight, whole);
        all = device::clr_pool_distances(all, g.record.moments, part.p);
        distance += value(part.p) * std::fabs(value(g.record.moments.m) - static_cast<double>(near.m.hi));
    }
    return {std::fabs(value(all.m) - want), distance};
}

}  // namespace

// Two-float means of groups add 2^-46 of themselves. The first group has lost all its batches.
TEST(Groups, joint_means_of_groups_are_as_near_as_the_groups) {
    const GroupedInput in = near_a_line();
    int caught = 0;
    for (std::size_t i = 0; i < values; ++i) {
        std::vector<TwinValue> groups(group_count);
        Statistics all;
        for (std::size_t k = 0; k < in.m.size(); ++k) {
            const bool lost = k % group_count == 0;
            groups[k % group_count].add(lost ? NAN : in.m[k][i], in.t[k][i], in.weight[k]);
            if (!lost) all.add(static_cast<double>(in.m[k][i]), static_cast<double>(in.t[k][i]), in.weight[k]);
        }
        const auto bound = [&](const JointMean& mean) {
            return (group_count + 2) * 0x1p-24 * mean.distance + 0x1p-46 * std::fabs(all.mean_m);
        };
        const auto first = device::clr_first_means(groups[0].record, groups[1].record);
        const JointMean mean = joint_mean(groups, first, all.mean_m);
        EXPECT_LE(mean.error, bound(mean)) << i;
        caught += joint_mean(groups, groups[0].record.moments, all.mean_m).error > bound(mean);
    }
    EXPECT_GT(caught, static_cast<int>(values / 2)) << "planted fault: distances from a group that holds nothing";
}

// Then the ratio without that group has no denominator, and the slope without it is 0: neither is what rounding leaves.
TEST(Groups, fall_back_where_all_t_is_in_one_group) {
    const GroupedInput in = input_of(4);
    const float tau = 1.25f;
    int left = 0;
    for (std::size_t i = 0; i < values; ++i) {
        std::vector<TwinValue> groups(group_count);
        std::vector<Statistics> want(group_count);
        for (std::size_t k = 0; k < in.m.size(); ++k) {
            const std::size_t g = k % group_count;
            const float t = g == 0 ? in.t[k][i] : 0.0f;
            groups[g].add(in.m[k][i], t, in.weight[k]);
            want[g].add(static_cast<double>(in.m[k][i]), static_cast<double>(t), in.weight[k]);
        }
        const auto read = [&](std::uint32_t estimator) {
            device::clr_question ask{};
            ask.estimator = estimator;
            ask.outputs = CLR_WRITE_ESTIMATE | CLR_WRITE_ERROR | CLR_WRITE_FLAGS;
            return read_twin(groups, tau, ask);
        };
        const auto crossfit = read(CLR_ESTIMATOR_CROSSFIT_REGRESSION);
        EXPECT_TRUE(crossfit.flags & CLR_FLAG_FELL_BACK) << "the first group's others do not tell its slope, value " << i;
        const double size = std::fabs(estimate(want, Estimator::ratio, static_cast<double>(tau))) +
                            8 * standard_error(want, Estimator::ratio, static_cast<double>(tau));
        EXPECT_NEAR(static_cast<double>(crossfit.value),
                    estimate(want, Estimator::crossfit_regression, static_cast<double>(tau)), 12 * 0x1p-24 * size)
            << i;
        EXPECT_TRUE(read(CLR_ESTIMATOR_JACKKNIFE).flags & CLR_FLAG_FELL_BACK) << i;
        EXPECT_TRUE(read(CLR_ESTIMATOR_MICKEY).flags & CLR_FLAG_FELL_BACK) << i;

        const auto j = join_twin(groups, tau, {});
        const auto part = device::clr_part_of(groups[0].record.weight, j.whole);
        const float dt = device::clr_two_gap(groups[0].record.moments.t, j.all.moments.t);
        left += std::fma(-part.a, dt, j.q.denominator) != 0;
    }
    EXPECT_GT(left, 0) << "planted fault: without a least part of the whole, the mean of the others is not 0";
}

namespace {

device::clr_question asks_crossfit() {
    device::clr_question ask{};
    ask.estimator = CLR_ESTIMATOR_CROSSFIT_REGRESSION;
    ask.outputs = CLR_WRITE_FLAGS;
    return ask;
}

/// A value's groups, and the cross-fitted regression of them in double.
struct Crossfit {
    std::vector<TwinValue> groups;
    double exact, bound;

    Crossfit(const GroupedInput& in, std::size_t i, float tau) : groups(twins(in, i)) {
        const auto want = reference(in, i);
        exact = estimate(want, Estimator::crossfit_regression, static_cast<double>(tau));
        bound = crossfit_bound(want, static_cast<double>(tau));
    }
    double off(float got) const { return std::fabs(static_cast<double>(got) - exact); }
};

/// Without asking the other groups where sums cancel.
float trusting_crossfit(std::span<const TwinValue> groups, float tau) {
    using namespace device;
    const auto j = join_twin(groups, tau, asks_crossfit());
    float cross = 0;
    for (const auto& g : groups) {
        const clr_part part = clr_part_of(g.record.weight, j.whole);
        const float slope = clr_others_than(j.cross, j.all.moments, g.record.moments, part).slope;
        cross += part.p.hi * slope * (clr_two_gap(g.record.moments.t, j.all.moments.t) + j.folds.control_error);
    }
    return j.all.moments.m.hi - cross;
}

}  // namespace

// 39 batches leave the loosest sums within the groups, 5 leave none, and 4 leave a group without a batch.
TEST(Groups, crossfit_holds_its_bound_where_one_batch_outweighs_all_others) {
    const float tau = 1.25f;
    for (const std::size_t batches : {39, 23, 5, 4}) {
        const GroupedInput in = with_fireflies(input_of(6, batches));
        int caught = 0;
        for (std::size_t i = 0; i < values; ++i) {
            const Crossfit value(in, i, tau);
            const auto got = read_twin(value.groups, tau, asks_crossfit());
            EXPECT_LE(value.off(got.value), value.bound) << batches << " batches, value " << i;
            EXPECT_FALSE(got.flags & CLR_FLAG_FELL_BACK) << batches << " batches, value " << i;
            caught += value.off(trusting_crossfit(value.groups, tau)) > value.bound;
        }
        EXPECT_GT(caught, static_cast<int>(values / 20)) << "planted fault: slopes in doubt are taken, " << batches;
    }
}

namespace {

/// t varies by a few of its own ulps: most of a second moment's hi part may be what its lo part takes back.
GroupedInput of_almost_constant_t(std::size_t batches) {
    Samples draw(8);
    GroupedInput in;
    for (std::size_t k = 0; k < batches; ++k) {
        in.t.push_back(floats(values, [&] { return 1 + 1e-6 * draw.normal(); }));
        in.m.push_back(floats(values, [&] { return 0.5 + 0.1 * draw.normal(); }));
        in.weight.push_back(1);
    }
    return in;
}

/// The slopes' sums out of hi parts alone.
std::vector<TwinValue> without_lo_parts(std::vector<TwinValue> groups) {
    for (auto& g : groups)
        for (device::clr_two* sum : {&g.record.moments.mm, &g.record.moments.tt, &g.record.moments.mt}) sum->lo = 0;
    return groups;
}

}  // namespace

TEST(Groups, crossfit_holds_its_bound_where_t_hardly_varies) {
    const float tau = 1.3f;
    for (const std::size_t batches : {11, 17, 23}) {
        const GroupedInput in = of_almost_constant_t(batches);
        int caught = 0;
        for (std::size_t i = 0; i < values; ++i) {
            const Crossfit value(in, i, tau);
            const auto off = [&](const std::vector<TwinValue>& groups) {
                return value.off(read_twin(groups, tau, asks_crossfit()).value);
            };
            EXPECT_LE(off(value.groups), value.bound) << batches << " batches, value " << i;
            caught += off(without_lo_parts(value.groups)) > value.bound;
        }
        EXPECT_GT(caught, 0) << "planted fault: hi parts alone, " << batches;
    }
}

// Two batches in two groups leave one batch to take each slope from.
TEST(Groups, crossfit_says_where_the_others_do_not_tell_a_slope) {
    const GroupedInput in = with_fireflies(input_of(6, 2));
    for (std::size_t i = 0; i < values; ++i) {
        const auto groups = twins(in, i);
        const auto got = read_twin(groups, 1.25f, asks_crossfit());
        const bool varies = in.t[0][i] != in.t[1][i];
        EXPECT_EQ((got.flags & CLR_FLAG_FELL_BACK) != 0, varies) << i;
        EXPECT_EQ(got.value, join_twin(groups, 1.25f, asks_crossfit()).all.moments.m.hi) << i;
    }
}

// A batch's own index, not the order of arrival, chooses its group.
TEST(Groups, follow_the_index) {
    const Engine engine;
    const GroupedInput in = input_of(1, 12);
    const auto add = [&](Moments& s, std::size_t first, std::size_t last) {
        for (std::size_t k = first; k < last; ++k) {
            const HostBatch b{in.m[k], in.t[k], in.weight[k], k};
            s.add(std::span(&b, 1));
        }
    };
    Moments whole(engine, values, everything), front(engine, values, everything), back(engine, values, everything);
    add(whole, 0, 12);
    add(front, 0, 6);
    add(back, 6, 12);
    front.merge(back);
    const auto read = [](const Moments& s) {
        return combine(s, Tau(std::span<const float>(taus)), {.estimator = Estimator::mickey}).estimate;
    };
    const auto a = read(whole), b = read(front);
    for (std::size_t i = 0; i < values; ++i) EXPECT_NEAR(a[i], b[i], 4 * 0x1p-23f * std::fabs(a[i]));
    Moments wrong(engine, values, everything);
    add(wrong, 6, 12);
    for (std::size_t k = 0; k < 6; ++k) wrong.add(in.m[k], in.t[k], in.weight[k]);
    const auto c = read(wrong);
    std::size_t differ = 0;
    for (std::size_t i = 0; i < values; ++i) differ += std::fabs(a[i] - c[i]) > 4 * 0x1p-23f * std::fabs(a[i]);
    EXPECT_GT(differ, values / 2) << "planted fault: groups by order of arrival";
}
