#include "clratio/state.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/exr.hpp"
#include "support/samples.hpp"
#include "support/scratch.hpp"

using namespace clratio;
using clratio::test::floats;
using clratio::test::Samples;
using clratio::test::Scratch;

namespace {

constexpr int width = 5, height = 3;

StateFile made(const Engine& engine, std::uint64_t first, std::uint64_t batches, MomentsOptions options = {}) {
    StateFile s;
    s.shape.channels = {"R", "G", "B"};
    s.shape.data_window = {-2, 7, -2 + width - 1, 7 + height - 1};
    s.shape.display_window = {0, 0, 9, 9};
    s.shape.alpha.assign(width * height, .5f);
    s.settings = {{"layer.m", "shadow"}, {"layer.t", ""}};
    Moments sum(engine, 3 * width * height, options);
    for (std::uint64_t k = first; k < first + batches; ++k) {
        Samples draw(k);
        const auto m = floats(sum.size(), [&] { return k == 1 ? std::nan("") : draw.normal(); });
        sum.add(m, floats(sum.size(), [&] { return draw.uniform(); }));
    }
    s.sums = sum.snapshot();
    s.ranges.add({first, first + batches});
    return s;
}

void expect_same(const StateFile& a, const StateFile& b) {
    EXPECT_EQ(a.sums, b.sums);
    EXPECT_EQ(a.shape.channels, b.shape.channels);
    EXPECT_EQ(a.shape.data_window, b.shape.data_window);
    EXPECT_EQ(a.shape.display_window, b.shape.display_window);
    EXPECT_EQ(a.shape.alpha, b.shape.alpha);
    EXPECT_EQ(a.settings, b.settings);
    EXPECT_EQ(a.ranges, b.ranges);
}

}  // namespace

TEST(State, there_and_back) {
    const Scratch scratch;
    const Engine engine;
    for (const auto options : {MomentsOptions{}, MomentsOptions{NonFinite::propagate, true}}) {
        const StateFile s = made(engine, 3, 4, options);
        write_state(scratch / "a.exr", s);
        expect_same(read_state(scratch / "a.exr"), s);
        const StateFile head = inspect_state(scratch / "a.exr");
        EXPECT_EQ(head.ranges, s.ranges);
        EXPECT_EQ(head.sums.groups, s.sums.groups);
        EXPECT_TRUE(head.sums.planes.empty());
        write_state(scratch / "b.exr", read_state(scratch / "a.exr"));
        EXPECT_EQ(clratio::test::bytes_of(scratch / "a.exr"), clratio::test::bytes_of(scratch / "b.exr"));
    }
}
