// combine --watch, run as a user runs it, beside a renderer.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <future>

#include "support/state_tool.hpp"

using namespace clratio;
using namespace clratio::test;
using namespace std::chrono_literals;

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

TEST(WatchTool, adds_what_a_slow_renderer_has_finished_and_waits_for_what_a_killed_one_has_not) {
    const Scratch scratch;
    const Batches batches(4);
    const Renderer renderer(batches);
    const std::string state = scratch / "s.exr";
    put_bytes(renderer / "m_ref.exr", "no number");
    auto watching = std::async(std::launch::async, [&] {
        return clratio_tool(renderer.watch(state) +
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

TEST(WatchTool, started_again_adds_nothing_twice) {
    const Scratch scratch;
    const Batches batches(4);
    const Renderer renderer(batches);
    const std::string state = scratch / "s.exr";
    for (const int k : {0, 1}) renderer.write_at_once(k);
    const Said stopped = clratio_tool(renderer.watch(state) + Words{"--checkpoint", "0"},
                                      {.signal = SIGINT, .wait = [&] { wait_for(state, 2); }});
    EXPECT_EQ(stopped.code, 130) << stopped.err;
    expect_in("holds batches [0,2); the same command with --resume goes on", stopped.err);
    for (const int k : {2, 3}) renderer.write_at_once(k);
    EXPECT_EQ(clratio_tool(renderer.watch(state) + Words{"--until-batches", "4"}).code, 0);
    EXPECT_TRUE(read_state(state).sums == batches.sums(0, 4));
    EXPECT_EQ(clratio_tool(renderer.watch(state) + Words{"--until-batches", "4"}).code, 0) << "there already";
}

TEST(WatchTool, another_layer_than_that_of_the_state_ends_it) {
    const Scratch scratch;
    const Batches batches(2);
    const Renderer renderer(batches);
    const std::string state = scratch / "s.exr";
    write_state(state, state_of(Engine{}, 0, 1));
    const std::string held = bytes_of(state);
    renderer.write_at_once(1);
    expect_refused(renderer.watch(state), 1, "shadow");
    EXPECT_EQ(bytes_of(state), held);
}

TEST(WatchTool, ends_on_a_target_error) {
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
        return clratio_tool(renderer.watch(state) + Words{"--checkpoint", "0", "--until-error",
                                                          std::to_string(1.001 * target), "--tau", "1", "-o",
                                                          scratch / "o.exr"});
    });
    wait_for(state, 3);
    std::this_thread::sleep_for(300ms);
    for (const int k : {3, 4, 5}) renderer.write_at_once(k);
    EXPECT_EQ(watching.get().code, 0);
    EXPECT_GT(inspect_state(state).sums.batches(), 3u);
}

TEST(WatchTool, refuses_what_it_cannot_number) {
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

TEST(WatchTool, refuses_outputs_that_it_would_take_for_batches_and_files_that_are_missing) {
    const Batches batches(1);
    const Renderer renderer(batches);
    renderer.write_at_once(0);
    const std::string before = bytes_of(renderer / "m_0.exr");
    const Words watch = {"combine", "--watch", renderer / "",     "--m", "m_*.exr",  "--t", "t_*.exr",
                         "--tau",   "1",       "--until-batches", "1",   "--settle", "0"};
    for (const char* name : {"m_0.exr", "t_7.exr"})
        expect_refused(watch + Words{"-o", renderer / name}, 2, "an output that --watch would take for a batch");
    expect_refused(watch + Words{"-o", renderer / "out.exr", "--stderr", renderer / "m_1.exr"}, 2, "m_1.exr: an output");
    EXPECT_EQ(bytes_of(renderer / "m_0.exr"), before);
    expect_refused(watch + Words{"-o", renderer / "out.exr", "--reference", renderer / "none.exr"}, 1, "none.exr: no such");
    expect_refused({"combine", "--watch", renderer / "", "--m", "m_*.exr", "--t", "m_*.exr", "--tau", "1", "-o", "o.exr"}, 2,
                   "m_*.exr: the pattern of --m, and of --t");
    expect_refused(watch + Words{"-o", renderer / "out.exr", "--settle", "nan"}, 2, "--settle: expected seconds");
    EXPECT_EQ(clratio_tool(watch + Words{"-o", renderer / "m_mean.exr"}).code, 0) << "planted fault: any name is refused";
}
