// combine --state, --resume, --watch and merge, run as a user runs them, and killed.
#include <gtest/gtest.h>

#include <cmath>
#include <future>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "support/limited.hpp"
#include "support/run.hpp"
#include "support/states.hpp"

using namespace clratio;
using namespace clratio::test;
using namespace std::chrono_literals;
using nlohmann::json;

namespace {

using Words = std::vector<std::string>;

Words operator+(Words a, const Words& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

Said tool(const Words& words, const Surroundings& around = {}) { return run(CLRATIO_TOOL, words, around); }

void expect_in(const std::string& part, const std::string& text) {
    EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in: " << text;
}

json done(const Words& words) {
    const Said said = tool(words + Words{"--json"});
    EXPECT_EQ(said.code, 0) << said.err;
    return json::parse(said.out, nullptr, false);
}

void expect_refused(const Words& words, int code, const std::string& part, const Surroundings& around = {}) {
    const Said said = tool(words, around);
    EXPECT_EQ(said.code, code) << said.err;
    EXPECT_EQ(said.out, "");
    expect_in(part, said.err);
    EXPECT_EQ(std::count(said.err.begin(), said.err.end(), '\n'), 1) << said.err;
}

template <class Condition> void wait_until(Condition condition) {
    for (int k = 0; k < 12000; ++k, std::this_thread::sleep_for(5ms))
        if (condition()) return;
    ADD_FAILURE() << "nothing happened in a minute";
}

/// Batches of small images on disk, and the sums that they have.
class Batches {
public:
    explicit Batches(int count) {
        for (int k = 0; k < count; ++k) {
            Samples draw(static_cast<std::uint64_t>(k) + 1);
            Image m = state_shape(), t = m;
            m.alpha[0] = static_cast<float>(k);
            m.values = floats(state_values, [&] { return draw.normal(); });
            if (k == 1) m.values[3] = std::numeric_limits<float>::quiet_NaN();
            t.values = floats(state_values, [&] { return draw.uniform(); });
            write_image(m_file(k), m);
            write_image(t_file(k), t);
            m_.push_back(std::move(m));
            t_.push_back(std::move(t));
        }
    }

    std::string m_file(int k) const { return folder_ / ("m_" + std::to_string(k) + ".exr"); }
    std::string t_file(int k) const { return folder_ / ("t_" + std::to_string(k) + ".exr"); }

    /// combine with batches [begin, end).
    Words combine(int begin, int end) const {
        Words words{"combine", "--m"};
        for (int k = begin; k < end; ++k) words.push_back(m_file(k));
        words.emplace_back("--t");
        for (int k = begin; k < end; ++k) words.push_back(t_file(k));
        return words;
    }

    /// The sums of these batches, added in this order.
    Snapshot sums(const std::vector<int>& order, MomentsOptions options = {}) const {
        Moments sum(engine_, state_values, options);
        for (const int k : order) sum.add(m_[static_cast<std::size_t>(k)], t_[static_cast<std::size_t>(k)]);
        return sum.snapshot();
    }
    Snapshot sums(int begin, int end) const {
        std::vector<int> order;
        for (int k = begin; k < end; ++k) order.push_back(k);
        return sums(order);
    }

private:
    Scratch folder_;
    Engine engine_;
    std::vector<Image> m_, t_;
};

/// Is this the state of batches [0, n), whole? What is wrong, in words, or nothing.
std::string verdict(const std::string& path, const Batches& batches, std::uint64_t least) {
    if (!std::filesystem::exists(path)) return least == 0 ? "" : "it is not there";
    try {
        const StateFile state = read_state(path);
        const std::uint64_t n = state.sums.batches();
        if (n < least) return "it has lost batches";
        if (state.ranges.text() != "[0," + std::to_string(n) + ")") return "it holds no prefix: " + state.ranges.text();
        return state.sums == batches.sums(0, static_cast<int>(n)) ? "" : "its sums are not those of " + state.ranges.text();
    } catch (const IoError& e) {
        return e.what();
    }
}

}  // namespace

// ---- the state grows

TEST(StateTool, in_pieces_or_at_once_gives_the_same_bytes) {
    const Scratch scratch;
    const Batches batches(11);
    const std::string state = scratch / "s.exr", out = scratch / "o.exr";
    const Words read{"--tau", "1", "-o", out, "--stderr", scratch / "e.exr"};
    const json first = done(batches.combine(0, 4) + Words{"--state", state});
    EXPECT_EQ(first["state"]["ranges"], "[0,4)");
    EXPECT_EQ(first["state"]["added"], 4);
    EXPECT_EQ(verdict(state, batches, 4), "");
    const json second = done(batches.combine(0, 11) + read + Words{"--state", state, "--resume"});
    EXPECT_EQ(second["state"]["held"], 4);
    EXPECT_EQ(second["state"]["added"], 7);
    EXPECT_EQ(second["batches"], 11);
    EXPECT_EQ(verdict(state, batches, 11), "");
    const std::string grown = bytes_of(state), pieces = bytes_of(out);
    EXPECT_EQ(done({"combine", "--state", state, "--resume", "--tau", "1", "-o", out})["batches"], 11);
    EXPECT_EQ(bytes_of(state), grown) << "reading out changes nothing";
    EXPECT_EQ(bytes_of(out), pieces);
    done(batches.combine(0, 11) + read + Words{"--state", scratch / "once.exr"});
    EXPECT_EQ(bytes_of(scratch / "once.exr"), grown);
    EXPECT_EQ(bytes_of(out), pieces);
    done(batches.combine(0, 11) + read);
    EXPECT_EQ(bytes_of(out), pieces) << "no state at all";
    done(batches.combine(0, 11) + read + Words{"--state", state, "--resume"});
    EXPECT_EQ(bytes_of(state), grown) << "nothing is added twice";
    EXPECT_EQ(scratch.files(), 4u) << "locks and temporary files are gone";
}

TEST(StateTool, alpha_is_that_of_the_first_batch_in_whatever_order_they_come) {
    const Scratch scratch;
    const Batches batches(4);
    const std::string state = scratch / "s.exr";
    done(batches.combine(2, 4) + Words{"--first-batch", "2", "--state", state});
    EXPECT_EQ(read_state(state).shape.alpha[0], 2);
    done(batches.combine(0, 2) + Words{"--state", state, "--resume"});
    EXPECT_EQ(read_state(state).shape.alpha[0], 0);
    done(batches.combine(0, 4) + Words{"--state", state, "--resume", "--tau", "1", "-o", scratch / "o.exr"});
    EXPECT_EQ(read_image(scratch / "o.exr").alpha[0], 0);
}

TEST(StateTool, the_verdict_sees_a_batch_counted_twice) {
    const Scratch scratch;
    const Batches batches(4);
    const std::string state = scratch / "s.exr";
    done(batches.combine(0, 2) + Words{"--state", state});
    done(batches.combine(0, 2) + Words{"--state", state, "--resume", "--first-batch", "2"});
    EXPECT_EQ(verdict(state, batches, 4), "its sums are not those of [0,4)");
    EXPECT_EQ(verdict(state, batches, 5), "it has lost batches");
}

TEST(StateTool, what_does_not_fit_the_state_is_refused) {
    const Scratch scratch;
    const Batches batches(4);
    const std::string state = scratch / "s.exr", out = scratch / "o.exr";
    const Words add = batches.combine(2, 4), with{"--state", state}, resume{"--state", state, "--resume"};
    done(batches.combine(0, 2) + with);
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
        return tool({"combine", "--watch", scratch / "empty", "--m", "m_*.exr", "--t", "t_*.exr", "--state", state},
                    {.signal = SIGTERM, .wait = [&] { refused.get_future().wait(); }});
    });
    wait_until([&] { return std::filesystem::exists(state + ".lock"); });
    expect_refused(batches.combine(0, 2) + Words{"--state", state}, 1, state + ": another process works on it");
    refused.set_value();
    EXPECT_EQ(watching.get().code, 130);
    done(batches.combine(0, 2) + Words{"--state", state});
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
    done(job);
    const std::string want_state = bytes_of(state), want_out = bytes_of(out);
    const auto begin_again = [&] {
        std::filesystem::remove(state);
        std::filesystem::remove(out);
    };
    begin_again();
    RandomDelays delays(seed);
    Chain chain;
    for (std::uint64_t held = 0; chain.kills < kills || chain.with_state < kills / 2;) {
        const Said said = tool(job, {.signal = SIGKILL, .wait = [&] { delays.sleep(); }});
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
    done(job);
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
        const Said said = tool(job, {.signal = k % 2 == 0 ? SIGINT : SIGTERM, .wait = [&] { delays.sleep(); }});
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
    done(job);
    EXPECT_EQ(verdict(state, batches, 120), "");
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
    done(batches.combine(0, 2) + Words{"--state", state});
    done(batches.combine(0, 3) + Words{"--state", scratch / "whole.exr"});
    const std::string old = bytes_of(state);
    const std::size_t size = bytes_of(scratch / "whole.exr").size();
    const Words job = batches.combine(0, 3) + Words{"--state", state, "--resume"};
    for (const std::size_t limit : {std::size_t{500}, size / 2, size - 8, size - 2, size - 1}) {
        expect_refused(job, 1, state + ": cannot be written: File too large", {.file_size_limit = limit});
        EXPECT_EQ(bytes_of(state), old) << limit;
        EXPECT_EQ(scratch.files(), 2u);
    }
    EXPECT_EQ(tool(job, {.file_size_limit = size, .out = "/dev/null"}).code, 0);
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
        done(batches.combine(begin, end) + Words{"--first-batch", std::to_string(begin), "--state", nodes.back()});
    }
    std::set<std::string> all;
    std::sort(nodes.begin(), nodes.end());
    do {
        const std::string merged =
            scratch / ("all" + std::to_string(all.size()) + nodes[0].substr(nodes[0].size() - 5) + ".exr");
        const json j = done(Words{"merge"} + nodes + Words{"-o", merged});
        EXPECT_EQ(j["batches"], 9);
        EXPECT_EQ(j["ranges"], "[0,9)");
        EXPECT_EQ(j["states"], 3);
        all.insert(bytes_of(merged));
        std::filesystem::rename(merged, scratch / "all.exr");
    } while (std::next_permutation(nodes.begin(), nodes.end()));
    EXPECT_EQ(all.size(), 1u);

    done({"combine", "--state", scratch / "all.exr", "--resume", "--tau", "2", "-o", scratch / "o.exr"});
    done(batches.combine(0, 9) + Words{"--tau", "2", "-o", scratch / "w.exr"});
    const Image merged = read_image(scratch / "o.exr"), whole = read_image(scratch / "w.exr");
    for (std::size_t i = 0; i < whole.size(); ++i)
        EXPECT_LE(std::fabs(merged.values[i] - whole.values[i]), 2 * std::ldexp(std::fabs(whole.values[i]), -23)) << "2 ulp";
    EXPECT_EQ(merged.alpha, whole.alpha);

    expect_refused({"merge", nodes[0], nodes[0], "-o", scratch / "x.exr"}, 1, "both hold batches");
    expect_refused({"merge", nodes[0], nodes[1], "-o", scratch / "all.exr"}, 1, "would lose batch 6");
    expect_refused({"merge", nodes[0], batches.m_file(0), "-o", scratch / "x.exr"}, 1, "is no state");
    expect_refused({"merge", "-o", scratch / "x.exr"}, 2, "states is required");
    done(Words{"merge", nodes[0], nodes[1], "-o", nodes[0]});
    EXPECT_EQ(read_state(nodes[0]).ranges.count(), 6u) << "an input may be the output";
}

// ---- sums of whole numbers

namespace {

/// The file of batches [0, 6), added in these parts and merged in this order.
std::string file_of_parts(const Batches& batches, const std::vector<std::pair<int, int>>& parts, const Words& how) {
    const Scratch scratch;
    Words merge{"merge"};
    for (const auto& [begin, end] : parts) {
        const std::string part = scratch / (std::to_string(begin) + ".exr");
        done(batches.combine(begin, end) + Words{"--state", part, "--first-batch", std::to_string(begin)} + how);
        merge.push_back(part);
    }
    done(merge + Words{"-o", scratch / "all.exr"});
    return bytes_of(scratch / "all.exr");
}

}  // namespace

TEST(StateTool, fixed_sums_are_the_same_file_for_any_parts) {
    const Batches batches(6);
    const Words fixed{"--fixed", "24"};
    const std::string whole = file_of_parts(batches, {{0, 6}}, fixed);
    EXPECT_TRUE(file_of_parts(batches, {{4, 6}, {0, 1}, {1, 4}}, fixed) == whole);
    EXPECT_TRUE(file_of_parts(batches, {{3, 6}, {0, 3}}, fixed) == whole);
    EXPECT_FALSE(file_of_parts(batches, {{3, 6}, {0, 3}}, {}) == file_of_parts(batches, {{0, 6}}, {}))
        << "planted fault: sums that are rounded";
}

// Values, and so their means, move by 2^-25 at most; a ratio of float means is then rounded, and times tau = 1.
TEST(StateTool, fixed_sums_read_out_as_the_others_do) {
    const Scratch scratch;
    const Batches batches(6);
    const Words read{"--tau", "1", "--stderr", scratch / "e.exr"};
    done(batches.combine(0, 6) + read + Words{"-o", scratch / "two.exr"});
    const json j = done(batches.combine(0, 6) + read + Words{"-o", scratch / "fixed.exr", "--fixed", "24"});
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

    const json narrow = done(batches.combine(0, 6) + read + Words{"-o", scratch / "o.exr", "--fixed", "24", "--range", "0"});
    EXPECT_GT(narrow["outside_range"], 0) << "values above 1";
    EXPECT_GT(narrow["flags"]["skipped"], 1);
}

TEST(StateTool, fixed_sums_refuse_what_they_cannot_keep) {
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
    expect_refused(add + fixed + Words{"--weight", "8388608"}, 1, "weight: expected a sum of at most 8388607");
    EXPECT_FALSE(std::filesystem::exists(state));
    done(add + fixed);
    done(add + Words{"--state", two});
    const Words on = batches.combine(0, 2) + Words{"--resume", "--state"};
    expect_refused(on + Words{state, "--fixed", "20"}, 2,
                   "--fixed 20 does not fit --state " + state + ", which was recorded with --fixed 24");
    expect_refused(on + Words{state, "--fixed", "24", "--range", "8"}, 2, "recorded with --range 16");
    expect_refused(on + Words{two, "--fixed", "24"}, 2, "recorded without it");
    expect_refused({"merge", state, two, "-o", scratch / "m.exr"}, 1, "kind of sums: fixed and moments");
    EXPECT_EQ(done(on + Words{state})["state"]["ranges"], "[0,2)") << "a state says itself how it is kept";
}

// ---- watching a folder

namespace {

/// Writes a file as a renderer does: under its own name, piece by piece.
void write_slowly(const std::string& from, const std::string& to, double share = 1) {
    const std::string bytes = bytes_of(from);
    const auto last = static_cast<std::size_t>(share * static_cast<double>(bytes.size()));
    std::ofstream out(to, std::ios::binary);
    for (std::size_t at = 0; at < last; at += 700) {
        out.write(bytes.data() + at, static_cast<std::streamsize>(std::min<std::size_t>(700, last - at))).flush();
        std::this_thread::sleep_for(20ms);
    }
}

class Renderer {
public:
    explicit Renderer(const Batches& batches) : batches_(batches) {}
    void write(int k, const char* name, double share_of_m = 1) const {
        write_slowly(batches_.m_file(k), folder_ / ("m_" + std::string(name) + ".exr"), share_of_m);
        write_slowly(batches_.t_file(k), folder_ / ("t_" + std::string(name) + ".exr"));
    }
    void write_at_once(int k) const {
        std::filesystem::copy_file(batches_.m_file(k), folder_ / ("m_" + std::to_string(k) + ".exr"));
        std::filesystem::copy_file(batches_.t_file(k), folder_ / ("t_" + std::to_string(k) + ".exr"));
    }
    void write_of_another_size(const std::string& name) const {
        write_exr(folder_ / name, {{.data = {{0, 0}, {1, 1}}, .display = {{0, 0}, {1, 1}}}});
    }
    std::string operator/(const std::string& name) const { return folder_ / name; }
    Words watch(const std::string& state) const {
        return {"combine", "--watch",  folder_ / "", "--m",     "m_*.exr", "--t",
                "t_*.exr", "--settle", ".15",        "--state", state,     "--resume"};
    }

private:
    Scratch folder_;
    const Batches& batches_;
};

void wait_for(const std::string& state, std::uint64_t batches) {
    wait_until([&] { return std::filesystem::exists(state) && inspect_state(state).sums.batches() >= batches; });
}

}  // namespace

TEST(StateTool, watch_adds_what_a_slow_renderer_has_finished_and_waits_for_what_a_killed_one_has_not) {
    const Scratch scratch;
    const Batches batches(4);
    const Renderer renderer(batches);
    const std::string state = scratch / "s.exr";
    put_bytes(renderer / "m_ref.exr", "no number");
    auto watching = std::async(std::launch::async, [&] {
        return tool(renderer.watch(state) +
                    Words{"--checkpoint", "0", "--until-batches", "4", "--tau", "1", "-o", scratch / "o.exr"});
    });
    renderer.write(0, "0000");
    wait_for(state, 1);
    for (const char* name : {"m_0009.exr", "t_0009.exr"}) renderer.write_of_another_size(name);
    renderer.write(1, "0001", .6);
    renderer.write(2, "0002");
    wait_for(state, 2);
    EXPECT_EQ(read_state(state).ranges.text(), "[0,1) [2,3)") << "0001 is half a file";
    EXPECT_TRUE(std::filesystem::exists(scratch / "o.exr")) << "refreshed on the way";
    renderer.write(3, "0003");
    wait_for(state, 3);
    renderer.write(1, "0001");
    const Said said = watching.get();
    EXPECT_EQ(said.code, 0) << said.err;
    expect_in("m_0001.exr", said.err);
    expect_in("m_0009.exr", said.err);
    EXPECT_EQ(read_state(state).ranges.text(), "[0,4)");
    EXPECT_TRUE(read_state(state).sums == batches.sums({0, 2, 3, 1}));
    EXPECT_FALSE(read_state(state).sums == batches.sums({0, 1, 2, 3})) << "planted fault: another order";
}

TEST(StateTool, watch_started_again_adds_nothing_twice) {
    const Scratch scratch;
    const Batches batches(4);
    const Renderer renderer(batches);
    const std::string state = scratch / "s.exr";
    for (const int k : {0, 1}) renderer.write_at_once(k);
    const Said stopped =
        tool(renderer.watch(state) + Words{"--checkpoint", "0"}, {.signal = SIGINT, .wait = [&] { wait_for(state, 2); }});
    EXPECT_EQ(stopped.code, 130) << stopped.err;
    expect_in("holds batches [0,2); the same command with --resume goes on", stopped.err);
    for (const int k : {2, 3}) renderer.write_at_once(k);
    EXPECT_EQ(tool(renderer.watch(state) + Words{"--until-batches", "4"}).code, 0);
    EXPECT_TRUE(read_state(state).sums == batches.sums(0, 4));
    EXPECT_EQ(tool(renderer.watch(state) + Words{"--until-batches", "4"}).code, 0) << "there already";
}

TEST(StateTool, watch_ends_on_a_target_error) {
    const Scratch scratch;
    const Batches batches(6);
    const Renderer renderer(batches);
    const std::string state = scratch / "s.exr";
    const auto rms = [&](int n) {
        const auto out = combine(Moments(Engine{}, batches.sums(0, n)), Tau(1.f), {.standard_error = true});
        double sum = 0, finite = 0;
        for (const float e : out.standard_error)
            if (std::isfinite(e)) {
                sum += static_cast<double>(e) * e;
                ++finite;
            }
        return std::sqrt(sum / finite);
    };
    const double target = rms(6);
    ASSERT_LT(target, rms(3));
    for (const int k : {0, 1, 2}) renderer.write_at_once(k);
    auto watching = std::async(std::launch::async, [&] {
        return tool(renderer.watch(state) + Words{"--checkpoint", "0", "--until-error", std::to_string(1.001 * target),
                                                  "--tau", "1", "-o", scratch / "o.exr"});
    });
    wait_for(state, 3);
    std::this_thread::sleep_for(300ms);
    for (const int k : {3, 4, 5}) renderer.write_at_once(k);
    EXPECT_EQ(watching.get().code, 0);
    EXPECT_GT(inspect_state(state).sums.batches(), 3u);
}

TEST(StateTool, watch_refuses_what_it_cannot_number) {
    const Scratch scratch;
    const Batches batches(1);
    const Renderer renderer(batches);
    const auto watch = [&](const Words& more) {
        return Words{"combine", "--watch", renderer / "", "--tau", "1", "-o", scratch / "o.exr", "--settle", "0"} + more;
    };
    expect_refused(watch({"--m", "m.exr", "--t", "t_*.exr"}), 2, "--m m.exr: with --watch, a file name with one *");
    expect_refused(watch({"--m", "m_*.exr", "--t", "t_*_*.exr"}), 2, "--t t_*_*.exr");
    expect_refused(watch({"--m", "a/m_*.exr", "--t", "t_*.exr"}), 2, "--m a/m_*.exr");
    expect_refused(watch({"--m", "a", "b", "--t", "c", "d"}), 2, "one pattern for --m");
    put_bytes(renderer / "m_1.exr", "x");
    put_bytes(renderer / "m_01.exr", "x");
    expect_refused(watch({"--m", "m_*.exr", "--t", "t_*.exr"}), 1, "has the number of");
    expect_refused(
        {"combine", "--watch", scratch / "none", "--m", "m_*.exr", "--t", "t_*.exr", "--tau", "1", "-o", scratch / "o.exr"},
        1, "cannot be watched");
    expect_refused(batches.combine(0, 1) + Words{"--tau", "1", "-o", scratch / "o.exr", "--until-batches", "3"}, 2,
                   "--until-batches requires --watch");
}
