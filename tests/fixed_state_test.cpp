// Fixed-point states on disk: the same bytes, whoever added which batches, and however their files were merged.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "clratio/fixed.hpp"
#include "clratio/state.hpp"
#include "support/samples.hpp"
#include "support/scratch.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

constexpr int width = 7, height = 5;
constexpr std::size_t values = width * height * 3, batches = 40;

struct Input {
    std::vector<float> m, t;
};

std::vector<Input> make_input() {
    Samples draw(1);
    std::vector<Input> all(batches);
    for (auto& b : all) {
        b.t = floats(values, [&] { return draw.lognormal(0.8); });
        b.m = b.t;
        for (float& x : b.m) x *= static_cast<float>(draw.uniform());
    }
    all[3].m[11] = std::numeric_limits<float>::quiet_NaN();
    all[9].t[12] = 1e6f;
    return all;
}

template <class Kind> StateFile state_of(const Kind& sums, const std::vector<std::size_t>& indices) {
    StateFile s;
    s.sums = sums.snapshot();
    s.shape.channels = {"R", "G", "B"};
    s.shape.data_window = {0, 0, width - 1, height - 1};
    s.shape.display_window = s.shape.data_window;
    for (const std::size_t k : indices) s.ranges.add({k, k + 1});
    return s;
}

/// Each batch in one of `parts` files at random, in a random order; the file they merge to.
template <class Kind>
std::string bytes_of_parts(const Engine& engine, const std::vector<Input>& in, std::size_t parts, Samples& draw) {
    const Scratch scratch;
    std::vector<std::size_t> order(batches);
    for (std::size_t k = 0; k < batches; ++k) order[k] = k;
    for (std::size_t k = batches; k > 1; --k) std::swap(order[k - 1], order[draw.bits() % k]);
    std::vector<std::vector<std::size_t>> of_part(parts);
    for (std::size_t k = 0; k < batches; ++k) of_part[k < parts ? k : draw.bits() % parts].push_back(order[k]);
    std::vector<std::filesystem::path> paths;
    for (std::size_t p = 0; p < parts; ++p) {
        Kind sum(engine, values);
        for (const std::size_t k : of_part[p]) sum.add(in[k].m, in[k].t, static_cast<double>(1 + k % 3));
        paths.emplace_back(scratch / std::to_string(p));
        write_state(paths.back(), state_of(sum, of_part[p]));
    }
    write_state(scratch / "merged", merge_states(engine, paths));
    return bytes_of(scratch / "merged");
}

}  // namespace

TEST(FixedState, any_grouping_and_order_of_3_to_40_parts_gives_the_same_file) {
    const Engine engine;
    const auto in = make_input();
    Samples first(1);
    const std::string want = bytes_of_parts<FixedMoments>(engine, in, 1, first);
    for (const std::uint64_t seed : {1, 2, 3}) {
        Samples draw(seed);
        for (const std::size_t parts : {std::size_t{3}, static_cast<std::size_t>(3 + draw.bits() % 38), std::size_t{40}})
            EXPECT_TRUE(bytes_of_parts<FixedMoments>(engine, in, parts, draw) == want) << "seed " << seed << ", " << parts;
    }
}

TEST(FixedState, two_float_files_show_the_grouping) {
    const Engine engine;
    const auto in = make_input();
    Samples draw(1);
    const std::string one = bytes_of_parts<Moments>(engine, in, 1, draw);
    EXPECT_FALSE(bytes_of_parts<Moments>(engine, in, 17, draw) == one);
}

TEST(FixedState, there_and_back_and_not_to_be_merged_with_moments) {
    const Engine engine;
    const Scratch scratch;
    const auto in = make_input();
    FixedMoments fixed(engine, values);
    Moments two_float(engine, values);
    fixed.add(in[3].m, in[3].t);
    two_float.add(in[4].m, in[4].t);
    write_state(scratch / "a", state_of(fixed, {3}));
    write_state(scratch / "b", state_of(two_float, {4}));
    const StateFile back = read_state(scratch / "a");
    EXPECT_EQ(back.sums, fixed.snapshot());
    EXPECT_EQ(FixedMoments(engine, back.sums).skipped(), 1u);
    EXPECT_NE(mismatch(back, read_state(scratch / "b")), "");
}
