// combine --fixed and merge, run as a user runs them.
#include <gtest/gtest.h>

#include <cmath>

#include "support/state_tool.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

/// The file of batches [0, 6), added in these parts and merged in this order.
std::string file_of_parts(const Batches& batches, const std::vector<std::pair<int, int>>& parts, const Words& how) {
    const Scratch scratch;
    Words merge{"merge"};
    for (const auto& [begin, end] : parts) {
        const std::string part = scratch / (std::to_string(begin) + ".exr");
        answer(batches.combine(begin, end) + Words{"--state", part, "--first-batch", std::to_string(begin)} + how);
        merge.push_back(part);
    }
    answer(merge + Words{"-o", scratch / "all.exr"});
    return bytes_of(scratch / "all.exr");
}

}  // namespace

TEST(FixedTool, sums_are_the_same_file_for_any_parts) {
    const Batches batches(6);
    const Words fixed{"--fixed", "24"};
    const std::string whole = file_of_parts(batches, {{0, 6}}, fixed);
    EXPECT_TRUE(file_of_parts(batches, {{4, 6}, {0, 1}, {1, 4}}, fixed) == whole);
    EXPECT_TRUE(file_of_parts(batches, {{3, 6}, {0, 3}}, fixed) == whole);
    EXPECT_FALSE(file_of_parts(batches, {{3, 6}, {0, 3}}, {}) == file_of_parts(batches, {{0, 6}}, {}))
        << "planted fault: sums that are rounded";
}

// Values, and so their means, move by 2^-25 at most; a ratio of float means is then rounded, and times tau = 1.
TEST(FixedTool, sums_read_out_as_the_others_do) {
    const Scratch scratch;
    const Batches batches(6);
    const Words read{"--tau", "1", "--stderr", scratch / "e.exr"};
    answer(batches.combine(0, 6) + read + Words{"-o", scratch / "two.exr"});
    const json j = answer(batches.combine(0, 6) + read + Words{"-o", scratch / "fixed.exr", "--fixed", "24"});
    EXPECT_EQ(j["flags"]["skipped"], 1) << "the NaN";
    EXPECT_EQ(j["outside_range"], 0);
    const Image two = read_image(scratch / "two.exr"), fixed = read_image(scratch / "fixed.exr");
    std::vector<double> t(state_values);
    for (int k = 0; k < 6; ++k) {
        const Image image = read_image(batches.t_file(k));
        for (std::size_t i = 0; i < t.size(); ++i) t[i] += static_cast<double>(image.values[i]) / 6;
    }
    for (std::size_t i = 0; i < t.size(); ++i) {
        if (i == 3) continue;  // a NaN has left five batches
        const double ratio = static_cast<double>(two.values[i]), size = std::fabs(ratio);
        EXPECT_NEAR(static_cast<double>(fixed.values[i]), ratio, 0x1p-25 * (1 + size) / (t[i] - 0x1p-25) + 0x1p-23 * size);
    }

    const json narrow =
        answer(batches.combine(0, 6) + read + Words{"-o", scratch / "o.exr", "--fixed", "24", "--range", "0"});
    EXPECT_GT(narrow["outside_range"], 0) << "values above 1";
    EXPECT_GT(narrow["flags"]["skipped"], 1);
}

TEST(FixedTool, sums_refuse_what_they_cannot_keep) {
    const Scratch scratch;
    const Batches batches(2);
    const std::string state = scratch / "s.exr", two = scratch / "two.exr";
    const Words add = batches.combine(0, 1), fixed{"--state", state, "--fixed", "24"};
    for (const Words& more : {Words{"--groups", "2"}, Words{"--estimator", "mickey"}, Words{"--estimator", "hartley-ross"},
                              Words{"--weights", "reliability"}, Words{"--nonfinite", "propagate"}})
        expect_refused(add + fixed + more, 2, more[0] + " " + more[1] + ": not with --fixed");
    expect_refused(add + fixed + Words{"--weight", "1.5"}, 2, "whole numbers from 1 on, got 1.5");
    expect_refused(add + fixed + Words{"--range", "25"}, 2, "16 to 48 bits together, got 49");
    expect_refused(add + Words{"--state", state, "--range", "8"}, 2, "--range requires --fixed");
    expect_refused(add + fixed + Words{"--weight", "8388608"}, 2, "--weight: the batches have 8388608 samples");
    EXPECT_FALSE(std::filesystem::exists(state));
    answer(add + fixed);
    const Words full = batches.combine(0, 2) + Words{"--resume", "--state", state, "--weight", "1", "8388607"};
    expect_refused(full, 1, "its --weight 8388607 brings the sum to 8388608");
    EXPECT_EQ(inspect_state(state).ranges.text(), "[0,1)") << "the batch before is kept";
    answer(add + Words{"--state", two});
    const Words on = batches.combine(0, 2) + Words{"--resume", "--state"};
    expect_refused(on + Words{state, "--fixed", "20"}, 2,
                   "--fixed 20 does not fit --state " + state + ", which was recorded with --fixed 24");
    expect_refused(on + Words{state, "--fixed", "24", "--range", "8"}, 2, "recorded with --range 16");
    expect_refused(on + Words{two, "--fixed", "24"}, 2, "recorded without it");
    expect_refused({"merge", state, two, "-o", scratch / "m.exr"}, 1, "kind of sums: fixed and moments");
    EXPECT_EQ(answer(on + Words{state})["state"]["ranges"], "[0,2)") << "a state says itself how it is kept";
}
