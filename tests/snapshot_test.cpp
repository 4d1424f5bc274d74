#include "clratio/snapshot.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "clratio/combine.hpp"
#include "clratio/fixed.hpp"
#include "support/refused.hpp"
#include "support/samples.hpp"

using namespace clratio;
using clratio::test::floats;
using clratio::test::refused;
using clratio::test::Samples;

namespace {

constexpr std::size_t values = 1003;  // no multiple of any width

std::vector<MomentsOptions> all_options() {
    std::vector<MomentsOptions> all;
    for (const NonFinite n : {NonFinite::skip, NonFinite::propagate, NonFinite::fail})
        for (const bool ratios : {false, true}) all.push_back({n, ratios});
    for (const NonFinite n : {NonFinite::skip, NonFinite::propagate}) all.push_back({n, false, 3, Weights::reliability});
    all.push_back({NonFinite::skip, true, 16});
    return all;
}

/// Adds batches with NaN, negative values, zeros and weights that no double holds the sum of.
void add_some(Moments& sum, std::uint64_t seed, int batches) {
    Samples draw(seed);
    for (int k = 0; k < batches; ++k) {
        auto t = floats(values, [&] { return draw.uniform() < .1 ? 0 : draw.lognormal(.8); });
        auto m = floats(values, [&] { return draw.normal(); });
        if (sum.options().nonfinite != NonFinite::fail) {
            m[static_cast<std::size_t>(7 * k + 3)] = std::numeric_limits<float>::quiet_NaN();
            t[values - 1] = k == 2 ? std::numeric_limits<float>::infinity() : t[values - 1];
        }
        sum.add(m, t, k == 0 ? 1e10 : std::exp(draw.normal()));
    }
}

Moments made(const Engine& engine, MomentsOptions options, std::uint64_t seed, int batches) {
    Moments sum(engine, values, options);
    add_some(sum, seed, batches);
    return sum;
}

}  // namespace

TEST(Snapshot, there_and_back_has_the_same_bits_and_goes_on_the_same) {
    const Engine engine;
    for (const auto& options : all_options())
        for (const int batches : {0, 1, 5, 11}) {
            Moments sum = made(engine, options, 1, batches);
            Moments back(engine, sum.snapshot());
            EXPECT_EQ(back.snapshot(), sum.snapshot()) << batches;
            EXPECT_EQ(back.weight(), sum.weight());
            EXPECT_EQ(back.negatives(), sum.negatives());
            EXPECT_EQ(back.skipped(), sum.skipped());
            add_some(sum, 2, 9);
            add_some(back, 2, 9);
            EXPECT_EQ(back.snapshot(), sum.snapshot()) << batches << " and 9 more";
        }
}

TEST(Snapshot, comparing_sees_a_batch_too_many) {
    const Engine engine;
    EXPECT_NE(made(engine, {}, 1, 5).snapshot(), made(engine, {}, 1, 6).snapshot()) << "planted fault";
}

TEST(Snapshot, holds_what_the_planes_hold) {
    const Engine engine;
    const Moments sum = made(engine, {.ratios = true}, 1, 5);
    const Snapshot s = sum.snapshot();
    EXPECT_EQ(s.kind, "moments");
    EXPECT_EQ(s.batches(), 5u);
    EXPECT_EQ(s.planes.size(), 19u);
    const auto expect_plane = [&](const std::string& name, cl_mem StatePlanes::*plane) {
        auto words = std::find_if(s.planes.begin(), s.planes.end(), [&](auto& p) { return p.name == name + ".hi"; })->words;
        const auto low = std::find_if(s.planes.begin(), s.planes.end(), [&](auto& p) { return p.name == name + ".lo"; });
        words.insert(words.end(), low->words.begin(), low->words.end());
        EXPECT_EQ(words, sum.bits(plane)) << name;
    };
    expect_plane("m", &StatePlanes::m);
    expect_plane("t", &StatePlanes::t);
    expect_plane("mm", &StatePlanes::mm);
    expect_plane("tt", &StatePlanes::tt);
    expect_plane("mt", &StatePlanes::mt);
    expect_plane("weight", &StatePlanes::weight);
    expect_plane("quotient", &StatePlanes::quotient);
    expect_plane("zero_m", &StatePlanes::zero_m);
    expect_plane("zero_share", &StatePlanes::zero_share);
    EXPECT_EQ(s.planes[12].name, "batches");
    EXPECT_EQ(s.planes[12].words, sum.bits(&StatePlanes::batches));
}

TEST(Snapshot, groups_have_planes_of_their_own) {
    const Engine engine;
    const Moments sum = made(engine, {.groups = 3}, 1, 5);
    const Snapshot s = sum.snapshot();
    ASSERT_EQ(s.groups.size(), 3u);
    EXPECT_EQ(s.groups[0].batches, 2u);
    EXPECT_EQ(s.groups[2].batches, 1u);
    EXPECT_EQ(s.planes[13].name, "g1.m.hi");
    const auto all = sum.bits(&StatePlanes::m);
    EXPECT_TRUE(std::equal(all.begin() + 2 * values, all.begin() + 3 * values, s.planes[13].words.begin()));
}

TEST(Snapshot, slices_append_to_the_whole) {
    const Engine engine;
    const Snapshot whole = made(engine, {}, 1, 3).snapshot();
    Snapshot joined;
    for (const std::uint64_t begin : {0u, 400u, 1000u}) {
        Snapshot part = slice(whole, begin, std::min<std::uint64_t>(begin == 0 ? 400 : 600, values - begin));
        part.negatives = begin == 0 ? whole.negatives : 0;
        part.skipped = begin == 0 ? whole.skipped : 0;
        append(joined, part);
    }
    EXPECT_EQ(joined, whole);
    EXPECT_EQ(slice(whole, values, 0).values, 0u);
    refused([&] { slice(whole, 1, values); }, "slice: expected values of a snapshot that has 1003");
}

TEST(Snapshot, merge_is_that_of_the_states) {
    const Engine engine;
    for (const auto& options : all_options()) {
        Moments a = made(engine, options, 1, 3);
        const Moments b = made(engine, options, 2, 4);
        Snapshot merged = a.snapshot(), swapped = b.snapshot();
        merge(engine, merged, b.snapshot());
        merge(engine, swapped, a.snapshot());
        a.merge(b);
        EXPECT_EQ(merged, a.snapshot());
        EXPECT_NE(swapped, a.snapshot()) << "planted fault: the other order";
    }
}

TEST(Snapshot, misfits_are_refused_by_name) {
    const Engine engine;
    const Snapshot good = made(engine, {}, 1, 3).snapshot();
    const auto refuse = [&](auto change, const std::string& what) {
        Snapshot bad = good;
        change(bad);
        refused([&] { Moments(engine, bad); }, what);
    };
    refuse([](auto& s) { s.kind = "fixed"; }, "expected kind moments, got fixed");
    refuse([](auto& s) { s.settings.pop_back(); }, "expected the setting weights, got none");
    refuse([](auto& s) { s.settings[1].second = "2"; }, "got ratios=2");
    refuse([](auto& s) { s.settings[0].second = "maybe"; }, "got nonfinite=maybe");
    refuse([](auto& s) { s.settings.push_back({"colour", "red"}); }, "got colour=red");
    refuse([](auto& s) { s.settings[2].second = "x"; }, "got groups=x");
    refuse([](auto& s) { s.settings[2].second = "17"; }, "groups: expected 1 to 16, got 17");
    refuse([](auto& s) { s.groups.clear(); }, "1 groups, got 0");
    refuse([](auto& s) { s.groups[0].weight2_low = .1; }, "weight");
    refuse([](auto& s) { s.planes.pop_back(); }, "13 planes, got 12");
    refuse([](auto& s) { s.planes[3].name = "x"; }, "plane t.lo, got x");
    refuse([](auto& s) { s.planes[3].words.pop_back(); }, "plane t.lo: expected 1003 values, got 1002");
    refuse([](auto& s) { s.values = 0; }, "values");
    refuse([](auto& s) { s.groups[0].weight = 0; }, "weight");
    refuse([](auto& s) { s.groups[0].weight = -1; }, "weight");
    refuse([](auto& s) { s.groups[0].weight = .1; }, "weight");
    refuse([](auto& s) { s.groups[0].weight = std::numeric_limits<double>::quiet_NaN(); }, "weight");
    refuse([](auto& s) { s.groups[0].batches = 0; }, "weight");
    refuse([](auto& s) { s.groups[0].batches = std::uint64_t{1} << 32; }, "2^32 - 1");
    const auto refuse_with = [&](const Snapshot& right, auto change, const std::string& what) {
        Snapshot other = right;
        change(other);
        Snapshot into = right;
        refused([&] { merge(engine, into, other); }, what);
        EXPECT_EQ(into, right);
    };
    const auto refuse_merge = [&](auto change, const std::string& what) { refuse_with(good, change, what); };
    refuse_merge([](auto& s) { s.values = 7; }, "merge: expected 1003 values, got 7");
    refuse_merge([](auto& s) { s.kind = "fixed"; }, "merge: expected a state of kind moments, got fixed");
    refuse_merge([](auto& s) { s.settings[0].second = "propagate"; },
                 "merge: expected settings nonfinite=skip ratios=0 groups=1 weights=samples, got nonfinite=propagate");
    FixedMoments whole_numbers(engine, 3);
    whole_numbers.add(std::vector<float>{1, 2, 3}, std::vector<float>{4, 5, 6});
    const Snapshot fixed = whole_numbers.snapshot();
    const auto shorten = [](auto& s) { s.planes.back().words.pop_back(); };
    refuse_merge(shorten, "snapshot plane batches: expected 1003 values, got 1002");
    refuse_with(fixed, shorten, "snapshot plane batches: expected 3 values, got 2");
    refuse_with(
        fixed, [](auto& s) { s.planes[0].name = "x"; }, "plane m.0, got x");
    refuse_with(
        slice(fixed, 0, 0), [](auto&) {}, "merge: expected at least 1 value, got 0");
    Snapshot twice = good, other = good;
    other.planes.back().name = "x";
    refused([&] { append(twice, other); }, "append: expected plane batches, got x");
    EXPECT_EQ(twice, good);
    append(twice, twice);
    EXPECT_EQ(slice(twice, 0, values).planes, good.planes);
    EXPECT_EQ(slice(twice, values, values).planes, good.planes);
}
