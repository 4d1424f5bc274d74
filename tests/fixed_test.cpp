#include "clratio/fixed.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "clratio/combine.hpp"
#include "clratio/snapshot.hpp"
#include "embedded.hpp"
#include "launch.hpp"
#include "support/fixed_oracle.hpp"
#include "support/oclgrind.hpp"
#include "support/raw_kernel.hpp"
#include "support/refused.hpp"
#include "support/shapes.hpp"

using namespace clratio;
using namespace clratio::test;

TEST(Fixed, sums_and_moments_are_those_of_big_integers) {
    const Engine engine;
    for (const FixedOptions o : {FixedOptions{}, FixedOptions{NonFinite::skip, 20, 0}, FixedOptions{NonFinite::skip, 0, 30},
                                 FixedOptions{NonFinite::skip, 40, 5}, FixedOptions{NonFinite::skip, 7, 9}})
        for (const std::uint64_t seed : {1, 2, 3}) {
            const Input in = make_input(seed, 11, o);
            FixedMoments s(engine, values, o);
            s.add(batches_of(in));
            const auto want = exact_sums(in, o);
            EXPECT_EQ(all_limbs(s), words_of(want)) << o.resolution << ' ' << o.range << " seed " << seed;
            EXPECT_EQ(pairs_of(s.moments()), pairs_of(want, o)) << o.resolution << ' ' << o.range << " seed " << seed;
        }
}

TEST(Fixed, same_bits_at_every_shape_and_on_the_host) {
    const Input in = spoiled(1, 11);
    const auto twin = twin_sums(in);
    EXPECT_EQ(words_of(twin), words_of(exact_sums(in)));
    for (const auto& shape : all_shapes()) {
        FixedMoments s{Engine(shape.options), values};
        s.add(batches_of(in));
        EXPECT_EQ(all_limbs(s), words_of(twin)) << shape.name;
        EXPECT_EQ(pairs_of(s.moments()), pairs_of(twin)) << shape.name;
        EXPECT_EQ(s.skipped(), 5u) << shape.name;
        EXPECT_EQ(s.outside(), 2u) << shape.name;
    }
}

namespace {

/// Puts each batch into one of `parts` states at random, merges the states two by two at random.
FixedMoments grouped(const Engine& engine, const Input& in, std::size_t parts, Samples& draw) {
    std::vector<FixedMoments> states;
    for (std::size_t p = 0; p < parts; ++p) states.emplace_back(engine, values);
    auto batches = batches_of(in);
    for (std::size_t k = batches.size(); k > 1; --k) std::swap(batches[k - 1], batches[draw.bits() % k]);
    for (std::size_t k = 0; k < batches.size(); ++k)
        states[k < parts ? k : draw.bits() % parts].add(batches[k].m, batches[k].t, batches[k].weight);
    while (states.size() > 1) {
        std::swap(states[draw.bits() % states.size()], states.back());
        const FixedMoments from = std::move(states.back());
        states.pop_back();
        states[draw.bits() % states.size()].merge(from);
    }
    return std::move(states.front());
}

}  // namespace

TEST(Fixed, any_grouping_and_order_of_3_to_40_parts_has_the_same_bits) {
    const Input in = spoiled(2, 45);
    const auto want = words_of(exact_sums(in));
    const auto moments = pairs_of(twin_sums(in));
    for (const std::uint64_t seed : {1, 2, 3}) {
        Samples draw(seed);
        for (const int width : {1, 4, 8, 16}) {
            const Engine engine({.width = width});
            for (const std::size_t parts :
                 {std::size_t{3}, static_cast<std::size_t>(3 + draw.bits() % 38), std::size_t{40}}) {
                const FixedMoments s = grouped(engine, in, parts, draw);
                EXPECT_EQ(all_limbs(s), want) << "seed " << seed << " width " << width << " parts " << parts;
                EXPECT_EQ(pairs_of(s.moments()), moments) << "seed " << seed << " width " << width << " parts " << parts;
                EXPECT_EQ(s.batches(), 45u);
                EXPECT_EQ(s.skipped(), 5u);
                EXPECT_EQ(s.outside(), 2u);
            }
        }
    }
}

TEST(Fixed, two_float_moments_show_the_grouping) {
    const Input in = make_input(2, 45);
    const Engine engine;
    Moments together(engine, values), a(engine, values), b(engine, values);
    together.add(batches_of(in));
    const auto batches = batches_of(in);
    a.add(std::span(batches).first(20));
    b.add(std::span(batches).last(25));
    a.merge(b);
    EXPECT_NE(pairs_of(a), pairs_of(together));
}

// ---- planted faults: the kernel as it stands, but for one line

namespace {

/// Adds all batches, twice.
Words raw_add(const Input& in, const std::string& from = "kernel void clr_add_fixed(",
              const std::string& to = "kernel void clr_add_fixed(") {
    const Engine engine;
    const std::uint64_t stride = Moments::plane_stride(values);
    RawKernel kernel(engine, replaced(flatten_kernel("fixed"), from, to), "clr_add_fixed");
    device::clr_fixed_batches table{};
    table.count = in.m.size();
    table.weight = static_cast<std::uint64_t>(in.weight[0]);
    std::vector<Buffer> inputs, planes;
    for (std::size_t k = 0; k < CLR_FIXED_BATCHES_PER_LAUNCH; ++k) {
        const std::size_t batch = std::min(k, in.m.size() - 1);
        for (const auto* x : {&in.m[batch], &in.t[batch]}) {
            inputs.push_back(Buffer::copy_of(engine, std::as_bytes(std::span(*x))));
            kernel.arg(inputs.back());
        }
        table.of[k] = {{0, 1, 1}, {0, 1, 1}};
    }
    kernel.arg(table);
    const std::size_t limbs[] = {1, 1, 2, 2, 2, 1, 1};
    for (std::size_t n : limbs) {
        planes.push_back(Buffer::zeroed(engine, n * stride * sizeof(std::uint64_t)));
        kernel.arg(planes.back());
    }
    const device::clr_fixed_state state{0x1p24f, 0x1p16f, 24, 1, stride, 0, 1, 0};
    const Buffer rows = Buffer::zeroed(engine, CLR_FIXED_TALLY * sizeof(std::uint64_t));
    kernel.arg(state).arg(rows).arg(device::clr_range{values, stride});
    kernel.run(1, 1);
    kernel.run(1, 1);
    Words all;
    for (std::size_t p = 0; p < 6; ++p) {
        const auto words = contents<std::uint64_t>(planes[p]);
        for (std::size_t n = 0; n < limbs[p]; ++n)
            all.insert(all.end(), words.begin() + static_cast<std::ptrdiff_t>(n * stride),
                       words.begin() + static_cast<std::ptrdiff_t>(n * stride + values));
    }
    const auto batches = contents<std::uint32_t>(planes[6]);
    all.insert(all.end(), batches.begin(), batches.begin() + values);
    return all;
}

}  // namespace

TEST(Fixed, planted_faults_are_caught) {
    Input in = make_input(3, 8);
    in.weight.assign(8, 777);
    Input twice = in;
    twice.m.insert(twice.m.end(), in.m.begin(), in.m.end());
    twice.t.insert(twice.t.end(), in.t.begin(), in.t.end());
    twice.weight.assign(16, 777);
    const auto want = words_of(exact_sums(twice));
    EXPECT_EQ(raw_add(in), want);
    EXPECT_NE(raw_add(in, "a.hi + b.hi + carry", "a.hi + b.hi"), want) << "a lost carry";
    EXPECT_NE(raw_add(in, "low.hi + x.hi * factor", "low.hi"), want) << "a truncated limb";
    EXPECT_NE(raw_add(in, "(size + whole_above) - whole_above", "size"), want) << "a rounding by truncation";
    EXPECT_NE(raw_add(in, "s.high + clr_signed_shift(s.middle, 24)", "s.high + (s.middle >> 24)"), want) << "a lost sign";
}

TEST(Fixed, the_oracle_of_the_moments_has_teeth) {
    const Input in = make_input(3, 8);
    const auto sums = exact_sums(in);
    const auto want = pairs_of(sums);
    auto nudged = want;
    for (float& x : nudged)
        if (&x - nudged.data() >= static_cast<std::ptrdiff_t>(values)) x = std::nextafter(x, infinite);
    EXPECT_NE(nudged, want);
    // In doubles, one rounding of each product: the second moment of nearly constant values is lost.
    Input flat = in;
    for (auto& batch : flat.m)
        for (float& x : batch) x = 1000 + x * 0x1p-24f;
    const auto flat_sums = exact_sums(flat);
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < values; ++i) {
        const Exact& e = flat_sums[i];
        const double w(e.weight), m(e.m), mm(e.mm);
        Fraction x{Integer(e.weight * e.mm - e.m * e.m), e.weight, -48};
        wrong += static_cast<float>(std::ldexp(mm - m * m / w, -48)) != nearest(x);
    }
    EXPECT_GT(wrong, values / 2);
}

// ---- edges

TEST(Fixed, rounds_ties_to_even) {
    const Engine engine;
    std::vector<float> m, t;
    for (int k = -9; k <= 9; ++k) {
        m.push_back(static_cast<float>(k) * 0x1p-25f);
        t.push_back(8388607.0f * 0x1p-24f + static_cast<float>(k) * 0x1p-25f);
    }
    FixedMoments s(engine, m.size());
    s.add(m, t);
    const auto sums = s.limbs(&FixedPlanes::m);
    const std::int64_t even[] = {-4, -4, -4, -3, -2, -2, -2, -1, 0, 0, 0, 1, 2, 2, 2, 3, 4, 4, 4};
    for (std::size_t i = 0; i < m.size(); ++i) EXPECT_EQ(static_cast<std::int64_t>(sums[i]), even[i]) << m[i];
    Input in;
    in.m = {m};
    in.t = {t};
    in.weight = {1};
    EXPECT_EQ(all_limbs(s), words_of(exact_sums(in)));
}

TEST(Fixed, the_largest_sums_fit_and_one_more_is_refused) {
    const Engine engine;
    for (const FixedOptions o : {FixedOptions{}, FixedOptions{NonFinite::skip, 8, 8}, FixedOptions{NonFinite::skip, 0, 48},
                                 FixedOptions{NonFinite::fail, 48, 0}}) {
        const float largest = std::ldexp(1.0f, o.range);
        Input in;
        in.m = {{largest, -largest, largest, 0}};
        in.t = {{largest, largest, -largest, largest}};
        in.weight = {static_cast<double>(o.most_weight())};
        FixedMoments s(engine, 4, o);
        s.add(batches_of(in));
        const auto sums = exact_sums(in, o);
        EXPECT_EQ(s.limbs(&FixedPlanes::m)[0], limb(sums[0].m, 0));
        EXPECT_EQ(s.limbs(&FixedPlanes::m)[1], limb(sums[1].m, 0));
        EXPECT_EQ(s.limbs(&FixedPlanes::mt)[1], limb(sums[1].mt, 0));
        EXPECT_EQ(s.limbs(&FixedPlanes::mm)[4], limb(sums[0].mm, 1));
        EXPECT_EQ(s.limbs(&FixedPlanes::mt)[5], limb(sums[1].mt, 1));
        EXPECT_LT(sums[0].m, Integer(1) << 63);
        EXPECT_GE(sums[0].m + 2 * (Integer(1) << (o.resolution + o.range)), Integer(1) << 63);
        EXPECT_EQ(pairs_of(s.moments()), pairs_of(sums, o));

        const auto before = all_limbs(s);
        FixedMoments one(engine, 4, o);
        one.add(in.m[0], in.t[0]);
        const std::string what = "weight: expected a sum of at most " + std::to_string(o.most_weight());
        refused([&] { s.add(in.m[0], in.t[0]); }, what);
        refused([&] { s.merge(one); }, what);
        refused([&] { one.merge(s); }, what);
        EXPECT_EQ(all_limbs(s), before);
        EXPECT_EQ(s.batches(), 1u);
        EXPECT_EQ(s.weight(), o.most_weight());
        EXPECT_EQ(one.weight(), 1u);
    }
}

TEST(Fixed, half_of_the_largest_weight_in_two_signs_is_as_exact) {
    const Engine engine;
    const FixedOptions o;
    const float largest = std::ldexp(1.0f, o.range);
    Input in;
    in.m = {std::vector<float>(values, largest), std::vector<float>(values, -largest)};
    in.t = {std::vector<float>(values, -largest), std::vector<float>(values, largest)};
    in.weight = {static_cast<double>(o.most_weight() / 2), static_cast<double>(o.most_weight() / 2 + 1)};
    FixedMoments s(engine, values, o);
    s.add(batches_of(in));
    EXPECT_EQ(all_limbs(s), words_of(exact_sums(in)));
    EXPECT_EQ(pairs_of(s.moments()), pairs_of(exact_sums(in)));
}

TEST(Fixed, fail_refuses_the_batch_by_number_with_the_count_and_keeps_the_state) {
    const Engine engine;
    Input in = make_input(1, 3);
    FixedMoments s(engine, values, {.nonfinite = NonFinite::fail});
    s.add(batches_of(in));
    const auto before = all_limbs(s);
    EXPECT_EQ(before.size(), 8 * values) << "no planes of weight and batches";
    in.m[1][7] = 65537;
    in.t[1][8] = -1e9f;
    refused([&] { s.add(batches_of(in)); }, "batch 1: expected magnitudes up to 2^16, got 2 larger ones");
    in.m[2][7] = not_a_number;
    refused([&] { s.add(in.m[2], in.t[2]); }, "batch 0: expected finite values, got 1 NaN or infinite ones");
    EXPECT_EQ(all_limbs(s), before);
    EXPECT_EQ(s.batches(), 3u);
    EXPECT_EQ(s.skipped(), 0u);
    EXPECT_EQ(pairs_of(s.moments()), pairs_of(exact_sums(make_input(1, 3))));
    EXPECT_EQ(s.moments().batches(), 3u);
}

TEST(Fixed, counts_negatives_over_merges_and_forgets_them_when_cleared) {
    const Engine engine;
    Input in;
    in.m = {std::vector<float>(values, 1), std::vector<float>(values, 2)};
    in.t = in.m;
    in.weight = {1, 2};
    in.m[0][4] = in.t[1][4] = in.m[1][values - 1] = -1;
    in.m[0][9] = -infinite;
    FixedMoments a(engine, values), b(engine, values), fresh(engine, values);
    a.add(batches_of(in));
    b.add(batches_of(in));
    EXPECT_EQ(a.negatives(), 4u);
    a.merge(b);
    EXPECT_EQ(a.negatives(), 8u);
    EXPECT_EQ(a.moments().negatives(), 8u);
    EXPECT_EQ(a.moments().skipped(), 2u);
    a.clear();
    EXPECT_EQ(a.negatives() + a.skipped() + a.outside() + a.batches() + a.weight(), 0u);
    a.add(batches_of(in));
    fresh.add(batches_of(in));
    EXPECT_EQ(all_limbs(a), all_limbs(fresh));
}

TEST(Fixed, an_empty_state_is_zero) {
    const Engine engine;
    FixedMoments a(engine, values), b(engine, values);
    EXPECT_EQ(all_limbs(a), Words(10 * values, 0));
    const Input in = make_input(1, 2);
    a.add(batches_of(in));
    const auto before = all_limbs(a);
    a.merge(b);
    EXPECT_EQ(all_limbs(a), before);
    b.merge(a);
    EXPECT_EQ(all_limbs(b), before);
    const Combined none = combine(FixedMoments(engine, values).moments(), 1.0f);
    EXPECT_EQ(none.flags.no_data, values);
}

TEST(Fixed, views_in_the_event_form_give_the_same_bits) {
    const Engine engine;
    constexpr std::size_t pixels = 501;
    Input rgb = make_input(3, 2);
    for (auto* images : {&rgb.m, &rgb.t})
        for (auto& image : *images) image.resize(pixels * 2);
    std::vector<Buffer> memory;
    std::vector<Batch> batches;
    for (std::size_t k = 0; k < 2; ++k) {
        const auto interleaved = [&](const std::vector<float>& x) -> View {
            std::vector<float> wide(pixels * 3 + 1, 77.0f);
            for (std::size_t i = 0; i < x.size(); ++i) wide[1 + i / 2 * 3 + i % 2] = x[i];
            memory.push_back(Buffer::copy_of(engine, std::as_bytes(std::span(wide))));
            return {memory.back().mem(), 1, pixels * 2, 3, 2};
        };
        const View m = interleaved(rgb.m[k]), t = interleaved(rgb.t[k]);
        batches.push_back({m, t, rgb.weight[k]});
    }
    FixedMoments a(engine, pixels * 2), b(engine, pixels * 2);
    const Event added(a.add(std::span(batches).first(1), {}));
    const Event other(b.add(std::span(batches).last(1), {}));
    const std::array both{added.get(), other.get()};
    const Event merged(a.merge(b, both));
    Moments out(engine, pixels * 2);
    const Event read(a.moments(out, std::array{merged.get()}));
    wait(read);
    EXPECT_EQ(all_limbs(a), words_of(exact_sums(rgb)));
    EXPECT_EQ(pairs_of(out), pairs_of(exact_sums(rgb)));
}

TEST(Fixed, estimates_and_error_bars_are_those_of_moments) {
    Samples draw(1);
    Input in;
    for (int k = 0; k < 9; ++k) {
        in.t.push_back(floats(values, [&] { return std::ldexp(static_cast<double>(1 + draw.bits() % 4096), -10); }));
        in.m.push_back(in.t.back());
        for (auto& x : in.m.back()) x *= static_cast<float>(draw.bits() % 2);
        in.weight.push_back(static_cast<double>(1 + draw.bits() % 5));
    }
    const Engine engine;
    FixedMoments fixed(engine, values);
    Moments two_float(engine, values);
    fixed.add(batches_of(in));
    two_float.add(batches_of(in));
    EXPECT_EQ(fixed.moments().weight(), two_float.weight());
    EXPECT_EQ(fixed.moments().bits(&StatePlanes::batches), two_float.bits(&StatePlanes::batches));
    const auto a = combine(fixed.moments(), 2.0f, {.standard_error = true});
    const auto b = combine(two_float, 2.0f, {.standard_error = true});
    EXPECT_EQ(a.flag_image, b.flag_image);
    for (std::size_t i = 0; i < values; ++i) {
        EXPECT_NEAR(a.estimate[i], b.estimate[i], 0x1p-22f * b.estimate[i]);  // 2 ulp
        EXPECT_NEAR(a.standard_error[i], b.standard_error[i], 0x1p-22f * b.standard_error[i] + 1e-7f);
    }
}

TEST(Fixed, a_value_that_lost_a_batch_is_flagged_at_read_out) {
    const Engine engine;
    const Input in = spoiled(1, 4);
    FixedMoments s(engine, values);
    s.add(batches_of(in));
    const Combined out = combine(s.moments(), 1.0f);
    EXPECT_EQ(out.flags.skipped, 4u);
    for (const std::size_t i : {std::size_t{3}, std::size_t{5}, std::size_t{700}, values - 1})
        EXPECT_TRUE(out.flag_image[i] & CLR_FLAG_SKIPPED) << i;
}

TEST(Fixed, misuse_is_refused_by_name) {
    const Engine engine, another;
    const std::vector<float> good(values, 1.0f), shorter(values - 1, 1.0f);
    FixedMoments s(engine, values);
    refused([&] { FixedMoments(engine, 0); }, "values");
    refused([&] { FixedMoments(engine, 1, {.nonfinite = NonFinite::propagate}); }, "nonfinite: expected skip or fail");
    refused([&] { FixedMoments(engine, 1, {.resolution = -1}); }, "resolution: expected 0 to 48 bits, got -1");
    refused([&] { FixedMoments(engine, 1, {.range = 49}); }, "range: expected 0 to 48 bits, got 49");
    refused([&] { FixedMoments(engine, 1, {.resolution = 7, .range = 8}); }, "resolution + range: expected 16 to 48");
    refused([&] { FixedMoments(engine, 1, {.resolution = 31, .range = 18}); }, "resolution + range: expected 16 to 48");
    refused([&] { s.add(good, shorter); }, "t: expected 1003 values, got 1002");
    refused([&] { s.add(shorter, good); }, "m: expected 1003 values, got 1002");
    for (const double weight : {0.0, -1.0, 0.5, 2.5, std::nan(""), std::numeric_limits<double>::infinity(), 1e30})
        refused([&] { s.add(good, good, weight); }, "weight: expected a whole sample count");
    refused([&] { s.add(good, good, 0x1p62); }, "weight: expected a sum of at most 8388607");
    const std::vector<HostBatch> many(5, {good, good, 0x1p61});
    refused([&] { s.add(many); }, "weight: expected a sum of at most 8388607");
    refused([&] { s.merge(FixedMoments(engine, values + 1)); }, "merge: expected 1003 values");
    refused([&] { s.merge(FixedMoments(another, values)); }, "same Engine");
    refused([&] { s.merge(FixedMoments(engine, values, {.resolution = 23})); },
            "merge: expected nonfinite=skip resolution=24 range=16");
    refused([&] { s.add(std::span<const Batch>{}, {}); }, "batches");
    const Batch nowhere{{nullptr, 0, values}, {nullptr, 0, values}};
    refused([&] { s.add(std::span(&nowhere, 1), {}); }, "m: expected a device buffer, got null");
    FixedMoments strict(engine, values, {.nonfinite = NonFinite::fail});
    refused([&] { strict.add(std::span(&nowhere, 1), {}); }, "NonFinite::fail");
    Moments wrong_size(engine, values + 1), elsewhere(another, values), ratios(engine, values, {.ratios = true});
    Moments in_groups(engine, values, {.groups = 2});
    refused([&] { Event(s.moments(wrong_size, {})); }, "moments: expected 1003 values");
    refused([&] { Event(s.moments(elsewhere, {})); }, "same Engine");
    refused([&] { Event(s.moments(ratios, {})); }, "moments: expected the fixed state's nonfinite policy");
    refused([&] { Event(s.moments(in_groups, {})); }, "one group");
    EXPECT_EQ(s.batches(), 0u);
}

// ---- snapshots

TEST(Fixed, a_snapshot_goes_there_and_back_with_the_same_bits) {
    const Engine engine({.width = 4}), another({.width = 16});
    for (const NonFinite policy : {NonFinite::skip, NonFinite::fail}) {
        const Input in = policy == NonFinite::skip ? spoiled(1, 5) : make_input(1, 5);
        FixedMoments s(engine, values, {.nonfinite = policy});
        s.add(batches_of(in));
        const Snapshot snapshot = s.snapshot();
        FixedMoments back(another, snapshot);
        EXPECT_EQ(all_limbs(back), all_limbs(s));
        EXPECT_EQ(back.snapshot(), snapshot);
        EXPECT_EQ(back.weight(), s.weight());
        EXPECT_EQ(back.negatives(), s.negatives());
        EXPECT_EQ(back.skipped(), s.skipped());
        EXPECT_EQ(snapshot.planes.size(), policy == NonFinite::skip ? 19u : 16u);
        const auto& low = snapshot.planes[4];
        EXPECT_EQ(low.name, "mm.0");
        EXPECT_EQ(low.words[9], static_cast<std::uint32_t>(s.limbs(&FixedPlanes::mm)[9]));
        back.add(batches_of(in));
        s.merge(FixedMoments(engine, snapshot));
        EXPECT_EQ(all_limbs(back), all_limbs(s));
        Snapshot merged = snapshot;
        merge(another, merged, snapshot);
        EXPECT_EQ(merged, s.snapshot());
    }
}

TEST(Fixed, snapshots_of_any_grouping_and_order_are_the_same) {
    const Input in = spoiled(3, 45);
    const Engine engine;
    FixedMoments together(engine, values);
    together.add(batches_of(in));
    const Snapshot want = together.snapshot();
    for (const std::uint64_t seed : {1, 2, 3}) {
        Samples draw(seed);
        for (const std::size_t parts : {3, 17, 40}) EXPECT_EQ(grouped(engine, in, parts, draw).snapshot(), want) << parts;
    }
}

TEST(Fixed, a_snapshot_that_does_not_fit_together_is_refused_by_name) {
    const Engine engine;
    FixedMoments s(engine, values);
    s.add(batches_of(make_input(1, 2)));
    const Snapshot good = s.snapshot();
    const auto spoilt = [&](auto change, const std::string& what) {
        Snapshot bad = good;
        change(bad);
        refused([&] { FixedMoments(engine, bad); }, what);
    };
    spoilt([](Snapshot& x) { x.kind = "moments"; }, "kind fixed");
    spoilt([](Snapshot& x) { x.settings[1].second = "23x"; }, "settings of a fixed state");
    spoilt([](Snapshot& x) { x.settings[1].second = "49"; }, "resolution");
    spoilt([](Snapshot& x) { x.settings.pop_back(); }, "settings of a fixed state");
    spoilt([](Snapshot& x) { x.groups.push_back({}); }, "1 group");
    spoilt([](Snapshot& x) { x.groups[0].weight = 0x1p23; }, "a whole weight");
    spoilt([](Snapshot& x) { x.groups[0].weight_low = 0.5; }, "a whole weight");
    spoilt([](Snapshot& x) { x.planes.pop_back(); }, "19 planes");
    spoilt([](Snapshot& x) { std::swap(x.planes[0], x.planes[1]); }, "plane m.0");
    spoilt([](Snapshot& x) { x.planes[3].words.pop_back(); }, "snapshot plane t.1: expected 1003 values");
    refused([&] { Moments(engine, good); }, "kind moments");
}

// ---- long runs

namespace {

/// The four inputs of the accumulation table (theory: progressive accumulation), and what 2^-24 may lose of the mean. The
/// table has one digit: what it calls 3e-11 is below 3.5e-11, and what it calls 0 is below the 2^-48 that two floats hold.
struct LongRun {
    const char* name;
    double mean_error;  // relative, after 10^6 batches
    float (*draw)(Samples&);
};

const LongRun long_runs[] = {
    {"mean 1 sd .05", 0, [](Samples& s) { return static_cast<float>(1 + 0.05 * s.normal()); }},
    {"lognormal mean 1 sd 1", 3.5e-11, [](Samples& s) { return static_cast<float>(s.lognormal(0.8325546)); }},
    {"mean 100 sd .01", 0, [](Samples& s) { return static_cast<float>(100 + 0.01 * s.normal()); }},
    {"constant .1", 2.5e-7, [](Samples&) { return 0.1f; }}};

double pair(const std::vector<std::uint32_t>& bits, std::size_t i) {
    return static_cast<double>(std::bit_cast<float>(bits[i])) +
           static_cast<double>(std::bit_cast<float>(bits[bits.size() / 2 + i]));
}

/// Against the values before they are quantised.
void long_run(std::size_t count, double allowance) {
    constexpr std::size_t lanes = 16, per_call = 8;
    const Engine engine;
    for (const auto& run : long_runs) {
        Samples draw(1);
        const auto x = floats(lanes * count, [&] { return static_cast<double>(run.draw(draw)); });
        const Buffer on_device = Buffer::from_host(engine, std::as_bytes(std::span(x)));
        FixedMoments s(engine, lanes);
        for (std::size_t k = 0; k < count; k += per_call) {
            std::vector<Batch> batches;
            for (std::size_t b = k; b < k + per_call; ++b) {
                const View view{on_device.mem(), b * lanes, lanes};
                batches.push_back({view, view});
            }
            const Event done(s.add(batches, {}));
            if (k % 8000 == 0) wait(done);
        }
        const Moments moments = s.moments();
        const auto mean = moments.bits(&StatePlanes::m);
        for (std::size_t i = 0; i < lanes; ++i) {
            Integer sum = 0;  // in units of 2^-60, which holds every float from 2^-36 on
            for (std::size_t k = i; k < x.size(); k += lanes) sum += Integer(std::ldexp(static_cast<double>(x[k]), 60));
            const double truth = std::ldexp(static_cast<double>(Integer(sum / count)), -60);
            EXPECT_LE(std::fabs(pair(mean, i) / truth - 1), run.mean_error * allowance + 0x1p-48) << run.name;
        }
    }
}

}  // namespace

TEST(Fixed, ten_thousand_batches_stay_within_the_fixed_point_column) { long_run(10'000, 10); }  // sqrt(10^6 / 10^4)
TEST(FixedSlow, a_million_batches_stay_within_the_fixed_point_column) { long_run(1'000'000, 1); }

// ---- oclgrind

namespace {

void run_every_kernel(const EngineOptions& options) {
    const Engine engine(options);
    const std::vector<float> m{1, -2, 3, 4, 5, 6, 7, not_a_number, 9, 10, 11, 1e9f, 13}, t(13, 2.0f), fine(13, 1.0f);
    FixedMoments a(engine, 13), b(engine, 13), strict(engine, 13, {.nonfinite = NonFinite::fail});
    a.add(m, t, 3);
    b.add(std::vector<HostBatch>{{m, t, 1}, {t, m, 2}, {t, fine, 7}});
    a.merge(b);
    strict.add(fine, t);
    EXPECT_THROW(strict.add(m, t), InvalidArgument);
    EXPECT_EQ(a.moments().skipped(), 6u);
    EXPECT_EQ(strict.moments().batches(), 1u);
}

}  // namespace

TEST(FixedSmall, every_kernel) {
    using Path = EngineOptions::Path;
    run_every_kernel({.width = 4, .path = Path::ranges, .work_items = 2, .disk_cache = false});
    run_every_kernel({.width = 1, .path = Path::groups, .work_items = 4, .disk_cache = false});
}

TEST(Fixed, kernels_are_clean_under_oclgrind) { expect_clean_under_oclgrind("fixed_test", "FixedSmall.*"); }
