// The command line, run as a user runs it.
#include <ImfStringAttribute.h>
#include <gtest/gtest.h>
#include <png.h>

#include <cmath>
#include <limits>

#include "clratio/image.hpp"
#include "support/cycles.hpp"
#include "support/exr.hpp"
#include "support/tool.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

// The value that eq. (10) gives in double for the means of the files; zero denominators give 0.
std::vector<double> ratio_in_double(const Words& m, const Words& t, const Image& tau) {
    std::vector<double> sum_m(tau.size()), sum_t(tau.size());
    for (std::size_t k = 0; k < m.size(); ++k) {
        const Image a = read_image(m[k]), b = read_image(t[k]);
        for (std::size_t i = 0; i < tau.size(); ++i) {
            sum_m[i] += a.values[i];
            sum_t[i] += b.values[i];
        }
    }
    const auto n = static_cast<double>(m.size());
    for (std::size_t i = 0; i < tau.size(); ++i) {
        const double impulse = tau.values[i] == 0;
        const double denominator = sum_t[i] / n + impulse;
        sum_m[i] = denominator == 0 ? 0 : (tau.values[i] + impulse) * (sum_m[i] / n) / denominator;
    }
    return sum_m;
}

struct Row {
    int batches;
    double mean, ratio, mean_of_ratios;
};
const std::map<std::string, std::vector<Row>> tables{
    {"area",
     {{1, .02194, .01772, .01772}, {2, .01594, .01256, .01288}, {4, .01189, .00898, .00946}, {8, .00937, .00645, .00700}}},
    {"volume",
     {{1, .17570, .13063, .13063}, {2, .12410, .08602, .10699}, {4, .08969, .04906, .09316}, {8, .06483, .02661, .08532}}}};

json scene_scores(const std::string& scene, int batches, const Words& more) {
    const Scratch scratch;
    return answer(pairs(scene, batches) +
                  Words{"--tau", reference(scene, "t"), "--reference", reference(scene, "m"), "-o", scratch / "o.exr"} +
                  more);
}

}  // namespace

TEST(Tool, rmse_of_the_real_renders_is_as_published) {
    for (const auto& [scene, rows] : tables)
        for (const Row& row : rows) {
            SCOPED_TRACE(scene + " " + std::to_string(row.batches));
            const json ratio = scene_scores(scene, row.batches, {"--zero", "zero"});
            EXPECT_NEAR(ratio["rmse"], row.ratio, 1e-5);
            EXPECT_NEAR(ratio["rmse_mean"], row.mean, 1e-5);
            const json mean = scene_scores(scene, row.batches, {"--zero", "zero", "--estimator", "mean-of-ratios"});
            EXPECT_NEAR(mean["rmse"], row.mean_of_ratios, 1e-5);
        }
}

TEST(Tool, the_published_table_sees_another_policy) {
    EXPECT_GT(std::fabs(scene_scores("volume", 8, {"--zero", "one"})["rmse"].get<double>() - .02661), 1e-4);
}

TEST(Tool, more_batches_than_a_launch_takes) {
    const Scratch scratch;
    const json once = scene_scores("volume", 8, {"--zero", "zero"}), twice = scene_scores("volume", 16, {"--zero", "zero"});
    EXPECT_EQ(twice["batches"], 16);
    EXPECT_NEAR(twice["rmse"], once["rmse"].get<double>(), 1e-7);
}

TEST(Tool, json_has_every_field) {
    const json j = scene_scores("volume", 2, {});
    EXPECT_EQ(j["batches"], 2);
    EXPECT_EQ(j["pixels"], 30000);
    EXPECT_EQ(j["channels"], 3);
    EXPECT_EQ(j["estimator"], "ratio");
    EXPECT_EQ(j["device"], Engine{}.info().name);
    for (const char* name : {"zero_denominator", "zero_tau", "skipped", "no_data", "no_error_bar", "nonfinite", "any"})
        EXPECT_TRUE(j["flags"][name].is_number_unsigned()) << name;
    for (const char* name : {"decode", "device", "encode"}) EXPECT_TRUE(j["seconds"][name].is_number_float()) << name;
    for (const char* name : {"rmse", "bias", "rmse_mean", "bias_mean"}) EXPECT_TRUE(j[name].is_number_float()) << name;
    const Scratch scratch;
    EXPECT_FALSE(answer(pairs("area", 1) + Words{"--tau", "1", "-o", scratch / "o.exr"}).contains("rmse"));
}

TEST(Tool, the_multilayer_pair_combines_without_conversion) {
    const Scratch scratch;
    const std::string out = scratch / "o.exr", tau = reference("multilayer", "t");
    answer(pairs("multilayer", 2) + Words{"--tau", tau, "--zero", "zero", "-o", out});
    const Image image = read_image(out), first = read_image(files("multilayer", "m", 1)[0]);
    const auto want = ratio_in_double(files("multilayer", "m", 2), files("multilayer", "t", 2), read_image(tau));
    double worst = 0;
    for (std::size_t i = 0; i < want.size(); ++i)
        worst = std::max(worst, std::fabs(image.values[i] - want[i]) / std::max(1e-30, std::fabs(want[i])));
    EXPECT_LE(worst, 3 * std::ldexp(1, -24)) << "two means and a quotient, then the product with tau: 3 roundings";
    EXPECT_EQ(image.channels, first.channels);
    EXPECT_EQ(image.alpha, first.alpha) << "alpha is carried from the first batch";
    EXPECT_EQ(image.data_window, first.data_window);
}

TEST(Tool, layers_are_named_for_one_file_or_for_all) {
    const Scratch scratch;
    const Words layers{"a.B", "a.G", "a.R", "b.B", "b.G", "b.R"};
    clratio::test::write_exr(scratch / "x.exr", {{.channels = layers}});
    const std::string x = scratch / "x.exr", out = scratch / "o.exr";
    expect_refused({"combine", "--m", x, "--t", x, "--tau", "1", "-o", out}, 1, x + ": several layers and none named");
    answer({"combine", "--m", x, "--t", x + ":b", "--tau", x, "-o", out, "--layer", "a"});
    expect_refused({"combine", "--m", x, "--t", x, "--tau", x + ":c", "-o", out, "--layer", "a"}, 1,
                   x + ":c: no such layer");
}

TEST(Tool, writes_settings_and_metadata) {
    const Scratch scratch;
    answer(pairs("area", 2) +
           Words{"--tau", "1", "2", "3", "--zero", "one", "--nonfinite", "propagate", "-o", scratch / "o.exr"});
    Imf::MultiPartInputFile file((scratch / "o.exr").c_str());
    const auto text = [&](const char* name) { return file.header(0).typedAttribute<Imf::StringAttribute>(name).value(); };
    EXPECT_EQ(text("clratio/estimator"), "ratio");
    EXPECT_EQ(text("clratio/zero"), "one");
    EXPECT_EQ(text("clratio/nonfinite"), "propagate");
    EXPECT_EQ(text("clratio/batches"), "2");
    EXPECT_EQ(text("clratio/tau"), "1 2 3");
    EXPECT_EQ(text("Camera"), "Camera");

    answer(pairs("area", 2) + Words{"--tau", "1", "--weight", "1", "3", "--interval", ".9", "--groups", "2", "-o",
                                    scratch / "w.exr", "--upper", scratch / "u.exr"});
    Imf::MultiPartInputFile upper((scratch / "u.exr").c_str());
    const auto said = [&](const char* name) { return upper.header(0).typedAttribute<Imf::StringAttribute>(name).value(); };
    EXPECT_EQ(said("clratio/weight"), "1 3");
    EXPECT_EQ(said("clratio/groups"), "2");
    EXPECT_EQ(said("clratio/interval"), "0.9");
    EXPECT_EQ(said("clratio/method"), "fieller");
}

TEST(Tool, tau_is_a_number_one_a_channel_or_the_mean_of_files) {
    const Scratch scratch;
    Image m = made(5, 4, 3), t = made(5, 4, 2);
    write_image(scratch / "m.exr", m);
    write_image(scratch / "t.exr", t);
    write_image(scratch / "1.exr", made(5, 4, 1));
    write_image(scratch / "4.exr", made(5, 4, 4));
    const auto first_pixel = [&](const Words& tau) {
        answer(Words{"combine", "--m", scratch / "m.exr", "--t", scratch / "t.exr", "-o", scratch / "o.exr", "--tau"} + tau);
        const Image image = read_image(scratch / "o.exr");
        return std::vector<float>(image.values.begin(), image.values.begin() + 3);
    };
    EXPECT_EQ(first_pixel({"2"}), (std::vector<float>{3, 3, 3}));
    EXPECT_EQ(first_pixel({"1", "2", "4"}), (std::vector<float>{1.5, 3, 6}));
    EXPECT_EQ(first_pixel({scratch / "1.exr", scratch / "4.exr"}), (std::vector<float>{3.75, 3.75, 3.75}));
}

TEST(Tool, several_bands_give_the_bits_of_one) {
    const Scratch scratch;
    std::vector<Image> images(4, made(631, 401, 0));  // more than 2^19 values, in bands of another length
    std::uint32_t r = 1;
    for (auto& image : images)
        for (float& v : image.values) v = static_cast<float>((r = r * 747796405u + 2891336453u) >> 8) * 0x1p-24f;
    for (std::size_t i = 0; i < images.size(); ++i) write_image(scratch / (std::to_string(i) + ".exr"), images[i]);
    const auto file = [&](int i) { return scratch / (std::to_string(i) + ".exr"); };
    Moments sum{Engine{}, images[0].size()};
    for (int k = 0; k < 10; ++k) sum.add(images[k % 2], images[2 + k % 2]);
    const auto want = combine(sum, Tau(std::vector<float>{1, 2, 3}));
    Words words{"combine", "--tau", "1", "2", "3", "-o", scratch / "o.exr", "--flags", scratch / "f.exr", "--m"};
    for (int k = 0; k < 10; ++k) words.push_back(file(k % 2));
    words.push_back("--t");
    for (int k = 0; k < 10; ++k) words.push_back(file(2 + k % 2));
    const json j = answer(words);
    EXPECT_EQ(read_image(scratch / "o.exr").values, want.estimate);
    EXPECT_EQ(j["flags"]["any"], want.flags.any);

    Moments two{Engine{}, images[0].size()};
    for (int k = 0; k < 2; ++k) two.add(images[k], images[2 + k]);
    answer({"combine", "--tau", "1", "2", "3", "-o", scratch / "o.exr", "--m", file(0), file(1), "--t", file(2), file(3)});
    EXPECT_EQ(read_image(scratch / "o.exr").values, combine(two, Tau(std::vector<float>{1, 2, 3})).estimate);
}

TEST(Tool, zero_denominators_follow_the_policy_are_flagged_and_can_fail_the_run) {
    const Scratch scratch;
    Image t = made(5, 4, 2);
    t.values[7] = 0;
    write_image(scratch / "m.exr", made(5, 4, 3));
    write_image(scratch / "t.exr", t);
    const Words words{"combine", "--m", scratch / "m.exr", "--t", scratch / "t.exr", "--tau", "4", "-o", scratch / "o.exr"};
    for (const auto& [policy, value] : std::map<std::string, float>{{"mc-mean", 3}, {"zero", 0}, {"one", 4}}) {
        const json j = answer(words + Words{"--zero", policy, "--flags", scratch / "f.exr"});
        EXPECT_EQ(j["flags"]["zero_denominator"], 1);
        const Image out = read_image(scratch / "o.exr"), flags = read_image(scratch / "f.exr");
        EXPECT_EQ(out.values[7], value);
        EXPECT_EQ(out.values[6], 6);
        EXPECT_EQ(static_cast<unsigned>(flags.values[7]) & CLR_FLAG_ZERO_DENOMINATOR, CLR_FLAG_ZERO_DENOMINATOR);
        EXPECT_EQ(static_cast<unsigned>(flags.values[6]) & CLR_FLAG_ZERO_DENOMINATOR, 0u);
    }
    std::filesystem::remove(scratch / "o.exr");
    EXPECT_EQ(clratio_tool(words + Words{"--fail-on-flag"}).code, 3);
    EXPECT_TRUE(std::filesystem::exists(scratch / "o.exr")) << "flagged, but written";
    const Words clean{"combine", "--m", scratch / "m.exr", "--t",           scratch / "m.exr", "--tau",
                      "4",       "-o",  scratch / "o.exr", "--fail-on-flag"};
    EXPECT_EQ(clratio_tool(clean).code, 0);
    EXPECT_EQ(clratio_tool(clean + Words{"--stderr", scratch / "e.exr"}).code, 3) << "one batch has no error bar";
    EXPECT_EQ(read_image(scratch / "e.exr").values[0], std::numeric_limits<float>::infinity());
}

TEST(Tool, nonfinite_inputs_follow_the_policy) {
    const Scratch scratch;
    Image bad = made(5, 4, 3);
    bad.values[3 * 7 + 1] = std::numeric_limits<float>::quiet_NaN();
    write_image(scratch / "bad.exr", bad);
    write_image(scratch / "m.exr", made(5, 4, 3));
    write_image(scratch / "t.exr", made(5, 4, 2));
    const Words words{
        "combine", "--m", scratch / "bad.exr", scratch / "m.exr", "--t", scratch / "t.exr", scratch / "t.exr", "--tau",
        "4",       "-o",  scratch / "o.exr"};
    EXPECT_EQ(answer(words)["flags"]["skipped"], 1);
    EXPECT_EQ(read_image(scratch / "o.exr").values[22], 6);
    EXPECT_EQ(answer(words + Words{"--nonfinite", "propagate"})["flags"]["nonfinite"], 1);
    EXPECT_TRUE(std::isnan(read_image(scratch / "o.exr").values[22]));
    std::filesystem::remove(scratch / "o.exr");
    expect_refused(words + Words{"--nonfinite", "fail"}, 1, scratch / "bad.exr" + ": nan at column 2, row 1, channel G");
    EXPECT_FALSE(std::filesystem::exists(scratch / "o.exr"));
}

TEST(Tool, the_next_run_starts_from_the_kept_program) {
    const Scratch scratch;
    const std::string kept = scratch / "cache";
    const auto run = [&](const std::string& out) {
        const Said said = clratio_tool(pairs("area", 2) + Words{"--tau", reference("area", "t"), "-o", scratch / out},
                                       {.environment = {{"XDG_CACHE_HOME", kept}}});
        EXPECT_EQ(said.code, 0) << said.err;
        return bytes_of(scratch / out);
    };
    const auto entry_times = [&] {
        std::map<std::string, std::filesystem::file_time_type> times;
        for (const auto& f : std::filesystem::directory_iterator(kept + "/clratio"))
            times[f.path().filename()] = f.last_write_time();
        return times;
    };
    const std::string first = run("first.exr");
    const auto times = entry_times();
    EXPECT_EQ(times.size(), 1u);
    EXPECT_EQ(run("second.exr"), first);
    EXPECT_EQ(entry_times(), times);
}

TEST(Tool, the_plain_mean_goes_without_tau) {
    const Scratch scratch;
    const Words mean = pairs("area", 3) + Words{"--estimator", "mean"};
    const auto outputs = [&](const std::string& name) {
        return Words{"-o",         scratch / (name + ".exr"),
                     "--stderr",   scratch / (name + "e.exr"),
                     "--lower",    scratch / (name + "l.exr"),
                     "--interval", ".9",
                     "--method",   "delta"};
    };
    answer(mean + outputs("a"));
    answer(mean + Words{"--tau", "7"} + outputs("b"));
    for (const char* kind : {".exr", "e.exr", "l.exr"})
        EXPECT_EQ(read_image(scratch / ("a" + std::string(kind))).values,
                  read_image(scratch / ("b" + std::string(kind))).values)
            << kind;
    const auto says_tau = [&](const char* name) {
        Imf::MultiPartInputFile file((scratch / name).c_str());
        return file.header(0).findTypedAttribute<Imf::StringAttribute>("clratio/tau") != nullptr;
    };
    EXPECT_FALSE(says_tau("a.exr"));
    EXPECT_TRUE(says_tau("b.exr"));
    expect_refused(mean + Words{"-o", scratch / "o.exr", "--interval", ".9"}, 2,
                   "--tau is required for --bias and for --method");
}

TEST(Tool, usage_errors_exit_2) {
    const Words pair{"combine", "--m", "m.exr", "--t", "t.exr"};
    expect_refused({}, 2, "a subcommand is needed");
    expect_refused({"frob"}, 2, "frob");
    expect_refused({"combine"}, 2, "--m is required");
    expect_refused(pair + Words{"-o", "o.exr"}, 2, "--tau is required");
    expect_refused({"combine", "--m", "a", "b", "--t", "c", "--tau", "1", "-o", "o.exr"}, 2,
                   "--m has 2 files and --t has 1");
    expect_refused(pair + Words{"--tau", "nan", "-o", "o.exr"}, 2, "--tau: expected a finite number, got nan");
    expect_refused(pair + Words{"--tau", "inf", "-o", "o.exr"}, 2, "got inf");
    expect_refused(pair + Words{"--tau", "1e999", "-o", "o.exr"}, 2, "got 1e999");
    expect_refused(pair + Words{"--tau", "1", "a.exr", "-o", "o.exr"}, 2, "either numbers or files");
    expect_refused(pair + Words{"--tau", "1", "-o", "o.exr", "--zero", "two"}, 2, "two");
    expect_refused(pair + Words{"--tau", "1", "-o", "o.exr", "--flags", "o.exr"}, 2, "o.exr: named for two outputs");
    const Words averaged = pair + Words{"--tau", "1", "-o", "o.exr", "--estimator", "mean-of-ratios"};
    expect_refused(averaged + Words{"--stderr", "e.exr"}, 2, "--stderr: mean-of-ratios has no standard error");
    expect_refused(averaged + Words{"--needed", "n.exr", "--target", "1"}, 2, "--needed: mean-of-ratios has no");
    expect_refused(averaged + Words{"--interval", ".9", "--method", "delta"}, 2, "--method delta: mean-of-ratios has no");
    expect_refused(averaged + Words{"--watch", "d", "--until-error", "1"}, 2, "--until-error: mean-of-ratios has no");
    const Scratch scratch;
    expect_refused(pairs("area", 1) + Words{"--tau", "1", "2", "-o", scratch / "o.exr"}, 2,
                   "2 numbers for the 3 channels of " + files("area", "m", 1)[0]);
    const Words numbered = pair + Words{"--tau", "1", "-o", "o.exr"};
    for (const char* weight : {"0", "-1", "nan", "1e-46", "1e38"})
        expect_refused(numbered + Words{"--weight", weight}, 2, "--weight: expected numbers from 2^-60 to 2^60");
    expect_refused(numbered + Words{"--first-batch", "-1"}, 2, "--first-batch");
    expect_refused(numbered + Words{"--method", "delta"}, 2, "--method requires --interval (see clratio combine --help)");
    expect_refused(numbered + Words{"--checkpoint", "1"}, 2, "--checkpoint requires --state");
    expect_refused(numbered + Words{"--settle", "1"}, 2, "--settle requires --watch");
    expect_refused(numbered + Words{"--needed", "n.exr", "--target", "nan"}, 2, "--target: expected a number above 0");
}

TEST(Tool, a_glob_that_takes_the_reference_for_a_batch_is_refused) {
    const Words all = Words{"combine", "--m", reference("area", "m")} + files("area", "m", 1) +
                      Words{"--t", reference("area", "t")} + files("area", "t", 1) + Words{"-o", "o.exr"};
    expect_refused(all + Words{"--tau", reference("area", "t")}, 2, "a batch of --t, and the --tau");
    expect_refused(all + Words{"--tau", "1", "--reference", reference("area", "m")}, 2,
                   "a batch of --m, and the --reference");
}

TEST(Tool, errors_exit_1_and_name_the_file) {
    const Scratch scratch;
    const std::string out = scratch / "o.exr", none = scratch / "none.exr", text = scratch / "text.exr",
                      small = scratch / "small.exr";
    const std::string m = files("area", "m", 1)[0], t = files("area", "t", 1)[0];
    clratio::test::put_bytes(text, "text");
    write_image(small, made(5, 4, 1));
    const auto refused = [&](const std::string& m_file, const std::string& t_file, const std::string& tau,
                             const std::string& part) {
        expect_refused({"combine", "--m", m_file, "--t", t_file, "--tau", tau, "-o", out}, 1, part);
        EXPECT_FALSE(std::filesystem::exists(out));
    };
    refused(none, t, "1", none + ": no such file");
    refused(m, none, "1", none + ": no such file");
    refused(m, t, none, none + ": no such file");
    expect_refused({"combine", "--m", text, none, "--t", t, t, "--tau", "1", "-o", out}, 1, none + ": no such file");
    refused(m, text, "1", text);
    refused(m, small, "1", small);
    refused(m, small, "1", m);
    refused(m, t, small, small);
    clratio::test::put_bytes(scratch / "cut.exr", clratio::test::bytes_of(m).substr(0, 90000));
    refused(scratch / "cut.exr", t, "1", scratch / "cut.exr");
    const Words good{"combine", "--m", m, "--t", t, "--tau", "1"};
    expect_refused(good + Words{"-o", scratch / "no/o.exr"}, 1, scratch / "no/o.exr");
    expect_refused(good + Words{"-o", "/dev/null"}, 1, "/dev/null: cannot be written: exists and is not a regular file");
    expect_refused(good + Words{"-o", out, "--reference", none}, 1, none);
    expect_refused(good + Words{"-o", out, "--reference", small}, 1, small);
    expect_refused({"compare", m, small}, 1, small);
    expect_refused({"compare", none, m}, 1, none);
    expect_refused({"picture", none, "-o", scratch / "p.png"}, 1, none);
    expect_refused({"picture", m, "-o", scratch / "no/p.png"}, 1, scratch / "no/p.png");
}

TEST(Tool, compare_computes_what_it_says) {
    const Scratch scratch;
    Image a = made(4, 1, 1), r = made(4, 1, 1);
    a.values = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, std::numeric_limits<float>::infinity(), 1};
    r.values = {1, 1, 1, 2, 2, 2, 4, 4, 4, 8, 8, std::numeric_limits<float>::quiet_NaN()};
    write_image(scratch / "a.exr", a);
    write_image(scratch / "r.exr", r);
    const Said said = clratio_tool({"compare", scratch / "a.exr", scratch / "r.exr", "--json"});
    ASSERT_EQ(said.code, 0) << said.err;
    const json j = json::parse(said.out);
    EXPECT_EQ(j["values"], 12);
    EXPECT_EQ(j["compared"], 10);
    EXPECT_EQ(j["nonfinite"], 1);
    EXPECT_EQ(j["nonfinite_reference"], 1);
    EXPECT_EQ(j["relative_mse_epsilon"], .01);
    double sum = 0, squares = 0, absolute = 0, relative = 0;
    for (std::size_t i = 0; i < 10; ++i) {
        const double e = a.values[i] - r.values[i], s = r.values[i];
        sum += e / 10;
        squares += e * e / 10;
        absolute += std::fabs(e) / 10;
        relative += e * e / (s * s + .01) / 10;
    }
    EXPECT_NEAR(j["bias"], sum, 1e-12);
    EXPECT_NEAR(j["rmse"], std::sqrt(squares), 1e-12);
    EXPECT_NEAR(j["mae"], absolute, 1e-12);
    EXPECT_NEAR(j["relative_mse"], relative, 1e-12);
    expect_in("mean((a - r)^2 / (r^2 + epsilon)), epsilon = 0.01",
              clratio_tool({"compare", scratch / "a.exr", scratch / "r.exr"}).out);
}

TEST(Tool, what_cannot_be_compared_is_said) {
    const Scratch scratch;
    Image nothing = made(4, 1, std::numeric_limits<float>::quiet_NaN()), most = made(4, 1, 1);
    write_image(scratch / "nothing.exr", nothing);
    most.values[5] = std::numeric_limits<float>::infinity();
    write_image(scratch / "most.exr", most);
    expect_refused({"compare", scratch / "most.exr", scratch / "nothing.exr"}, 1,
                   "most.exr: no value is finite in it and in " + scratch / "nothing.exr");
    write_image(scratch / "m.exr", made(4, 1, 1));
    const Words combine{"combine", "--m", scratch / "m.exr", "--t", scratch / "m.exr", "--tau",
                        "1",       "-o",  scratch / "o.exr"};
    expect_in("1 values not finite and left out", clratio_tool(combine + Words{"--reference", scratch / "most.exr"}).out);
    const json j = json::parse(clratio_tool(combine + Words{"--reference", scratch / "most.exr", "--json"}).out);
    EXPECT_EQ(j["compared"], 11);
}

TEST(Tool, need_where_all_batches_agree_is_flagged_and_counted) {
    const Scratch scratch;
    for (const int k : {0, 1}) {
        Image m = made(4, 1, 1);
        m.values[2] = 1 + static_cast<float>(k);
        write_image(scratch / (std::to_string(k) + "m.exr"), m);
        write_image(scratch / (std::to_string(k) + "t.exr"), made(4, 1, 2));
    }
    const Words m{"combine", "--m", scratch / "0m.exr", scratch / "1m.exr"};
    const Words t{"--t", scratch / "0t.exr", scratch / "1t.exr", "--tau", "2", "-o", scratch / "o.exr"};
    const Words combine = m + t + Words{"--needed", scratch / "n.exr", "--target", ".1"};
    expect_in("11  all batches agree", clratio_tool(combine).out);
    const json j = json::parse(clratio_tool(combine + Words{"--json", "--fail-on-flag"}).out);
    EXPECT_EQ(j["flags"]["no_spread"], 11);
    EXPECT_EQ(j["flags"]["any"], 0);
    const Image needed = read_image(scratch / "n.exr");
    EXPECT_EQ(needed.values[0], 0);
    EXPECT_GT(needed.values[2], 0);
}

TEST(Tool, devices_says_which_and_why) {
    const Said said = clratio_tool({"devices", "--json", "--self-test"}, {.environment = {{"CLRATIO_DEVICE", "cpu"}}});
    ASSERT_EQ(said.code, 0) << said.err;
    const json j = json::parse(said.out);
    EXPECT_EQ(j["reason"], "CLRATIO_DEVICE=cpu");
    EXPECT_EQ(j["devices"].size(), list_devices().size());
    EXPECT_TRUE(j["self_test"]);
    expect_in("would be picked: CLRATIO_DEVICE=cpu",
              clratio_tool({"devices"}, {.environment = {{"CLRATIO_DEVICE", "cpu"}}}).out);
    const Said none = clratio_tool({"devices"}, {.environment = {{"CLRATIO_DEVICE", "abacus"}}});
    EXPECT_EQ(none.code, 1);
    expect_in("got abacus", none.err);
    for (const auto& d : list_devices()) expect_in(d.name, none.out);
    expect_refused({"devices", "--json"}, 1, "abacus", {.environment = {{"CLRATIO_DEVICE", "abacus"}}});
}

TEST(Tool, without_a_platform_it_names_the_package_and_the_folder) {
    for (const Words& words : {Words{"devices"}, pairs("area", 1) + Words{"--tau", "1", "-o", "never.exr"}}) {
        expect_refused(words, 1, "pocl-opencl-icd", {.environment = {{"OCL_ICD_VENDORS", "/nowhere"}}});
        expect_refused(words, 1, "/etc/OpenCL/vendors", {.environment = {{"OCL_ICD_VENDORS", "/nowhere"}}});
    }
}

TEST(Tool, without_a_place_for_pocls_kernels_it_names_the_folder) {
    expect_refused({"devices"}, 1, "cannot keep its kernels in /dev/null/pocl",
                   {.environment = {{"POCL_CACHE_DIR", "/dev/null/pocl"}}});
    const Scratch scratch;
    const Said said = clratio_tool(
        {"devices"}, {.environment = {{"OCL_ICD_VENDORS", "/nowhere"}, {"POCL_CACHE_DIR", scratch / "new/pocl"}}});
    EXPECT_EQ(said.err.find("cannot keep"), std::string::npos) << "planted fault: any folder is to blame";
}

TEST(Tool, help_documents_the_exit_codes) {
    for (const Words& words : {Words{"--help"}, Words{"combine", "--help"}}) {
        const Said said = clratio_tool(words);
        EXPECT_EQ(said.code, 0);
        EXPECT_EQ(said.err, "");
        expect_in("Exit codes", said.out);
        expect_in("--fail-on-flag", said.out);
    }
}

TEST(Tool, picture_draws_srgb_side_by_side) {
    const Scratch scratch;
    Image half_grey = made(20, 10, .5f);
    half_grey.values[0] = std::numeric_limits<float>::quiet_NaN();
    write_image(scratch / "a.exr", half_grey);
    write_image(scratch / "b.exr", made(20, 10, .125f));
    const auto draw = [&](const Words& more) {
        const Said said =
            clratio_tool(Words{"picture", scratch / "a.exr", scratch / "b.exr", "-o", scratch / "p.png"} + more);
        EXPECT_EQ(said.code, 0) << said.err;
        png_image png{};
        png.version = PNG_IMAGE_VERSION;
        EXPECT_TRUE(png_image_begin_read_from_file(&png, (scratch / "p.png").c_str()));
        png.format = PNG_FORMAT_RGB;
        std::vector<int> size{static_cast<int>(png.width), static_cast<int>(png.height)};
        std::vector<std::uint8_t> bytes(PNG_IMAGE_SIZE(png));
        png_image_finish_read(&png, nullptr, bytes.data(), 0, nullptr);
        return std::pair{size, bytes};
    };
    const auto [size, plain] = draw({});
    EXPECT_EQ(size, (std::vector<int>{44, 10}));
    EXPECT_EQ((std::vector<std::uint8_t>(plain.begin(), plain.begin() + 6)),
              (std::vector<std::uint8_t>{255, 0, 255, 188, 188, 188}));
    EXPECT_EQ(plain[3 * 20], 255) << "the gap";
    EXPECT_EQ(plain[3 * 24], 99) << "sRGB of 1/8";
    EXPECT_EQ(draw({"--exposure", "2"}).second[3 * 24], 188);
    const auto [titled_size, titled] = draw({"--titles", "a,b"});
    EXPECT_GT(titled_size[1], 10);
    EXPECT_NE(std::count(titled.begin(), titled.end(), 0), std::count(plain.begin(), plain.end(), 0));
    expect_refused({"picture", scratch / "a.exr", "-o", scratch / "p.png", "--titles", "a,b"}, 2, "2 titles for 1 images");
}

TEST(Tool, numbers_are_read_strictly_and_names_need_not_be_text) {
    const Words law{"law", "--mu", ".5", "--tau", "1", "--sigma-m", "1", "--sigma-t", ".35", "--x", "0"};
    expect_refused(law + Words{"--n", "-1"}, 2, "--n: expected a whole number from 0 on, got -1");
    expect_refused(law + Words{"--n", "1.5"}, 2, "--n");
    EXPECT_EQ(answer(law + Words{"--n", "1e3"}), answer(law + Words{"--n", "1000"}));
    expect_refused(law + Words{"--rho", ""}, 2, "--rho: expected a number");
    expect_refused({"picture", "a.exr", "-o", "b.png", "--exposure", "nan"}, 2, "--exposure: expected a number");
    const Scratch scratch;
    const std::string odd = scratch / "o\xff.exr";
    EXPECT_EQ(answer(pairs("area", 1) + Words{"--tau", "1", "-o", odd})["batches"], 1);
    EXPECT_TRUE(std::filesystem::exists(odd));
}

TEST(Tool, an_empty_name_is_refused) {
    expect_refused(pairs("area", 1) + Words{"--tau", "", "-o", "never.exr"}, 2, "--tau: expected a text, got nothing");
    expect_refused({"compare", "", "ref.exr"}, 2, "expected a text, got nothing");
}
