// Where the command line's outputs go: what they may not replace, and what is left when they fail.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "support/cycles.hpp"
#include "support/tool.hpp"

using namespace clratio::test;

TEST(OutputTool, outputs_replace_neither_inputs_nor_each_other_nor_a_state) {
    const Scratch scratch;
    const std::string m = scratch / "m.exr", t = scratch / "t.exr", state = scratch / "s.exr", o = scratch / "o.exr";
    std::filesystem::copy(files("area", "m", 1)[0], m);
    std::filesystem::copy(files("area", "t", 1)[0], t);
    const Words batch{"combine", "--m", m, "--t", t, "--tau", "1"};
    answer(Words{"combine", "--m", m, "--t", t, "--state", state});
    const std::string old = bytes_of(m), sums = bytes_of(state);
    expect_refused(batch + Words{"-o", scratch / "./m.exr"}, 2, "an input, and an output");
    expect_refused(batch + Words{"-o", o, "--flags", t}, 2, "an input, and an output");
    expect_refused(batch + Words{"-o", o, "--stderr", scratch / "./o.exr"}, 2, "named for two outputs");
    expect_refused(batch + Words{"-o", state}, 2, "holds a state");
    expect_refused({"picture", m, "-o", scratch / "./m.exr"}, 2, "an input, and the output");
    EXPECT_EQ(bytes_of(m), old);
    EXPECT_EQ(bytes_of(state), sums);
    EXPECT_EQ(scratch.files(), 3u);
}

TEST(OutputTool, outputs_go_to_files_alone) {
    const Scratch scratch;
    const std::string pipe = scratch / "pipe";
    ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
    const Words one{files("area", "m", 1)[0]};
    for (const std::string& place : {pipe, scratch / "."}) {
        expect_refused(pairs("area", 1) + Words{"--tau", "1", "-o", place}, 1, "exists and is not a regular file");
        expect_refused(Words{"picture"} + one + Words{"-o", place}, 1, "exists and is not a regular file");
    }
    EXPECT_TRUE(std::filesystem::is_fifo(pipe));
    std::filesystem::create_symlink("real.png", scratch / "link.png");
    EXPECT_EQ(clratio_tool(Words{"picture"} + one + Words{"-o", scratch / "link.png"}).code, 0);
    EXPECT_TRUE(std::filesystem::is_regular_file(scratch / "real.png"));
    std::filesystem::create_symlink("loop.png", scratch / "loop.png");
    expect_refused(Words{"picture"} + one + Words{"-o", scratch / "loop.png"}, 1, "cannot be written");
}

TEST(OutputTool, a_full_disk_exits_1_and_keeps_the_old_file) {
    const Scratch scratch;
    const std::string out = scratch / "o.exr";
    const Words words = pairs("area", 1) + Words{"--tau", "1", "-o", out};
    answer(words);
    const std::string old = clratio::test::bytes_of(out);
    expect_refused(words, 1, out + ": cannot be written: File too large", {.file_size_limit = old.size() - 1});
    EXPECT_EQ(clratio::test::bytes_of(out), old);
    EXPECT_EQ(scratch.files(), 1u);
}

TEST(OutputTool, pictures_keep_the_mode_of_what_they_replace_and_remove_what_killed_ones_left) {
    const Scratch scratch;
    const std::string out = scratch / "o.png";
    const Words words{"picture", files("area", "m", 1)[0], "-o", out};
    ASSERT_EQ(clratio_tool(words).code, 0);
    constexpr auto mine = std::filesystem::perms::owner_read | std::filesystem::perms::owner_write;
    std::filesystem::permissions(out, mine);
    put_bytes(scratch / ".o.png.1234-0.tmp", "half of one");
    put_bytes(scratch / ".other.png.1234-0.tmp", "another's");
    ASSERT_EQ(clratio_tool(words).code, 0);
    EXPECT_EQ(std::filesystem::status(out).permissions(), mine);
    EXPECT_EQ(scratch.files(), 2u);
    expect_refused(words, 1, out + ": cannot be written: File too large", {.file_size_limit = 100});
    EXPECT_EQ(scratch.files(), 2u);
}

TEST(OutputTool, a_full_standard_output_exits_1) {
    const Said said = clratio_tool({"compare", reference("area", "m"), reference("area", "m")}, {.out = "/dev/full"});
    EXPECT_EQ(said.code, 1);
    expect_in("standard output", said.err);
}

TEST(OutputTool, no_output_replaces_a_state) {
    const Scratch scratch;
    const std::string state = scratch / "s.exr", image = scratch / "o.exr";
    answer(pairs("area", 1) + Words{"--tau", "1", "-o", image, "--state", state});
    const std::string before = bytes_of(state);
    expect_refused({"picture", image, "-o", state}, 2, "s.exr: holds a state");
    const Said csv = clratio_tool(
        {"errors", "--mu", ".5", "--tau", "1", "--sigma-m", ".5", "--sigma-t", ".35", "--count", "1e3", "--csv", state});
    EXPECT_EQ(csv.code, 2) << csv.err;
    EXPECT_EQ(bytes_of(state), before);
    EXPECT_EQ(clratio_tool({"picture", image, "-o", scratch / "p.png"}).code, 0) << "planted fault: any file is a state";
}

TEST(OutputTool, a_name_may_be_as_long_as_the_system_lets_it) {
    const Scratch scratch;
    const std::string longest = std::string(251, 'x');
    const std::string image = scratch / longest + ".exr", png = scratch / longest + ".png";
    const Words job =
        pairs("area", 1) + Words{"--tau", "1", "-o", image, "--state", scratch / ("s" + image.substr(image.size() - 254))};
    EXPECT_EQ(clratio_tool(job).code, 0);
    EXPECT_EQ(clratio_tool({"picture", image, "-o", png}).code, 0);
    EXPECT_EQ(scratch.files(), 3u) << "nothing else is left";
    expect_refused({"picture", image, "-o", scratch / longest + "x.png"}, 1, "too long");
}

TEST(OutputTool, render_refuses_a_folder_with_batches_of_another_render) {
    const Scratch scratch;
    const Words render{"render", "louvres", "--size", "8x6", "-o", scratch / "r"};
    ASSERT_EQ(clratio_tool(render + Words{"--batches", "3"}).code, 0);
    EXPECT_EQ(clratio_tool(render + Words{"--batches", "3", "--seed", "5"}).code, 0) << "its own files it replaces";
    expect_refused(render + Words{"--batches", "2"}, 1, "_002.exr: is of another render");
    expect_refused(render, 1, "is of another render");
    const Words other{"render", "window", "--size", "8x6", "-o", scratch / "r", "--batches", "3"};
    expect_refused(other, 1, "cannot be written", {.file_size_limit = 100});
    for (const auto& entry : std::filesystem::directory_iterator(scratch / "r"))
        EXPECT_EQ(entry.path().filename().string().find("_00"), std::string::npos) << "batches of two renders";
}
