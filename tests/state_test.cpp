#include "clratio/state.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <numeric>
#include <set>

#include "support/limited.hpp"
#include "support/refused.hpp"
#include "support/scratch.hpp"
#include "support/states.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

/// What reading throws; fails the test where it does not.
std::string reason(const std::string& path) {
    try {
        read_state(path);
    } catch (const IoError& e) {
        EXPECT_EQ(e.path, path);
        return e.reason;
    }
    ADD_FAILURE() << path << " was read";
    return "";
}

void expect_in(const std::string& part, const std::string& text) {
    EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in: " << text;
}

}  // namespace

// ---- ranges

TEST(State, ranges_join_and_stay_sorted_whatever_the_order) {
    std::vector<std::uint64_t> order{0, 1, 2, 3, 4, 7, 9};
    do {
        BatchRanges r;
        for (const auto k : order) r.add({k, k + 1});
        ASSERT_EQ(r.text(), "[0,5) [7,8) [9,10)");
    } while (std::next_permutation(order.begin(), order.end()));
    BatchRanges r = BatchRanges::parse("[0,5) [7,8) [9,10)");
    r.add({5, 7});
    EXPECT_EQ(r.text(), "[0,8) [9,10)");
    EXPECT_EQ(r.count(), 9u);
    EXPECT_TRUE(r.contains(7) && r.contains(9));
    EXPECT_FALSE(r.contains(8) || r.contains(10));
    for (const std::uint64_t groups : {1u, 2u, 3u, 20u})
        for (std::uint64_t g = 0; g < groups; ++g) {
            std::uint64_t count = 0;
            for (std::uint64_t k = 0; k < 10; ++k) count += k != 8 && k % groups == g;
            EXPECT_EQ(r.count(g, groups), count);
        }
}

TEST(State, ranges_that_overlap_or_are_empty_are_refused) {
    BatchRanges r = BatchRanges::parse("[2,5) [8,9)");
    for (const BatchRanges::Range bad : {BatchRanges::Range{4, 6}, {0, 3}, {0, 20}, {3, 4}, {8, 9}})
        refused([&] { r.add(bad); }, "ranges: expected batches that are not there yet");
    refused([&] { r.add({6, 6}); }, "at least one batch");
    for (const std::string text : {"[0,4", "0,4)", "[0,4)[5,6)", "[4,0)", "[5,6) [0,4)", "[0,4) [4,5)", "[0,4) ", "[-1,4)",
                                   "[0,99999999999999999999)", "x"})
        EXPECT_THROW(BatchRanges::parse(text), InvalidArgument) << text;
    EXPECT_EQ(BatchRanges::parse("").count(), 0u);
    EXPECT_EQ(r.overlap(BatchRanges::parse("[0,2) [5,8) [9,11)")), std::nullopt);
    EXPECT_EQ(r.overlap(BatchRanges::parse("[0,2) [4,7)")), (BatchRanges::Range{4, 5}));
    EXPECT_EQ(r.first_beyond(BatchRanges::parse("[0,20)")), std::nullopt);
    EXPECT_EQ(r.first_beyond(BatchRanges::parse("[0,4) [8,9)")), 4u);
    EXPECT_EQ(r.first_beyond(BatchRanges::parse("[2,6)")), 8u);
    EXPECT_EQ(r.first_beyond(BatchRanges()), 2u);
    refused([&] { r.count(0, 0); }, "groups: expected at least 1");
}

// OpenEXR cuts names at 255 bytes, and those of a state begin with its planes'.
TEST(State, names_that_would_be_cut_or_read_back_as_others_are_refused) {
    const Scratch scratch;
    const Engine engine;
    StateFile state = state_of(engine, 0, 1);
    state.shape.channels.front() = std::string(245, 'x');
    write_state(scratch / "a.exr", state);
    EXPECT_EQ(read_state(scratch / "a.exr").shape.channels, state.shape.channels);
    state.shape.channels.front() += 'x';
    refused([&] { write_state(scratch / "b.exr", state); }, "channels: expected names that leave room for weight.hi");
    state.shape.channels.front() = "x";
    state.settings.emplace_back("a=b", "c");
    refused([&] { write_state(scratch / "b.exr", state); }, "settings: expected names without =");
    EXPECT_EQ(scratch.files(), 1u);
}

// ---- there and back

TEST(State, there_and_back_has_the_same_bits_and_the_same_bytes) {
    const Scratch scratch;
    const Engine engine;
    for (const auto options : {MomentsOptions{}, MomentsOptions{NonFinite::propagate, true},
                               MomentsOptions{NonFinite::skip, false, 2, Weights::reliability}}) {
        const StateFile s = state_of(engine, 3, 4, options);
        write_state(scratch / "a.exr", s);
        const StateFile back = read_state(scratch / "a.exr");
        EXPECT_TRUE(same(back, s));
        EXPECT_FALSE(same(back, state_of(engine, 3, 5, options))) << "planted fault: a batch more";
        EXPECT_EQ(back.shape.path, scratch / "a.exr");
        write_state(scratch / "b.exr", back);
        EXPECT_EQ(bytes_of(scratch / "a.exr"), bytes_of(scratch / "b.exr"));
        const StateFile head = inspect_state(scratch / "a.exr");
        EXPECT_EQ(head.ranges, s.ranges);
        EXPECT_EQ(head.sums.groups, s.sums.groups);
        EXPECT_TRUE(head.sums.planes.empty());
    }
    EXPECT_EQ(scratch.files(), 2u);
}

TEST(State, carries_what_the_first_batch_said_about_itself) {
    const Scratch scratch;
    const Engine engine;
    const Image first = read_image(CLRATIO_TEST_DATA "/cycles/area/m_000.exr");
    StateFile s = state_of(engine, 0, 1);
    s.shape.metadata = first.metadata;
    write_state(scratch / "a.exr", s);
    Image like = state_shape();
    like.metadata = read_state(scratch / "a.exr").shape.metadata;
    like.values.resize(state_values);
    write_image(scratch / "b.exr", like);
    const Imf::InputFile file((scratch / "b.exr").c_str());
    EXPECT_EQ(file.header().typedAttribute<Imf::StringAttribute>("Camera").value(), "Camera");
    EXPECT_EQ(file.header().findTypedAttribute<Imf::StringAttribute>("clratio/state"), nullptr)
        << "an image is no state, even one that was read out of a state";
}

TEST(State, is_an_image_that_others_can_open) {
    const Scratch scratch;
    const Engine engine;
    const StateFile s = state_of(engine, 0, 2);
    write_state(scratch / "a.exr", s);
    const Image mean = read_image(scratch / "a.exr:m.hi");
    EXPECT_EQ(mean.channels, s.shape.channels);
    EXPECT_EQ(0, std::memcmp(mean.values.data(), s.sums.planes[0].words.data(), 4 * state_values));
    EXPECT_EQ(read_image(scratch / "a.exr:batches").values[0], static_cast<float>(s.sums.planes[12].words[0]));
}

// ---- refusals

TEST(State, what_does_not_fit_together_is_not_written) {
    const Scratch scratch;
    const Engine engine;
    StateFile grouped = state_of(engine, 0, 3, {.groups = 2});
    grouped.ranges = BatchRanges::parse("[1,4)");
    refused([&] { write_state(scratch / "a.exr", grouped); }, "2 batches in group 0, got 1 in [1,4)");
    const StateFile good = state_of(engine, 0, 3);
    const auto refuse = [&](auto change, const std::string& what) {
        StateFile bad = good;
        change(bad);
        refused([&] { write_state(scratch / "a.exr", bad); }, what);
    };
    refuse([](auto& s) { s.ranges = BatchRanges::parse("[0,4)"); }, "3 batches in group 0, got 4 in [0,4)");
    refuse([](auto& s) { s.ranges = {}; }, "ranges: expected at least one batch");
    refuse([](auto& s) { s.sums.groups.clear(); }, "at least one group");
    refuse([](auto& s) { s.sums.groups.push_back({}); }, "3 batches in group 0, got 2");
    refuse([](auto& s) { s.sums.values = 7; }, "45 values");
    refuse([](auto& s) { s.sums.planes[3].words.pop_back(); }, "plane t.lo");
    refuse([](auto& s) { s.shape.alpha.pop_back(); }, "alpha");
    refuse([](auto& s) { s.shape.channels = {"R", "R", "B"}; }, "channels");
    refuse([](auto& s) { s.shape.data_window = {}; }, "data_window");
    EXPECT_EQ(scratch.files(), 0u);
}

TEST(State, a_wrong_file_is_refused_by_what_is_wrong) {
    const Scratch scratch;
    const Engine engine;
    const std::string good = scratch / "good.exr", bad = scratch / "bad.exr";
    write_state(good, state_of(engine, 0, 3));
    const auto why = [&](auto change) {
        rewrite(good, bad, change);
        return reason(bad);
    };
    rewrite(good, bad, [](Imf::Header&) {});
    EXPECT_TRUE(same(read_state(bad), read_state(good))) << "the copying itself changes nothing";
    using Strings = Imf::StringVectorAttribute;
    expect_in("no such file", reason(scratch / "none.exr"));
    expect_in("version 2; this program reads version 1", why([](auto& h) { set_text(h, "clratio/state", "2"); }));
    expect_in("is no state", why([](auto& h) { h.erase("clratio/state"); }));
    expect_in("no attribute clratio/groups", why([](auto& h) { h.erase("clratio/groups"); }));
    expect_in("no attribute clratio/checksum", why([](auto& h) { h.erase("clratio/checksum"); }));
    expect_in("3 batches in group 0, got 4 in [0,4)", why([](auto& h) { set_text(h, "clratio/ranges", "[0,4)"); }));
    expect_in("at least one batch", why([](auto& h) { set_text(h, "clratio/ranges", ""); }));
    expect_in("'3 3 0' are not the numbers", why([](auto& h) { h.insert("clratio/groups", Strings({"3 3 0"})); }));
    expect_in("'three' are not the numbers", why([](auto& h) { set_text(h, "clratio/skipped", "three"); }));
    expect_in("channel m.lo.G is missing", why([](auto& h) { drop_channel(h, "m.lo.G"); }));
    expect_in("channel depth is unknown", why([](auto& h) { h.channels().insert("depth", Imf::Channel(Imf::FLOAT)); }));
    expect_in("channel batches.R is of another type",
              why([](auto& h) { h.channels().insert("batches.R", Imf::Channel(Imf::FLOAT)); }));
    expect_in("values are not those", why([](auto& h) { set_text(h, "clratio/ranges", "[1,4)"); }));
    expect_in("values are not those", why([](auto& h) { drop_channel(h, "A"); }));
    expect_in("values are not those", why([](auto& h) {
                  h.insert("clratio/sums", Strings({"nonfinite=fail", "ratios=0"}));
              }));
    put_bytes(bad, "not an image");
    expect_in("not an OpenEXR file", reason(bad));
}

TEST(State, a_file_cut_short_anywhere_is_refused) {
    const Scratch scratch;
    const Engine engine;
    write_state(scratch / "a.exr", state_of(engine, 0, 3));
    const std::string whole = bytes_of(scratch / "a.exr");
    for (std::size_t length = 0; length < whole.size(); ++length) {
        put_bytes(scratch / "b.exr", whole.substr(0, length));
        ASSERT_THROW(read_state(scratch / "b.exr"), IoError) << length << " of " << whole.size() << " bytes";
    }
}

// Every byte: all its bits, or one of them. What is read all the same (OpenEXR skips reserved bytes) must be the same.
TEST(State, no_damaged_byte_makes_another_state) {
    const Scratch scratch;
    const Engine engine;
    const StateFile s = state_of(engine, 0, 3);
    write_state(scratch / "a.exr", s);
    std::string damaged = bytes_of(scratch / "a.exr");
    for (std::size_t at = 0; at < damaged.size(); ++at) {
        const char was = damaged[at];
        damaged[at] = static_cast<char>(was ^ (at % 2 == 0 ? 0xff : 1 << at / 2 % 8));
        put_bytes(scratch / "b.exr", damaged);
        damaged[at] = was;
        try {
            ASSERT_TRUE(same(read_state(scratch / "b.exr"), s)) << "byte " << at << " of " << damaged.size();
        } catch (const IoError&) {
        }
    }
}

TEST(State, the_damage_test_sees_a_reader_that_trusts_openexr) {
    const Scratch scratch;
    const Engine engine;
    write_state(scratch / "a.exr", state_of(engine, 0, 3));
    const auto was = read_channel(scratch / "a.exr", 0, "m.hi.R");
    std::string damaged = bytes_of(scratch / "a.exr");
    std::size_t unseen = 0;
    for (std::size_t at = damaged.size() - 1000; at < damaged.size(); ++at) {
        damaged[at] = static_cast<char>(~damaged[at]);
        put_bytes(scratch / "b.exr", damaged);
        damaged[at] = static_cast<char>(~damaged[at]);
        try {
            const auto is = read_channel(scratch / "b.exr", 0, "m.hi.R");
            unseen += std::memcmp(is.data(), was.data(), 4 * is.size()) != 0;
        } catch (const std::exception&) {
        }
    }
    EXPECT_GT(unseen, 10u);
}

// ---- writing on a full disk, and being killed

TEST(State, a_full_disk_at_any_byte_is_an_error_and_leaves_the_old_state) {
    const Scratch scratch;
    const Engine engine;
    const std::string path = scratch / "a.exr";
    const StateFile before = state_of(engine, 0, 3), after = state_of(engine, 0, 4);
    write_state(path, before);
    write_state(scratch / "b.exr", after);
    const std::string old = bytes_of(path);
    const std::size_t size = bytes_of(scratch / "b.exr").size();
    std::set<std::size_t> limits{0, 1, size - 1, size - 2, size - 3, size - 4, size - 7, size - 8, size - 100};
    for (Samples draw(1); limits.size() < 50;) limits.insert(draw.bits() % size);
    const auto write = [&] { write_state(path, after); };
    for (const std::size_t limit : limits) {
        EXPECT_EQ(limited(limit, path, write), Ended::refused) << limit << " of " << size << " bytes";
        EXPECT_EQ(bytes_of(path), old);
        EXPECT_EQ(scratch.files(), 2u) << "the temporary file is gone";
    }
    EXPECT_TRUE(same(read_state(path), before));
    EXPECT_EQ(limited(size, path, write), Ended::wrote);
    EXPECT_EQ(bytes_of(path), bytes_of(scratch / "b.exr"));
}

namespace {

/// The states after 1, 2, ... batches.
std::vector<StateFile> prefixes(const Engine& engine, std::size_t count) {
    std::vector<StateFile> all;
    for (std::size_t n = 1; n <= count; ++n) all.push_back(state_of(engine, 0, n));
    return all;
}

/// Calls `write` with one state after the other in a child process and kills it after a while. Returns how many calls had
/// come back.
template <class Write>
std::size_t written_until_killed(const std::vector<StateFile>& states, RandomDelays& delays, Write write) {
    int pipe_ends[2];
    if (pipe(pipe_ends) != 0) throw std::runtime_error("pipe");
    const pid_t child = fork();
    if (child == 0) {
        for (const auto& state : states) {
            write(state);
            if (::write(pipe_ends[1], "x", 1) != 1) _exit(1);
        }
        _exit(0);
    }
    close(pipe_ends[1]);
    delays.sleep();
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    std::size_t done = 0;
    for (char byte; read(pipe_ends[0], &byte, 1) == 1;) ++done;
    close(pipe_ends[0]);
    return done;
}

/// What is wrong with the file that the writer left: empty where nothing is. It must hold one of the states, whole, and
/// none older than the last that was acknowledged.
std::string verdict(const std::string& path, const std::vector<StateFile>& states, std::size_t acknowledged) {
    if (!std::filesystem::exists(path)) return acknowledged == 0 ? "" : "the file is not there";
    try {
        const StateFile held = read_state(path);
        const std::size_t n = held.sums.batches();
        if (n < acknowledged || n > acknowledged + 1) return "another batch than the last ones";
        return same(held, states[n - 1]) ? "" : "other sums than those of its batches";
    } catch (const IoError& e) {
        return e.what();
    }
}

struct Kills {
    std::size_t wrong = 0;   ///< writers that left something wrong behind
    std::size_t middle = 0;  ///< killed after the first write and before the last had come back
};

/// Kills writers of 12 states.
template <class Write> Kills kill_writers(std::uint64_t seed, int kills, const std::string& path, Write write) {
    const Engine engine;
    const auto states = prefixes(engine, 12);
    RandomDelays delays(seed);
    Kills out;
    for (int k = 0; k < kills; ++k) {
        std::filesystem::remove(path);
        const std::size_t acknowledged = written_until_killed(states, delays, write);
        if (acknowledged == 0) delays.was_too_early();
        if (acknowledged == states.size()) delays.was_too_late();
        out.wrong += !verdict(path, states, acknowledged).empty();
        out.middle += acknowledged > 0 && acknowledged < states.size();
    }
    return out;
}

void expect_nothing_lost(std::uint64_t seed, int kills) {
    const Scratch scratch;
    const std::string path = scratch / "a.exr";
    const Kills killed = kill_writers(seed, kills, path, [&](const StateFile& s) { write_state(path, s); });
    EXPECT_EQ(killed.wrong, 0u);
    EXPECT_GT(killed.middle, static_cast<std::size_t>(kills) / 4) << "of " << kills;
    EXPECT_LE(scratch.files(), 2u) << "the state, and what the last one killed left";
    const Engine engine;
    write_state(path, state_of(engine, 0, 1));
    EXPECT_EQ(scratch.files(), 1u);
}

}  // namespace

TEST(State, a_killed_writer_loses_nothing_and_leaves_nothing) { expect_nothing_lost(1, 40); }

TEST(State, Slow_500_killed_writers_lose_nothing) { expect_nothing_lost(2, 500); }

TEST(State, the_verdict_sees_a_writer_that_does_not_rename) {
    const Scratch scratch;
    const std::string path = scratch / "a.exr", other = scratch / "b.exr";
    const auto in_place = [&](const StateFile& s) {
        write_state(other, s);
        std::ofstream out(path, std::ios::binary);
        for (const char byte : bytes_of(other)) out.put(byte).flush();
    };
    std::size_t wrong = 0;  // on a busy machine few kills meet a writer at work
    for (std::uint64_t seed = 1; wrong <= 5 && seed <= 10; ++seed) wrong += kill_writers(seed, 30, path, in_place).wrong;
    EXPECT_GT(wrong, 5u);
}

TEST(State, the_verdict_sees_a_writer_that_counts_wrongly) {
    const Scratch scratch;
    const Engine engine;
    const auto states = prefixes(engine, 3);
    StateFile twice = states[1];
    Moments sum(engine, twice.sums);
    add_batch(sum, 1);
    twice.sums = sum.snapshot();
    twice.ranges = BatchRanges::parse("[0,3)");
    write_state(scratch / "a.exr", twice);
    EXPECT_EQ(verdict(scratch / "a.exr", states, 3), "other sums than those of its batches");
    write_state(scratch / "a.exr", states[0]);
    EXPECT_EQ(verdict(scratch / "a.exr", states, 2), "another batch than the last ones");
    EXPECT_EQ(verdict(scratch / "a.exr", states, 1), "");
}

TEST(State, only_what_nobody_writes_is_removed) {
    const Scratch scratch;
    const Engine engine;
    for (const char* name : {".a.exr.77-0.tmp", ".a.exr.tmp", ".a.exr.77-0.tmp2", ".b.exr.77-0.tmp", ".a.exr.x-0.tmp"})
        put_bytes(scratch / name, "left behind");
    write_state(scratch / "a.exr", state_of(engine, 0, 1));
    EXPECT_EQ(scratch.files(), 5u);
    EXPECT_FALSE(std::filesystem::exists(scratch / ".a.exr.77-0.tmp"));
}

TEST(State, writers_of_one_file_do_not_disturb_each_other) {
    const Scratch scratch;
    const Engine engine;
    const std::string path = scratch / "a.exr";
    const auto states = prefixes(engine, 2);
    const auto write_often = [&](const StateFile& s) {
        for (int k = 0; k < 40; ++k) EXPECT_NO_THROW(write_state(path, s));
    };
    { const std::jthread one(write_often, std::cref(states[0])), other(write_often, std::cref(states[1])); }
    const StateFile last = read_state(path);
    EXPECT_TRUE(same(last, states[0]) || same(last, states[1]));
    EXPECT_EQ(scratch.files(), 1u);
}

// ---- merging

TEST(State, merging_is_that_of_the_moments_in_any_order) {
    const Scratch scratch;
    const Engine engine;
    std::vector<std::filesystem::path> paths;
    const std::vector<std::pair<std::uint64_t, std::uint64_t>> parts{{0, 3}, {3, 1}, {10, 2}, {4, 4}};
    for (std::size_t i = 0; i < parts.size(); ++i) {
        paths.emplace_back(scratch / std::to_string(i));
        write_state(paths.back(), state_of(engine, parts[i].first, parts[i].second));
    }
    Moments sum(engine, state_of(engine, 0, 3).sums);
    for (const std::size_t i : {1u, 3u, 2u})
        sum.merge(Moments(engine, state_of(engine, parts[i].first, parts[i].second).sums));
    std::sort(paths.begin(), paths.end());
    std::set<std::string> all_bytes;
    do {
        const StateFile merged = merge_states(engine, paths);
        EXPECT_TRUE(merged.sums == sum.snapshot());
        EXPECT_EQ(merged.ranges.text(), "[0,8) [10,12)");
        write_state(scratch / "merged", merged);
        all_bytes.insert(bytes_of(scratch / "merged"));
    } while (std::next_permutation(paths.begin(), paths.end()));
    EXPECT_EQ(all_bytes.size(), 1u);

    std::set<std::string> as_named;
    for (const auto& order : {std::vector{0, 1, 3, 2}, std::vector{2, 3, 1, 0}}) {
        Moments other(engine, state_values);
        for (const int i : order) other.merge(Moments(engine, read_state(scratch / std::to_string(i)).sums));
        StateFile merged = merge_states(engine, paths);
        merged.sums = other.snapshot();
        write_state(scratch / "merged", merged);
        as_named.insert(bytes_of(scratch / "merged"));
    }
    EXPECT_EQ(as_named.size(), 2u) << "planted fault: merged as they were named";
}

TEST(State, one_part_merges_to_itself) {
    const Scratch scratch;
    const Engine engine;
    write_state(scratch / "a", state_of(engine, 5, 2));
    const std::vector<std::filesystem::path> paths{scratch / "a"};
    write_state(scratch / "b", merge_states(engine, paths));
    EXPECT_EQ(bytes_of(scratch / "a"), bytes_of(scratch / "b"));
    EXPECT_THROW(merge_states(engine, {}), InvalidArgument);
}

TEST(State, parts_that_do_not_fit_are_refused_with_both_names) {
    const Scratch scratch;
    const Engine engine;
    write_state(scratch / "a", state_of(engine, 0, 4));
    const auto refuse = [&](const StateFile& other, const std::string& what) {
        write_state(scratch / "b", other);
        const std::vector<std::filesystem::path> paths{scratch / "a", scratch / "b"};
        try {
            merge_states(engine, paths);
            ADD_FAILURE() << what;
        } catch (const IoError& e) {
            expect_in(scratch / "a", e.what());
            expect_in(scratch / "b", e.what());
            expect_in(what, e.what());
        }
    };
    const auto changed = [&](auto change) {
        StateFile s = state_of(engine, 4, 4);
        change(s);
        return s;
    };
    refuse(state_of(engine, 3, 4), "both hold batches [3,4)");
    refuse(state_of(engine, 4, 4, {NonFinite::propagate}),
           "nonfinite=skip ratios=0 groups=1 weights=samples and nonfinite=propagate");
    refuse(changed([](auto& s) { s.settings[0].second = "beauty"; }), "layer.m=shadow layer.t= and layer.m=beauty");
    refuse(changed([](auto& s) { s.shape.channels = {"X", "Y", "Z"}; }), "channels: R,G,B and X,Y,Z");
    refuse(changed([](auto& s) { s.shape.data_window = {0, 0, 4, 2}; }), "data window: (-2,7)-(2,9) and (0,0)-(4,2)");
    refuse(changed([](auto& s) { s.shape.display_window.x1 = 10; }), "display window");
}
