#include "clratio/engine.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "cache.hpp"
#include "clratio/combine.hpp"
#include "embedded.hpp"
#include "engine_state.hpp"
#include "launch.hpp"
#include "support/raw_kernel.hpp"
#include "support/refused.hpp"
#include "support/scratch.hpp"
#include "support/shapes.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

/// Sets an environment variable as long as it lives.
class Environment {
public:
    Environment(const char* name, const std::string& value) : name_(name) {
        if (const char* old = std::getenv(name)) old_ = old;
        setenv(name, value.c_str(), 1);
    }
    ~Environment() { old_.empty() ? unsetenv(name_) : setenv(name_, old_.c_str(), 1); }

private:
    const char* name_;
    std::string old_;
};

std::vector<float> small_job(const Engine& engine) {
    const std::vector<float> m{1, 2, 3}, t{2, 4, 4};
    return combine(engine, m, t, 2.0f).estimate;
}

const std::vector<float> small_answer{1, 1, 1.5f};

std::vector<std::filesystem::path> entries(const std::filesystem::path& folder) {
    std::vector<std::filesystem::path> files;
    if (std::filesystem::exists(folder))
        for (const auto& f : std::filesystem::directory_iterator(folder)) files.push_back(f.path());
    return files;
}

}  // namespace

TEST(Engine, self_test_passes_at_every_shape) {
    for (const auto& shape : all_shapes()) EXPECT_TRUE(Engine(shape.options).self_test()) << shape.name;
}

TEST(Engine, same_bits_can_be_required) { EXPECT_NO_THROW(Engine({.require = Require::same_bits})); }

TEST(Engine, the_environment_picks_a_device) {
    for (const char* wish : {"0:0", "cpu", "CPU", "pthread"}) {
        const Environment set("CLRATIO_DEVICE", wish);
        EXPECT_EQ(pick_device().reason, std::string("CLRATIO_DEVICE=") + wish);
        EXPECT_EQ(pick_device().device.id, "0:0");
        EXPECT_EQ(Engine().info().id, "0:0");
    }
    EXPECT_EQ(pick_device().device.id, list_devices().front().id);
}

TEST(Engine, a_wish_that_no_device_meets_lists_what_there_is) {
    const Environment set("CLRATIO_DEVICE", "9:9");
    try {
        Engine();
        FAIL();
    } catch (const InvalidArgument& e) {
        EXPECT_EQ(e.name, "CLRATIO_DEVICE");
        EXPECT_EQ(e.got, "9:9");
        EXPECT_NE(e.expected.find("0:0 ("), std::string::npos) << e.expected;
    }
}

TEST(Engine, misuse_is_refused) {
    EXPECT_THROW(Engine(cl_command_queue{}), InvalidArgument);
    EXPECT_THROW(Engine({.width = 3}), InvalidArgument);
    EXPECT_THROW(Engine({.width = -1}), InvalidArgument);
    refused([] { Engine({.path = EngineOptions::Path::groups, .work_items = 1u << 30}); }, "work_items: expected at most ");
    const Engine engine;
    EXPECT_THROW(Buffer(engine, engine.info().largest_allocation + 1), InvalidArgument);
}

TEST(Engine, wraps_the_callers_queue) {
    const Engine own;
    const Engine wrapped(own.queue());
    EXPECT_EQ(wrapped.queue(), own.queue());
    EXPECT_EQ(wrapped.context(), own.context());
    EXPECT_EQ(wrapped.info().name, own.info().name);
    EXPECT_EQ(small_job(wrapped), small_answer);
}

TEST(Engine, is_shared_by_threads) {
    const Engine engine({.disk_cache = false});
    std::vector<std::vector<float>> results(8);
    {
        std::vector<std::jthread> threads;
        for (auto& r : results) threads.emplace_back([&r, engine] { r = small_job(engine); });
    }
    for (const auto& r : results) EXPECT_EQ(r, small_answer);
}

TEST(Engine, nothing_is_compiled_before_it_is_needed) {
    const Engine engine;
    EXPECT_TRUE(engine.state().programs.empty());
    small_job(engine);
    EXPECT_EQ(engine.state().programs.size(), 1u);
}

/// Every option that some kernel must be told; the last one keeps builds out of the driver's own cache.
std::string options_of_all_kernels() {
    return "-DCLR_GENERATOR=CLR_PHILOX -DCLR_LOCAL_ROWS=1 -DCLR_SAMPLING=6u -DCLR_INDEPENDENT_T=1 -DCLR_BUILT_BY=" +
           std::to_string(getpid());
}

// A full disk, as far as a test may go: what PoCL found when it started is gone when it builds.
TEST(Engine, a_build_without_a_place_for_pocls_kernels_names_the_folder) {
    testing::GTEST_FLAG(death_test_style) = "threadsafe";
    const char* given = std::getenv("CLRATIO_TEST_FOLDER");
    std::optional<Scratch> scratch;
    if (!given) scratch.emplace();
    const std::string folder = given ? given : *scratch / ".";
    const Environment shared("CLRATIO_TEST_FOLDER", folder), pocl("POCL_CACHE_DIR", folder + "/kernels");
    const auto build = [&] {
        const Engine engine({.disk_cache = false});
        std::filesystem::remove_all(folder + "/kernels");
        put_bytes(folder + "/kernels", "in its way");
        try {
            small_job(engine);
        } catch (const BuildError& e) {
            std::cerr << e.what();
            std::exit(1);
        }
        std::exit(0);
    };
    EXPECT_EXIT(build(), testing::ExitedWithCode(1), "cannot keep its kernels in .*/kernels; POCL_CACHE_DIR names another");
}

// Drivers print warnings on the stderr of the program that builds, which is not theirs.
TEST(Engine, builds_say_nothing) {
    for (const int width : {8, 16}) {
        const Engine engine({.width = width, .disk_cache = false});
        testing::internal::CaptureStderr();
        for (const auto& file : embedded_files) {
            const std::filesystem::path path(file.path);
            if (path.extension() == ".cl") program(engine.state(), path.stem(), width, options_of_all_kernels());
        }
        EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << width << " lanes";
    }
}

TEST(Engine, a_build_that_warns_would_be_heard) {
    const Engine engine;
    testing::internal::CaptureStderr();
    RawKernel(engine, "#warning\nkernel void k(global int* p) { *p = 1; }", "k", options_of_all_kernels());
    EXPECT_NE(testing::internal::GetCapturedStderr(), "");
}

TEST(Engine, a_failed_build_carries_the_log_with_the_real_file_and_line) {
    const Engine engine({.disk_cache = false});
    try {
        program(engine.state(), "engine", 5, "");
        FAIL();
    } catch (const BuildError& e) {
        EXPECT_EQ(e.word, "engine");
        EXPECT_NE(e.log.find("clratio/device/portable.h:"), std::string::npos) << e.log;
        EXPECT_NE(std::string(e.what()).find(e.log), std::string::npos);
    }
}

TEST(Engine, opencl_codes_have_names) {
    EXPECT_STREQ(DeviceError("clEnqueueNDRangeKernel", CL_OUT_OF_RESOURCES).what(),
                 "clEnqueueNDRangeKernel failed: CL_OUT_OF_RESOURCES (-5)");
}

TEST(Engine, sources_are_flattened_with_each_file_once) {
    const std::string source = flatten_kernel("combine");
    std::size_t times = 0;
    for (auto at = source.find("#line 1 \"clratio/device/portable.h\""); at != std::string::npos;
         at = source.find("#line 1 \"clratio/device/portable.h\"", at + 1))
        ++times;
    EXPECT_EQ(times, 1u);
    EXPECT_EQ(source.find("#include \"clratio"), std::string::npos);
    EXPECT_NE(device_source().find("clr_two_sum"), std::string::npos);
    EXPECT_THROW(flatten_kernel("nothing"), InvalidArgument);
}

TEST(Cache, an_entry_comes_back_whole) {
    const Scratch scratch;
    const auto file = cache::entry(scratch / ".", "key");
    EXPECT_FALSE(cache::load(file, "key"));
    const std::vector<unsigned char> payload{0, 1, 2, 255};
    ASSERT_TRUE(cache::store(file, "key", payload));
    EXPECT_EQ(cache::load(file, "key"), payload);
    EXPECT_FALSE(cache::load(file, "another key"));
    EXPECT_EQ(entries(scratch / ".").size(), 1u);
}

TEST(Cache, every_flipped_bit_and_every_cut_is_noticed) {
    const Scratch scratch;
    const auto file = cache::entry(scratch / ".", "key");
    ASSERT_TRUE(cache::store(file, "key", std::vector<unsigned char>(100, 7)));
    const std::string whole = bytes_of(file.string());
    for (std::size_t i = 0; i < whole.size(); ++i)
        for (int bit = 0; bit < 8; ++bit) {
            std::string damaged = whole;
            damaged[i] = static_cast<char>(damaged[i] ^ (1 << bit));
            put_bytes(file.string(), damaged);
            ASSERT_FALSE(cache::load(file, "key")) << "byte " << i << " bit " << bit;
        }
    for (std::size_t length = 0; length < whole.size(); ++length) {
        put_bytes(file.string(), whole.substr(0, length));
        ASSERT_FALSE(cache::load(file, "key")) << "cut to " << length;
    }
    put_bytes(file.string(), whole + "x");
    EXPECT_FALSE(cache::load(file, "key"));
    put_bytes(file.string(), whole);
    EXPECT_TRUE(cache::load(file, "key"));
}

TEST(Cache, a_disk_that_takes_nothing_is_no_error) {
    EXPECT_FALSE(cache::prepare("/proc/no/such/folder"));
    EXPECT_FALSE(cache::store("/proc/no/such/folder/entry.bin", "key", {1}));
    const Scratch scratch;
    const Environment pocl("POCL_CACHE_DIR", scratch / "."), set("XDG_CACHE_HOME", "/proc/no/such/folder");
    EXPECT_EQ(small_job(Engine()), small_answer);
}

TEST(Cache, its_folder_is_made_where_it_can_be) {
    const Scratch scratch;
    const std::filesystem::path folder = scratch / "a/b";
    EXPECT_TRUE(cache::prepare(folder));
    EXPECT_TRUE(cache::prepare(folder));
    EXPECT_TRUE(cache::store(cache::entry(folder, "key"), "key", {1}));
    EXPECT_FALSE(cache::prepare(entries(folder).front())) << "a file";
    EXPECT_FALSE(cache::prepare(entries(folder).front() / "clratio")) << "in a file";
}

// The driver's own static parts may go before the engine does: nothing may be asked of them then.
TEST(Cache, programs_of_a_static_engine_are_kept_at_exit) {
    testing::GTEST_FLAG(death_test_style) = "threadsafe";  // the process begins anew, in this test
    const char* given = std::getenv("CLRATIO_TEST_FOLDER");
    std::optional<Scratch> scratch;
    if (!given) scratch.emplace();
    const std::string folder = given ? given : *scratch / ".";
    const Environment shared("CLRATIO_TEST_FOLDER", folder), set("XDG_CACHE_HOME", folder), pocl("POCL_CACHE_DIR", folder);
    const auto leave = [] {
        static const Engine engine;
        std::exit(small_job(engine) == small_answer ? 0 : 1);
    };
    EXPECT_EXIT(leave(), testing::ExitedWithCode(0), "");
    EXPECT_EQ(entries(std::filesystem::path(folder) / "clratio").size(), 1u);
}

TEST(Cache, a_second_engine_starts_from_the_file_and_a_damaged_one_is_rebuilt) {
    const Scratch scratch;
    const Environment set("XDG_CACHE_HOME", scratch / ".");
    const std::filesystem::path folder = scratch / "clratio";
    EXPECT_EQ(small_job(Engine()), small_answer);
    ASSERT_EQ(entries(folder).size(), 1u);
    const auto file = entries(folder).front();
    const std::string whole = bytes_of(file.string());

    const Engine second;
    EXPECT_EQ(small_job(second), small_answer);
    for (const auto& [name, built] : second.state().programs) EXPECT_EQ(built.unsaved, "") << name;

    for (const std::size_t at : {std::size_t{0}, whole.size() / 3, whole.size() / 2, whole.size() - 1}) {
        std::string damaged = whole;
        damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
        put_bytes(file.string(), damaged);
        EXPECT_EQ(small_job(Engine()), small_answer) << "byte " << at;
        EXPECT_EQ(bytes_of(file.string()).size(), whole.size()) << "rewritten";
        EXPECT_NE(bytes_of(file.string()), damaged);
    }
}
