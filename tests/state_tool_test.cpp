// combine --state, --resume and merge, run as a user runs them, and killed.
#include <gtest/gtest.h>

#include <cmath>
#include <future>
#include <set>

#include "support/limited.hpp"
#include "support/state_tool.hpp"

using namespace clratio;
using namespace clratio::test;

// ---- the state grows

TEST(StateTool, in_pieces_or_at_once_gives_the_same_bytes) {
    const Scratch scratch;
    const Batches batches(11);
    const std::string state = scratch / "s.exr", out = scratch / "o.exr";
    const Words read{"--tau", "1", "-o", out, "--stderr", scratch / "e.exr"};
    const json first = answer(batches.combine(0, 4) + Words{"--state", state});
    EXPECT_EQ(first["state"]["ranges"], "[0,4)");
    EXPECT_EQ(first["state"]["added"], 4);
    EXPECT_EQ(verdict(state, batches, 4), "");
    const json second = answer(batches.combine(0, 11) + read + Words{"--state", state, "--resume"});
    EXPECT_EQ(second["state"]["held"], 4);
    EXPECT_EQ(second["state"]["added"], 7);
    EXPECT_EQ(second["batches"], 11);
    EXPECT_EQ(verdict(state, batches, 11), "");
    const std::string grown = bytes_of(state), pieces = bytes_of(out);
    EXPECT_EQ(answer({"combine", "--state", state, "--resume", "--tau", "1", "-o", out})["batches"], 11);
    EXPECT_EQ(bytes_of(state), grown) << "reading out changes nothing";
    EXPECT_EQ(bytes_of(out), pieces);
    answer(batches.combine(0, 11) + read + Words{"--state", scratch / "once.exr"});
    EXPECT_EQ(bytes_of(scratch / "once.exr"), grown);
    EXPECT_EQ(bytes_of(out), pieces);
    answer(batches.combine(0, 11) + read);
    EXPECT_EQ(bytes_of(out), pieces) << "no state at all";
    answer(batches.combine(0, 11) + read + Words{"--state", state, "--resume"});
    EXPECT_EQ(bytes_of(state), grown) << "nothing is added twice";
    EXPECT_EQ(scratch.files(), 4u) << "locks and temporary files are gone";
}

TEST(StateTool, alpha_is_that_of_the_first_batch_in_whatever_order_they_come) {
    const Scratch scratch;
    const Batches batches(4);
    const std::string state = scratch / "s.exr";
    answer(batches.combine(2, 4) + Words{"--first-batch", "2", "--state", state});
    EXPECT_EQ(read_state(state).shape.alpha[0], 2);
    answer(batches.combine(0, 2) + Words{"--state", state, "--resume"});
    EXPECT_EQ(read_state(state).shape.alpha[0], 0);
    answer(batches.combine(0, 4) + Words{"--state", state, "--resume", "--tau", "1", "-o", scratch / "o.exr"});
    EXPECT_EQ(read_image(scratch / "o.exr").alpha[0], 0);
}

TEST(StateTool, the_verdict_sees_a_batch_counted_twice) {
    const Scratch scratch;
    const Batches batches(4);
    const std::string state = scratch / "s.exr";
    answer(batches.combine(0, 2) + Words{"--state", state});
    answer(batches.combine(0, 2) + Words{"--state", state, "--resume", "--first-batch", "2"});
    EXPECT_EQ(verdict(state, batches, 4), "its sums are not those of [0,4)");
    EXPECT_EQ(verdict(state, batches, 5), "it has lost batches");
}

TEST(StateTool, a_batch_that_is_refused_tells_what_is_held) {
    const Scratch scratch;
    const Batches batches(2);  // number 1 has a NaN
    const std::string state = scratch / "s.exr",
                      held = state + " holds batches [0,1); the same command with --resume goes on";
    const Words strict{"--state", state, "--nonfinite", "fail"};
    expect_refused(batches.combine(1, 2) + strict, 1, "refused by --nonfinite fail\n");
    EXPECT_FALSE(std::filesystem::exists(state)) << "nothing is held";
    expect_refused(batches.combine(0, 2) + strict, 1, "refused by --nonfinite fail; " + held);
    EXPECT_EQ(read_state(state).ranges.text(), "[0,1)");
}

TEST(StateTool, what_does_not_fit_the_state_is_refused) {
    const Scratch scratch;
    const Batches batches(4);
    const std::string state = scratch / "s.exr", out = scratch / "o.exr";
    const Words add = batches.combine(2, 4), with{"--state", state}, resume{"--state", state, "--resume"};
    answer(batches.combine(0, 2) + with);
    const std::string old = bytes_of(state);
    expect_refused(add + with, 2, state + ": exists already; --resume goes on with it");
    expect_refused(add + Words{"--resume", "--tau", "1", "-o", out}, 2, "--resume needs --state");
    expect_refused(add + resume + Words{"--nonfinite", "propagate"}, 2, "which was recorded with --nonfinite skip");
    expect_refused(add + resume + Words{"--estimator", "mean-of-ratios"}, 2, "recorded without what that needs");
    expect_refused({"combine", "--tau", "1", "-o", out}, 2, "--m is required");
    expect_refused(Words{"combine"} + with, 2, "--m is required");
    expect_refused(Words{"combine"} + resume, 2, "--output is required");
    expect_refused(add + resume + Words{"-o", out}, 2, "--tau is required");
    expect_refused(add + resume + Words{"--stderr", out}, 2, "--stderr needs --output");
    expect_refused(add + resume + Words{"-o", state, "--tau", "1"}, 2, "named for two outputs");
    expect_refused({"combine", "--state", scratch / "none.exr", "--resume", "--tau", "1", "-o", out}, 1, "no such file");
    Image other = state_shape();
    other.channels = {"X", "Y", "Z"};
    other.values.assign(state_values, 1);
    write_image(scratch / "other.exr", other);
    expect_refused(Words{"combine", "--m", scratch / "other.exr", "--t", scratch / "other.exr", "--first-batch", "2"} +
                       resume,
                   1, "images of one shape");
    write_exr(scratch / "layer.exr",
              {{.channels = {"x.B", "x.G", "x.R"}, .data = {{-2, 7}, {2, 9}}, .display = {{0, 0}, {9, 9}}}});
    expect_refused(Words{"combine", "--m", scratch / "layer.exr:x", "--t", batches.t_file(2), "--first-batch", "2"} + resume,
                   1, "layer.m x, layer.t (unnamed), but " + state + " holds layer.m (unnamed)");
    put_bytes(scratch / "text.exr", "text");
    expect_refused(add + Words{"--state", scratch / "text.exr", "--resume"}, 1, "text.exr");
    expect_refused(add + Words{"--state", batches.m_file(0), "--resume"}, 1, "is no state");
    expect_refused(add + Words{"--state", scratch / "no/s.exr"}, 1, "no folder");
    EXPECT_EQ(bytes_of(state), old);
    EXPECT_FALSE(std::filesystem::exists(out));
}

TEST(StateTool, a_batch_that_cannot_be_read_does_not_lose_those_before_it) {
    const Scratch scratch;
    const Batches batches(12);
    const std::string state = scratch / "s.exr";
    Words words = batches.combine(0, 12);
    words[2 + 10] = scratch / "none.exr";
    expect_refused(words + Words{"--state", state}, 1, "none.exr: no such file");
    EXPECT_EQ(verdict(state, batches, 10), "");
}

TEST(StateTool, one_process_at_a_time) {
    const Scratch scratch;
    const Batches batches(2);
    const std::string state = scratch / "s.exr";
    std::filesystem::create_directory(scratch / "empty");
    std::promise<void> refused;
    auto watching = std::async(std::launch::async, [&] {
        return clratio_tool({"combine", "--watch", scratch / "empty", "--m", "m_*.exr", "--t", "t_*.exr", "--state", state},
                            {.signal = SIGTERM, .wait = [&] { refused.get_future().wait(); }});
    });
    wait_until([&] { return std::filesystem::exists(state + ".lock"); });
    expect_refused(batches.combine(0, 2) + Words{"--state", state}, 1, state + ": another process works on it");
    refused.set_value();
    EXPECT_EQ(watching.get().code, 130);
    answer(batches.combine(0, 2) + Words{"--state", state});
    EXPECT_EQ(scratch.files(), 2u) << "the folder and the state";
}

// ---- killed, stopped, out of disk

namespace {

struct Chain {
    std::size_t kills = 0, with_state = 0, in_a_write = 0, ends = 0;
};

/// Runs the same job again and again, with --resume, each time killed after a random while, until it ends; and then from the
/// start, until it was killed `kills` times, half of them with a state on disk. After each kill the state must be the sums
/// of a prefix; at the end everything must be as if nobody had killed anything.
Chain kill_and_resume(std::uint64_t seed, std::size_t kills) {
    const Scratch scratch;
    const Batches batches(40);
    const std::string state = scratch / "s.exr", out = scratch / "o.exr";
    const Words job =
        batches.combine(0, 40) + Words{"--state", state, "--resume", "--checkpoint", "0", "--tau", "1", "-o", out};
    answer(job);
    const std::string want_state = bytes_of(state), want_out = bytes_of(out);
    const auto begin_again = [&] {
        std::filesystem::remove(state);
        std::filesystem::remove(out);
    };
    begin_again();
    RandomDelays delays(seed);
    Chain chain;
    for (std::uint64_t held = 0; chain.kills < kills || chain.with_state < kills / 2;) {
        const Said said = clratio_tool(job, {.signal = SIGKILL, .wait = [&] { delays.sleep(); }});
        EXPECT_EQ(verdict(state, batches, held), "") << "kill " << chain.kills;
        EXPECT_LE(scratch.files(), 5u) << "state, output, lock, and a temporary file each";
        const bool there = std::filesystem::exists(state);
        held = there ? read_state(state).sums.batches() : 0;
        if (said.code == 128 + SIGKILL) {
            ++chain.kills;
            chain.with_state += there;
            if (!there) delays.was_too_early();
            for (const auto& file : std::filesystem::directory_iterator(std::filesystem::path(state).parent_path()))
                chain.in_a_write += file.path().extension() == ".tmp";
        } else {
            EXPECT_EQ(said.code, 0) << said.err;
            EXPECT_EQ(bytes_of(state), want_state);
            EXPECT_EQ(bytes_of(out), want_out);
            ++chain.ends;
            delays.was_too_late();
            begin_again();
            held = 0;
        }
    }
    answer(job);
    EXPECT_EQ(bytes_of(state), want_state);
    EXPECT_EQ(bytes_of(out), want_out);
    EXPECT_EQ(scratch.files(), 2u) << "nothing is left of all those";
    std::cout << chain.kills << " kills, " << chain.with_state << " with a state on disk, " << chain.in_a_write
              << " in the middle of a write, " << chain.ends << " runs came to their end\n";
    return chain;
}

}  // namespace

TEST(StateTool, killed_at_any_moment_nothing_is_lost_or_counted_twice) { kill_and_resume(1, 25); }

TEST(StateTool, Slow_500_kills) { EXPECT_GT(kill_and_resume(2, 500).in_a_write, 10u); }

TEST(StateTool, stopped_politely_it_saves_and_says_how_to_go_on) {
    const Scratch scratch;
    const Batches batches(120);
    const std::string state = scratch / "s.exr";
    const Words job = batches.combine(0, 120) + Words{"--state", state, "--resume"};
    RandomDelays delays(1);
    int saved = 0, before = 0;
    for (int k = 0; k < 200 && saved < 3; ++k) {
        const Said said = clratio_tool(job, {.signal = k % 2 == 0 ? SIGINT : SIGTERM, .wait = [&] { delays.sleep(); }});
        EXPECT_EQ(verdict(state, batches, 0), "");
        if (said.code == 130 && !said.killed && std::filesystem::exists(state)) {
            expect_in("stopped: " + state + " holds batches [0,", said.err);
            expect_in("the same command with --resume goes on", said.err);
            ++saved;
            continue;
        }
        const bool too_late = std::filesystem::exists(state);  // done, or killed on its way out
        too_late ? delays.was_too_late() : delays.was_too_early();
        before += !too_late;
        std::filesystem::remove(state);
    }
    EXPECT_EQ(saved, 3) << before << " were stopped before the first batch";
    answer(job);
    EXPECT_EQ(verdict(state, batches, 120), "");
}

TEST(StateTool, stopped_without_a_state_it_leaves_no_file_or_a_whole_one) {
    const Scratch scratch;
    const Batches batches(120);
    const std::string out = scratch / "o.exr";
    const Words job = batches.combine(0, 120) + Words{"--tau", "1", "-o", out};
    answer(job);
    const std::string whole = bytes_of(out);
    RandomDelays delays(2);
    int stopped = 0;
    for (int k = 0; k < 200 && stopped < 3; ++k) {
        std::filesystem::remove(out);
        const Said said = clratio_tool(job, {.signal = SIGTERM, .wait = [&] { delays.sleep(); }});
        const bool done = std::filesystem::exists(out);  // killed on its way out, where it was killed
        EXPECT_EQ(scratch.files(), done ? 1u : 0u) << said.code << said.err;
        if (done) {
            EXPECT_TRUE(bytes_of(out) == whole);
            delays.was_too_late();
        } else if (said.killed) {
            delays.was_too_early();
        } else {
            EXPECT_EQ(said.code, 130);
            expect_in("stopped after ", said.err);
            ++stopped;
        }
    }
    EXPECT_EQ(stopped, 3);
}

TEST(StateTool, an_image_that_does_not_fit_loses_none_before_it) {
    const Scratch scratch;
    const Batches batches(2);
    const std::string state = scratch / "s.exr", large = CLRATIO_TEST_DATA "/cycles/area/m_000.exr";
    const Words job{
        "combine", "--m", batches.m_file(0), batches.m_file(1), large, "--t", batches.t_file(0), batches.t_file(1), large,
        "--state", state};
    expect_refused(job, 1, large);
    EXPECT_EQ(inspect_state(state).ranges.text(), "[0,2)");
}

TEST(StateTool, a_full_disk_exits_1_and_keeps_the_old_state) {
    const Scratch scratch;
    const Batches batches(3);
    const std::string state = scratch / "s.exr";
    answer(batches.combine(0, 2) + Words{"--state", state});
    answer(batches.combine(0, 3) + Words{"--state", scratch / "whole.exr"});
    const std::string old = bytes_of(state);
    const std::size_t size = bytes_of(scratch / "whole.exr").size();
    const Words job = batches.combine(0, 3) + Words{"--state", state, "--resume"};
    for (const std::size_t limit : {std::size_t{500}, size / 2, size - 8, size - 2, size - 1}) {
        expect_refused(job, 1, state + ": cannot be written: File too large", {.file_size_limit = limit});
        EXPECT_EQ(bytes_of(state), old) << limit;
        EXPECT_EQ(scratch.files(), 2u);
    }
    EXPECT_EQ(clratio_tool(job, {.file_size_limit = size, .out = "/dev/null"}).code, 0);
    EXPECT_EQ(bytes_of(state), bytes_of(scratch / "whole.exr"));
}

// ---- a farm

TEST(StateTool, nodes_merge_in_any_order_and_read_out_alone) {
    const Scratch scratch;
    const Batches batches(9);
    const std::vector<std::pair<int, int>> parts{{0, 4}, {4, 6}, {6, 9}};
    Words nodes;
    for (const auto& [begin, end] : parts) {
        nodes.push_back(scratch / ("node" + std::to_string(begin) + ".exr"));
        answer(batches.combine(begin, end) + Words{"--first-batch", std::to_string(begin), "--state", nodes.back()});
    }
    std::set<std::string> all;
    std::sort(nodes.begin(), nodes.end());
    do {
        const std::string merged =
            scratch / ("all" + std::to_string(all.size()) + nodes[0].substr(nodes[0].size() - 5) + ".exr");
        const json j = answer(Words{"merge"} + nodes + Words{"-o", merged});
        EXPECT_EQ(j["batches"], 9);
        EXPECT_EQ(j["ranges"], "[0,9)");
        EXPECT_EQ(j["states"], 3);
        all.insert(bytes_of(merged));
        std::filesystem::rename(merged, scratch / "all.exr");
    } while (std::next_permutation(nodes.begin(), nodes.end()));
    EXPECT_EQ(all.size(), 1u);

    answer({"combine", "--state", scratch / "all.exr", "--resume", "--tau", "2", "-o", scratch / "o.exr"});
    answer(batches.combine(0, 9) + Words{"--tau", "2", "-o", scratch / "w.exr"});
    const Image merged = read_image(scratch / "o.exr"), whole = read_image(scratch / "w.exr");
    for (std::size_t i = 0; i < whole.size(); ++i)
        EXPECT_LE(std::fabs(merged.values[i] - whole.values[i]), 2 * std::ldexp(std::fabs(whole.values[i]), -23)) << "2 ulp";
    EXPECT_EQ(merged.alpha, whole.alpha);

    expect_refused({"merge", nodes[0], nodes[0], "-o", scratch / "x.exr"}, 1, "both hold batches");
    expect_refused({"merge", nodes[0], nodes[1], "-o", scratch / "all.exr"}, 1, "would lose batch 6");
    expect_refused({"merge", nodes[0], batches.m_file(0), "-o", scratch / "x.exr"}, 1, "is no state");
    expect_refused({"merge", "-o", scratch / "x.exr"}, 2, "states is required");
    answer(Words{"merge", nodes[0], nodes[1], "-o", nodes[0]});
    EXPECT_EQ(read_state(nodes[0]).ranges.count(), 6u) << "an input may be the output";
}
