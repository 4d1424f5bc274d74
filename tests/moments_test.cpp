#include "clratio/moments.hpp"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <limits>
#include <type_traits>

#include "clratio/fixed.hpp"
#include "launch.hpp"
#include "support/refused.hpp"
#include "support/samples.hpp"
#include "support/shapes.hpp"
#include "support/twin.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

constexpr std::size_t values = 5003;  // no multiple of any width
constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();

struct Input {
    std::vector<std::vector<float>> m, t;
    std::vector<double> weight;
};

Input make_input(std::uint64_t seed, std::size_t batches) {
    Samples draw(seed);
    Input in;
    for (std::size_t k = 0; k < batches; ++k) {
        in.t.push_back(floats(values, [&] { return draw.uniform() < 0.1 ? 0 : draw.lognormal(0.8); }));
        in.m.push_back(in.t.back());
        for (auto& x : in.m.back()) x *= static_cast<float>(draw.uniform());
        in.weight.push_back(static_cast<double>(1 + k % 5));
    }
    return in;
}

std::vector<HostBatch> batches_of(const Input& in) {
    std::vector<HostBatch> out;
    for (std::size_t k = 0; k < in.m.size(); ++k) out.push_back({in.m[k], in.t[k], in.weight[k]});
    return out;
}

const std::vector<cl_mem StatePlanes::*> all_planes{
    &StatePlanes::m,      &StatePlanes::t,       &StatePlanes::mm,       &StatePlanes::tt,     &StatePlanes::mt,
    &StatePlanes::weight, &StatePlanes::batches, &StatePlanes::quotient, &StatePlanes::zero_m, &StatePlanes::zero_share};

std::vector<std::uint32_t> all_bits(const Moments& s) {
    std::vector<std::uint32_t> all;
    for (auto p : all_planes) {
        const auto b = s.bits(p);
        all.insert(all.end(), b.begin(), b.end());
    }
    return all;
}

std::vector<std::uint32_t> twin_bits(const Input& in) {
    std::vector<TwinValue> twin(values);
    for (std::size_t k = 0; k < in.m.size(); ++k)
        for (std::size_t i = 0; i < values; ++i) twin[i].add(in.m[k][i], in.t[k][i], in.weight[k]);
    std::vector<std::uint32_t> all;
    const auto two = [&](auto part) {
        for (auto& v : twin) all.push_back(std::bit_cast<std::uint32_t>(part(v).hi));
        for (auto& v : twin) all.push_back(std::bit_cast<std::uint32_t>(part(v).lo));
    };
    two([](const TwinValue& v) { return v.record.moments.m; });
    two([](const TwinValue& v) { return v.record.moments.t; });
    two([](const TwinValue& v) { return v.record.moments.mm; });
    two([](const TwinValue& v) { return v.record.moments.tt; });
    two([](const TwinValue& v) { return v.record.moments.mt; });
    two([](const TwinValue& v) { return v.record.weight; });
    for (auto& v : twin) all.push_back(v.record.batches);
    two([](const TwinValue& v) { return v.record.ratios.quotient; });
    two([](const TwinValue& v) { return v.record.ratios.zero_m; });
    two([](const TwinValue& v) { return v.record.ratios.zero_share; });
    return all;
}

}  // namespace

TEST(Moments, same_bits_at_every_shape_and_on_the_host) {
    Input in = make_input(1, 11);
    in.m[3][5] = not_a_number;
    in.t[4][6] = std::numeric_limits<float>::infinity();
    const auto want = twin_bits(in);
    for (const auto& shape : all_shapes()) {
        Moments s{Engine(shape.options), values, {.ratios = true}};
        s.add(batches_of(in));
        EXPECT_EQ(all_bits(s), want) << shape.name;
        EXPECT_EQ(s.skipped(), 2u) << shape.name;
    }
}

TEST(Moments, batches_of_one_launch_and_of_many_have_the_same_bits) {
    const Input in = make_input(2, 19);
    const Engine engine;
    Moments together(engine, values, {.ratios = true}), apart(engine, values, {.ratios = true});
    together.add(batches_of(in));
    for (const auto& b : batches_of(in)) apart.add(b.m, b.t, b.weight);
    EXPECT_EQ(all_bits(together), all_bits(apart));

    Moments swapped(engine, values, {.ratios = true});
    for (const auto& b : batches_of(in)) swapped.add(b.t, b.m, b.weight);
    EXPECT_NE(all_bits(swapped), all_bits(apart)) << "planted fault: m and t swapped";
}

TEST(Moments, cleared_is_as_new) {
    Input in = make_input(4, 9);
    in.m[0][1] = -1;
    in.t[0][2] = not_a_number;
    const Engine engine;
    Moments used(engine, values, {.ratios = true}), fresh(engine, values, {.ratios = true});
    used.add(batches_of(in));
    used.clear();
    EXPECT_EQ(used.batches() + used.negatives() + used.skipped(), 0u);
    EXPECT_EQ(used.weight(), 0);
    const Input other = make_input(5, 3);
    used.add(batches_of(other));
    fresh.add(batches_of(other));
    EXPECT_EQ(all_bits(used), all_bits(fresh));
    EXPECT_EQ(used.weight(), fresh.weight());
}

TEST(Moments, the_policies_agree_on_finite_input) {
    const Input in = make_input(3, 5);
    const Engine engine;
    Moments skip(engine, values), propagate(engine, values, {.nonfinite = NonFinite::propagate});
    skip.add(batches_of(in));
    propagate.add(batches_of(in));
    for (auto plane : {&StatePlanes::m, &StatePlanes::t, &StatePlanes::mm, &StatePlanes::tt, &StatePlanes::mt})
        EXPECT_EQ(skip.bits(plane), propagate.bits(plane));
    EXPECT_EQ(skip.weight(), propagate.weight());
}

namespace {

/// One batch with a NaN at value 3 and an infinity at value 700.
Input spoiled() {
    Input in = make_input(1, 3);
    in.m[1][3] = not_a_number;
    in.t[2][700] = -std::numeric_limits<float>::infinity();
    return in;
}

}  // namespace

TEST(Moments, skip_leaves_a_value_as_if_the_batch_had_not_come) {
    const Input in = spoiled();
    const Engine engine;
    Moments all(engine, values), without(engine, values);
    all.add(batches_of(in));
    without.add(in.m[0], in.t[0], in.weight[0]);
    without.add(in.m[2], in.t[2], in.weight[2]);
    EXPECT_EQ(all.bits(&StatePlanes::m)[3], without.bits(&StatePlanes::m)[3]);
    EXPECT_EQ(all.bits(&StatePlanes::mt)[3], without.bits(&StatePlanes::mt)[3]);
    EXPECT_EQ(all.bits(&StatePlanes::batches)[3], 2u);
    EXPECT_EQ(all.bits(&StatePlanes::batches)[4], 3u);
    EXPECT_EQ(all.skipped(), 2u);
}

TEST(Moments, propagate_keeps_a_nan_for_ever) {
    const Engine engine;
    Moments s(engine, values, {.nonfinite = NonFinite::propagate});
    s.add(batches_of(spoiled()));
    EXPECT_TRUE(std::isnan(std::bit_cast<float>(s.bits(&StatePlanes::m)[3])));
    EXPECT_FALSE(std::isnan(std::bit_cast<float>(s.bits(&StatePlanes::m)[4])));
    EXPECT_EQ(s.skipped(), 0u);
}

TEST(Moments, fail_refuses_the_batch_by_number_and_keeps_the_state) {
    const Input in = spoiled();
    const Engine engine;
    Moments s(engine, values, {.nonfinite = NonFinite::fail});
    s.add(in.m[0], in.t[0], 1);
    const auto before = all_bits(s);
    try {
        s.add(batches_of(in));
        FAIL();
    } catch (const InvalidArgument& e) {
        EXPECT_STREQ(e.what(), "batch 1: expected finite values, got 1 NaN or infinite ones");
    }
    EXPECT_EQ(all_bits(s), before);
    EXPECT_EQ(s.batches(), 1u);
}

TEST(Moments, negative_input_is_counted_also_over_merges) {
    Input in = make_input(1, 9);
    in.m[4][10] = -1;
    in.t[8][11] = -1;
    in.m[8][values - 1] = -1;
    const Engine engine;
    Moments a(engine, values), b(engine, values);
    a.add(batches_of(in));
    b.add(batches_of(in));
    EXPECT_EQ(a.negatives(), 3u);
    a.merge(b);
    EXPECT_EQ(a.negatives(), 6u);
}

TEST(Moments, misuse_is_refused_by_name) {
    const Engine engine, another;
    const std::vector<float> good(values, 1.0f), shorter(values - 1, 1.0f);
    Moments s(engine, values);
    refused([&] { Moments(engine, 0); }, "values");
    refused([&] { s.add(good, shorter); }, "t: expected 5003 values, got 5002");
    refused([&] { s.add(shorter, good); }, "m: expected 5003 values, got 5002");
    for (const double weight : {0.0, -1.0, std::nan(""), std::numeric_limits<double>::infinity()})
        refused([&] { s.add(good, good, weight); }, "weight");
    refused([&] { s.merge(Moments(engine, values + 1)); }, "merge: expected 5003 values");
    refused([&] { s.merge(Moments(another, values)); }, "same Engine");
    refused([&] { s.merge(Moments(engine, values, {.ratios = true})); }, "same options");
    refused([&] { s.add(std::span<const Batch>{}, {}); }, "batches");
    const Batch nowhere{{nullptr, 0, values}, {nullptr, 0, values}};
    refused([&] { s.add(std::span(&nowhere, 1), {}); }, "m: expected a device buffer, got null");
    Moments strict(engine, values, {.nonfinite = NonFinite::fail});
    refused([&] { strict.add(std::span(&nowhere, 1), {}); }, "NonFinite::fail");
    EXPECT_EQ(s.batches(), 0u);
}

TEST(Moments, sizes_and_weights_that_sums_cannot_hold_are_refused) {
    const Engine engine;
    for (const std::uint64_t count : {std::uint64_t{0}, std::uint64_t{1} << 61, ~std::uint64_t{0}}) {
        refused([&] { Moments(engine, count); }, "values: expected 1 to 2^50");
        refused([&] { FixedMoments(engine, count); }, "values: expected 1 to 2^50");
    }
    Moments s(engine, 1);
    const std::vector<float> one{1}, two{1, 2};
    refused([&] { s.add(one, one, 2 * most_weight); }, "weight: expected a sample count from 2^-60 to 2^60");
    for (int k = 0; k < 255; ++k) s.add(one, one, most_weight);
    refused([&] { s.add(one, one, most_weight); }, "weight: expected weights whose squares sum to less than 2^128");
    refused([&] { s.merge(s); }, "weight: expected weights whose squares sum to less than 2^128");
    EXPECT_EQ(s.batches(), 255u);
    EXPECT_EQ(Moments(engine, s.snapshot()).weight(), 255 * most_weight);
    refused([&] { s.add(std::vector<HostBatch>{{one, one}, {one, two}}); }, "t of batch 1: expected 1 values, got 2");
}

// A command before it fails; what was to follow is refused, not waited for, and clear() begins anew.
TEST(Moments, a_failed_command_is_told_and_cleared) {
    const Engine engine;
    const std::vector<float> one{1, 2}, t{4, 4};
    const Buffer mb = Buffer::copy_of(engine, std::as_bytes(std::span(one))),
                 tb = Buffer::copy_of(engine, std::as_bytes(std::span(t)));
    const Batch batch{{mb.mem(), 0, 2}, {tb.mem(), 0, 2}};
    Moments s(engine, 2);
    FixedMoments fixed(engine, 2);
    const cl_event gate = clCreateUserEvent(engine.context(), nullptr);
    const Event added(s.add(std::span(&batch, 1), {&gate, 1})), other(fixed.add(std::span(&batch, 1), {&gate, 1}));
    clSetUserEventStatus(gate, -5);
    for (const Event& e : {added, other}) EXPECT_THROW(wait(e), DeviceError);
    EXPECT_THROW(s.add(one, t), DeviceError);
    EXPECT_THROW(fixed.add(one, t), DeviceError);
    s.clear();
    fixed.clear();
    EXPECT_EQ(s.batches() + fixed.batches(), 0u);
    clReleaseEvent(gate);
}

TEST(Moments, stands_on_the_callers_buffers) {
    const Engine engine;
    const std::uint64_t bytes = Moments::plane_bytes(values);
    std::vector<Buffer> memory;
    for (int k = 0; k < 7; ++k) memory.push_back(Buffer::zeroed(engine, bytes));
    const StatePlanes planes{memory[0].mem(), memory[1].mem(), memory[2].mem(), memory[3].mem(),
                             memory[4].mem(), memory[5].mem(), memory[6].mem()};
    Moments mine(engine, values, {}, planes), own(engine, values);
    const Input in = make_input(1, 4);
    mine.add(batches_of(in));
    own.add(batches_of(in));
    EXPECT_EQ(all_bits(mine), all_bits(own));
    EXPECT_EQ(Moments::state_bytes(values), 6 * bytes + bytes / 2);
    std::vector<float> first(values);
    memory[0].read(std::as_writable_bytes(std::span(first)));
    EXPECT_EQ(std::bit_cast<std::uint32_t>(first[7]), own.bits(&StatePlanes::m)[7]);
    EXPECT_THROW(Moments(engine, 2 * values, {}, planes), InvalidArgument);
}

namespace {

/// The four inputs of the accumulation table (theory: progressive accumulation), and what two-float may lose of them.
struct LongRun {
    const char* name;
    double mean_error, variance_error;  // relative; 0 variance_error: the input is constant
    float (*draw)(Samples&);
};

const LongRun long_runs[] = {
    {"mean 1 sd .05", 7e-12, 2e-10, [](Samples& s) { return static_cast<float>(1 + 0.05 * s.normal()); }},
    {"lognormal mean 1 sd 1", 1e-10, 1e-9, [](Samples& s) { return static_cast<float>(s.lognormal(0.8325546)); }},
    {"mean 100 sd .01", 1e-12, 2e-10, [](Samples& s) { return static_cast<float>(100 + 0.01 * s.normal()); }},
    {"constant .1", 0, 0, [](Samples&) { return 0.1f; }}};

struct Truth {
    long double mean = 0, second = 0;
};

Truth truth_of(const std::vector<float>& x, std::size_t lanes, std::size_t lane) {
    Truth t;
    const auto n = static_cast<long double>(x.size() / lanes);
    for (std::size_t i = lane; i < x.size(); i += lanes) t.mean += x[i];
    t.mean /= n;
    for (std::size_t i = lane; i < x.size(); i += lanes) t.second += (x[i] - t.mean) * (x[i] - t.mean);
    return t;
}

double pair(const std::vector<std::uint32_t>& bits, std::size_t i) {
    return static_cast<double>(std::bit_cast<float>(bits[i])) +
           static_cast<double>(std::bit_cast<float>(bits[bits.size() / 2 + i]));
}

}  // namespace

TEST(Moments, a_million_batches_stay_within_the_two_float_column) {
    constexpr std::size_t lanes = 16, count = 1'000'000, per_call = 8;
    const Engine engine;
    for (const auto& run : long_runs) {
        Samples draw(1);
        const auto x = floats(lanes * count, [&] { return static_cast<double>(run.draw(draw)); });
        const Buffer on_device = Buffer::from_host(engine, std::as_bytes(std::span(x)));
        Moments s(engine, lanes, {.nonfinite = NonFinite::propagate});
        for (std::size_t k = 0; k < count; k += per_call) {
            std::vector<Batch> batches;
            for (std::size_t b = k; b < k + per_call; ++b) {
                const View view{on_device.mem(), b * lanes, lanes};
                batches.push_back({view, view});
            }
            const Event done(s.add(batches, {}));
            if (k % 8000 == 0) wait(done);
        }
        const auto mean = s.bits(&StatePlanes::m), second = s.bits(&StatePlanes::mm);
        for (std::size_t i = 0; i < lanes; ++i) {
            const Truth want = truth_of(x, lanes, i);
            EXPECT_LE(std::fabs(pair(mean, i) / static_cast<double>(want.mean) - 1), run.mean_error) << run.name;
            EXPECT_LE(std::fabs(pair(second, i) - static_cast<double>(want.second)),
                      run.variance_error * static_cast<double>(want.second))
                << run.name;
        }
    }
}

TEST(Moments, sums_in_plain_float_would_not) {
    Samples draw(1);
    const auto x = floats(1'000'000, [&] { return 1 + 0.05 * draw.normal(); });
    float mean = 0;
    for (std::size_t i = 0; i < x.size(); ++i) mean += (x[i] - mean) / static_cast<float>(i + 1);
    EXPECT_GT(std::fabs(static_cast<double>(mean) / static_cast<double>(truth_of(x, 1, 0).mean) - 1),
              long_runs[0].mean_error);
}

namespace {

/// hi + lo of every two-float plane: what a merge keeps, while it settles the pairs.
std::vector<double> all_sums(const Moments& s) {
    std::vector<double> all;
    for (auto p :
         {&StatePlanes::m, &StatePlanes::t, &StatePlanes::mm, &StatePlanes::tt, &StatePlanes::mt, &StatePlanes::weight}) {
        const auto b = s.bits(p);
        for (std::size_t i = 0; i < values; ++i) all.push_back(pair(b, i));
    }
    return all;
}

}  // namespace

// ---- the residual m - r t, of which the error bar is made

namespace {

using Exact = boost::multiprecision::cpp_bin_float_100;
using device::clr_entry;
using device::clr_moments;

Exact of(device::clr_two x) { return Exact(x.hi) + Exact(x.lo); }

/// What the same entries make of m, t and their second moments without rounding.
struct ExactMoments {
    Exact m = 0, t = 0, mm = 0, tt = 0, mt = 0;
    void add(float new_m, float new_t, clr_entry e) {
        const Exact dm = new_m - m, dt = new_t - t;
        mm += e.spread * dm * dm;
        tt += e.spread * dt * dt;
        mt += e.spread * dm * dt;
        m += of(e.share) * dm;
        t += of(e.share) * dt;
    }
};

constexpr int short_sequence = 16;

constexpr double allowed = 0x1p-24;  // of a residual, by moments.h

/// Of mm - 2 r mt + r^2 tt, with r as large as makes both parts count alike, of either sign: its error over `allowance` of
/// it and what the roundings of two-float cost, for each batch and moment fewer than 2^9 of 2^-48.
double residual_error(const clr_moments& s, const ExactMoments& exact, int sign, double allowance) {
    const Exact r = sign * sqrt(exact.mm / exact.tt);
    const Exact residual = exact.mm - 2 * r * exact.mt + r * r * exact.tt;
    const Exact error = of(s.mm) - 2 * r * of(s.mt) + r * r * of(s.tt) - residual;
    const Exact rounding = short_sequence * 0x1p-39 * 4 * exact.mm;
    return std::abs(static_cast<double>(error / (allowance * residual + rounding)));
}

/// The largest over many sequences in which m is `noise` away from t, or, where `crossed`, from t or -t.
template <class Add>
double worst_residual_error(std::uint64_t seed, bool crossed, float noise, Add add, double allowance = allowed) {
    Samples draw(seed);
    double worst = 0;
    for (int sequence = 0; sequence < 4000; ++sequence) {
        clr_moments s = device::clr_moments_none();
        ExactMoments exact;
        for (int k = 0; k < short_sequence; ++k) {
            const float count = static_cast<float>(k);
            const clr_entry e = device::clr_entry_make({count, 0}, {1, 0}, {count + 1, 0});
            const float t = static_cast<float>(draw.normal() * draw.lognormal(1));
            const float m = (crossed && draw.uniform() < .5 ? -t : t) + noise * static_cast<float>(draw.normal());
            s = add(s, m, t, e, static_cast<device::clr_u32>(k));
            exact.add(m, t, e);
        }
        for (const int sign : {-1, 1}) worst = std::max(worst, residual_error(s, exact, sign, allowance));
    }
    return worst;
}

/// As clr_moments_add, but what the sum of mt and a product loses is forgotten.
clr_moments add_carelessly(clr_moments s, float m, float t, clr_entry e, device::clr_u32 index) {
    const float product = e.spread * (m - s.m.hi) * (t - s.t.hi);
    const float lost = device::clr_two_sum(s.mt.hi, product).lo;
    s = device::clr_moments_add(s, m, t, e, index);
    s.mt.lo -= lost;
    return s;
}

}  // namespace

TEST(Moments, the_residual_keeps_its_digits) {
    const float near = 0x1p-8f;
    EXPECT_LT(worst_residual_error(11, false, near, device::clr_moments_add), 1);
    EXPECT_LT(worst_residual_error(12, true, 0, device::clr_moments_add), 1);
    EXPECT_GT(worst_residual_error(11, false, near, add_carelessly), 10) << "planted fault";
    EXPECT_GT(worst_residual_error(12, true, 0, add_carelessly), 10) << "planted fault";
    EXPECT_GT(worst_residual_error(12, true, 0, device::clr_moments_add, 0), 10) << "what is allowed is never lost";
}

TEST(Moments, an_empty_state_is_zero_whatever_its_planes_hold) {
    const Engine engine;
    std::vector<Buffer> memory;
    const std::vector<std::byte> rubbish(Moments::plane_bytes(values), std::byte{0xff});
    for (int k = 0; k < 7; ++k) {
        memory.emplace_back(engine, rubbish.size());
        memory.back().write(rubbish);
    }
    const StatePlanes planes{memory[0].mem(), memory[1].mem(), memory[2].mem(), memory[3].mem(),
                             memory[4].mem(), memory[5].mem(), memory[6].mem()};
    Moments dirty(engine, values, {}, planes), clean(engine, values), filled(engine, values);
    EXPECT_EQ(dirty.bits(&StatePlanes::m), std::vector<std::uint32_t>(2 * values, 0u));
    filled.add(batches_of(make_input(1, 3)));
    const auto before = all_sums(filled);
    filled.merge(dirty);
    EXPECT_EQ(all_sums(filled), before);
    dirty.merge(filled);
    EXPECT_EQ(all_sums(dirty), before);
    clean.merge(filled);
    EXPECT_EQ(all_sums(clean), before);
}

TEST(Moments, a_state_has_one_owner) {
    static_assert(!std::is_copy_constructible_v<Moments> && !std::is_copy_assignable_v<Moments>);
    const Engine engine;
    Moments from(engine, values), twin(engine, values);
    from.add(batches_of(make_input(1, 3)));
    twin.merge(from);
    const Moments to = std::move(from);
    EXPECT_EQ(all_sums(to), all_sums(twin));
}
