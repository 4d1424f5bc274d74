// clratio render and clratio study, run as a user runs them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "checksum.hpp"
#include "clratio/image.hpp"
#include "clratio/medium.hpp"
#include "support/scenes.hpp"
#include "support/study.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

/// Two pieces for each of 15 series.
const Words small{"study", "--scenes", "spheres", "--size", "12x9", "--seeds", "18", "--no-report"};
constexpr int pieces = 30;

/// Of the small study in one go.
const StudyFiles& whole() {
    static const StudyFiles csv = [] {
        const Scratch scratch;
        EXPECT_EQ(answer(small + Words{"-o", scratch / "s"})["computed"], pieces);
        return StudyFiles(scratch / "s");
    }();
    return csv;
}

std::string some_part(const std::string& folder) { return folder + "/parts/spheres_wvds-mis_iid_12x9_seeds16-17.sums"; }

/// The head that a part with this body must have.
std::string sealed(const std::string& body) {
    Checksum sum;
    sum.add(std::span<const char>(body));
    char head[96];
    std::snprintf(head, sizeof head, "clratio study part 2, checksum %016llx, %zu bytes\n",
                  static_cast<unsigned long long>(sum.sum()), body.size());
    return head + body;
}

}  // namespace

TEST(Render, writes_what_the_library_renders) {
    const Scratch scratch;
    const json said = answer({"render", "dense", "--spp", "3", "--seed", "7", "--estimator", "ds", "--pattern", "offset",
                              "--size", "20x14", "-o", scratch / "new/out"});
    EXPECT_EQ(said["files"].size(), 4u);
    const MediumScene scene(Engine{}, test::scenes()[3], {20, 14});
    const auto want = render(scene, {Sampling::ds, Pattern::offset, false}, {7}, 3);
    EXPECT_EQ(read_image(scratch / "new/out/m.exr").values, want.m);
    EXPECT_EQ(read_image(scratch / "new/out/t.exr").values, want.t);
    EXPECT_EQ(read_image(scratch / "new/out/tau.exr").values, tau_image(scene));
    EXPECT_EQ(read_image(scratch / "new/out/reference.exr").values, reference_image(scene));
}

TEST(Render, images_are_combined) {
    const Scratch scratch;
    answer({"render", "spheres", "--batches", "2", "--size", "40x30", "-o", scratch / "r"});
    const json said = answer({"combine", "--m", scratch / "r/m_000.exr", scratch / "r/m_001.exr", "--t",
                              scratch / "r/t_000.exr", scratch / "r/t_001.exr", "--tau", scratch / "r/tau.exr",
                              "--reference", scratch / "r/reference.exr", "-o", scratch / "out.exr"});
    EXPECT_LT(said["rmse"].get<double>(), said["rmse_mean"].get<double>());
    EXPECT_NE(bytes_of(scratch / "r/m_000.exr"), bytes_of(scratch / "r/m_001.exr"));
}

TEST(Render, mistakes_are_named) {
    const Scratch scratch;
    const Words to{"-o", scratch / "r"};
    expect_refused(Words{"render", "nowhere"} + to, 2, "nowhere: no such scene; there are louvres, window, spheres, dense");
    expect_refused(Words{"render", "dense", "--estimator", "best"} + to, 2, "sampling: expected one of uni, ds");
    expect_refused(Words{"render", "dense", "--pattern", "grid"} + to, 2, "pattern: expected one of iid");
    expect_refused(Words{"render", "dense", "--size", "20"} + to, 2, "--size: expected WIDTHxHEIGHT");
    expect_refused(Words{"render", "dense", "--size", "20x0"} + to, 2, "--size");
    expect_refused(Words{"render", "dense", "--spp", "0"} + to, 2, "--spp");
    expect_refused(Words{"render", "dense", "--seed", "1e30"} + to, 2, "--seed");
    expect_refused(Words{"render", "dense", "--seed", "18446744073709551615", "--batches", "2"} + to, 2, "--seed");
    expect_refused(Words{"render", scratch / "none.json"} + to, 1, "none.json: cannot be read");
    put_bytes(scratch / "file", "");
    expect_refused({"render", "dense", "-o", scratch / "file/r"}, 1, "cannot be made a folder");
    EXPECT_FALSE(std::filesystem::exists(scratch / "r"));
}

TEST(Study, bytes_are_the_same_for_any_shards) {
    const Scratch scratch;
    const std::string a = scratch / "a", b = scratch / "b", c = scratch / "c";
    EXPECT_EQ(answer(small + Words{"--shard", "1/3", "-o", a})["files"].size(), 0u);
    EXPECT_FALSE(std::filesystem::exists(a + "/errors.csv"));
    answer(small + Words{"--shard", "3/3", "-o", b});
    const json said = answer(small + Words{"--merge", a, b, "-o", c});
    EXPECT_EQ(said["taken"], 20);
    EXPECT_EQ(said["computed"], 10);
    EXPECT_EQ(StudyFiles(c), whole());
}

TEST(Study, goes_on_after_being_killed_at_any_moment) {
    const Scratch scratch;
    const Words words = small + Words{"-o", scratch / "s"};
    std::mt19937 random(1);
    int killed = 0;
    for (int i = 0; i < 6; ++i) {
        const auto moment = std::chrono::milliseconds(100 + random() % 900);
        killed += clratio_tool(words, {.signal = SIGKILL, .wait = [=] { std::this_thread::sleep_for(moment); }}).code == 137;
    }
    answer(words);
    EXPECT_GT(killed, 0);
    EXPECT_EQ(StudyFiles(scratch / "s"), whole());
    EXPECT_EQ(answer(words)["computed"], 0);
}

TEST(Study, stops_politely_and_says_how_to_go_on) {
    const Scratch scratch;
    const Words words{"study", "--scenes", "louvres", "--seeds", "4096", "--size", "100x75", "-o", scratch / "s"};
    const auto first_part = [&] {
        for (int i = 0; i < 3000 && !std::filesystem::exists(scratch / "s/parts/louvres_uni_iid_100x75_seeds0-15.sums"); ++i)
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
    };
    const Said said = clratio_tool(words, {.signal = SIGINT, .wait = first_part});
    EXPECT_EQ(said.code, 130) << said.err;
    EXPECT_NE(said.err.find("the same command goes on from there"), std::string::npos) << said.err;
}

TEST(Study, damaged_parts_are_computed_again) {
    const Scratch scratch;
    const std::string folder = scratch / "s";
    const Words words = small + Words{"-o", folder};
    answer(words);
    const std::string part = bytes_of(some_part(folder));
    ASSERT_GT(part.size(), 10000u);
    for (const std::size_t at : {std::size_t{40}, part.size() / 2, part.size() - 3}) {
        std::string damaged = part;
        damaged[at] ^= 1;
        put_bytes(some_part(folder), damaged);
        EXPECT_EQ(answer(words)["computed"], 1) << at;
        EXPECT_EQ(bytes_of(some_part(folder)), part);
    }
    for (const std::string& cut : {part.substr(0, part.size() / 2), std::string(), part + "x"}) {
        put_bytes(some_part(folder), cut);
        EXPECT_EQ(answer(words)["computed"], 1) << cut.size();
    }
    EXPECT_EQ(StudyFiles(folder), whole());
}

// What the checks above look at does depend on the parts: one that is sealed but wrong is believed, and shows.
TEST(Study, a_forged_part_shows) {
    const Scratch scratch;
    const std::string folder = scratch / "s";
    answer(small + Words{"-o", folder});
    const std::string part = bytes_of(some_part(folder)), body = part.substr(part.find('\n') + 1);
    EXPECT_EQ(sealed(body), part);
    auto forged = json::parse(body);
    forged["sums"][3][1] = forged["sums"][3][1].get<std::int64_t>() + 1000000;
    auto settings = nlohmann::ordered_json::parse(body);
    settings["sums"][3][1] = forged["sums"][3][1].get<std::int64_t>();
    put_bytes(some_part(folder), sealed(settings.dump() + "\n"));
    EXPECT_EQ(answer(small + Words{"-o", folder})["computed"], 0);
    EXPECT_NE(StudyFiles(folder), whole());
}

TEST(Study, parts_of_another_scene_of_the_same_name_are_not_taken) {
    const Scratch scratch;
    const std::string file = scratch / "spheres.json", folder = scratch / "s";
    json scene = json::parse(bytes_of(std::string(CLRATIO_SOURCE) + "/tools/scenes/spheres.json"));
    answer(small + Words{"-o", folder});
    scene["medium"]["g"] = 0.21;
    put_bytes(file, scene.dump());
    Words other = small + Words{"-o", folder};
    other[2] = file;
    EXPECT_EQ(answer(other)["computed"], pieces);
    EXPECT_NE(StudyFiles(folder), whole());
}

TEST(Study, more_seeds_keep_the_parts_there_are) {
    const Scratch scratch;
    Words words = small + Words{"-o", scratch / "s"};
    words[6] = "16";
    EXPECT_EQ(answer(words)["computed"], 15);
    words[6] = "32";
    EXPECT_EQ(answer(words)["computed"], 15);
}

TEST(Study, mistakes_are_named) {
    const Scratch scratch;
    const Words to{"-o", scratch / "s"};
    expect_refused(Words{"study", "--shard", "0/2"} + to, 2, "--shard: expected I/N");
    expect_refused(Words{"study", "--shard", "3/2"} + to, 2, "--shard");
    expect_refused(Words{"study", "--shard", "2"} + to, 2, "--shard");
    expect_refused(Words{"study", "--scenes", "dense,moon"} + to, 2, "moon: no such scene");
    expect_refused(Words{"study", "--scenes", "dense,dense"} + to, 2, "dense: two scenes of this name");
    expect_refused(Words{"study", "--size", "400x400"} + to, 2, "--size: expected WIDTHxHEIGHT of at most 131071 pixels");
    expect_refused(Words{"study", "--seeds", "0"} + to, 2, "--seeds");
    expect_refused(Words{"study", "--lanes", "3"} + to, 2, "width");
    expect_refused(Words{"study", "--merge", scratch / "none"} + to, 1, "none: cannot be merged");
    json away = json::parse(bytes_of(std::string(CLRATIO_SOURCE) + "/tools/scenes/dense.json"));
    away["camera"]["at"] = {-10, 1.4, -4};
    put_bytes(scratch / "away.json", away.dump());
    expect_refused(Words{"study", "--scenes", scratch / "away.json", "--size", "8x6"} + to, 2,
                   "dense: no ray of the camera meets the fog");
    put_bytes(scratch / "file", "");
    expect_refused({"study", "-o", scratch / "file"}, 1, "cannot be made a folder");
}

TEST(Study, statistics_are_those_of_the_library) {
    const Errors csv(whole().errors);
    const MediumScene scene(Engine{}, test::scenes()[2], {12, 9});
    const auto errors = medium_errors(scene, {Sampling::wvds_mis}, {0, 18}, {}, {-0.25, 0.25, 256});
    double squares = 0, sum = 0, hits = 0;
    for (const auto p : errors.pixels) hits += p;
    for (std::size_t i = 0; i < errors.sums.size(); ++i) {
        if (i % 42 != 2 * 6 + 3 + 1) continue;  // N = 4, ratio, green
        squares += std::ldexp(static_cast<double>(errors.sums[i].squares), 12) * errors.unit * errors.unit;
        sum += static_cast<double>(errors.sums[i].sum) * errors.unit;
    }
    const std::string row = "spheres wvds-mis iid shared ratio 4 g";
    const auto& counts = errors.counts[2 * 6 + 3 + 1];
    EXPECT_NEAR(csv.at(row, "rmse"), std::sqrt(squares / (18 * hits)), 1e-9);
    EXPECT_NEAR(csv.at(row, "bias"), sum / (18 * hits), 1e-9);
    EXPECT_EQ(csv.at(row, "pixels"), hits);
    // Clustered by pixel, from the first 8 of the 18 seeds.
    const auto tau = tau_image(scene), reference = reference_image(scene);
    double x2 = 0, pair = 0, mean = 0;
    std::vector<double> of_pixels(tau.size() / 3);
    for (std::uint64_t seed = 0; seed < 8; ++seed) {
        const auto image = render(scene, {Sampling::wvds_mis}, {seed}, 4);
        for (std::size_t p = 0; p < of_pixels.size(); ++p) {
            const std::size_t i = 3 * p + 1;
            const float estimate = image.t[i] > 0 ? tau[i] * (image.m[i] / image.t[i]) : 0;
            const double x = std::pow(static_cast<double>(estimate - reference[i]), 2);
            x2 += x * x / (8 * hits);
            pair -= x * x / (8 * 7 * hits);
            mean += x / (8 * hits);
            of_pixels[p] += x;
        }
    }
    for (const double x : of_pixels) pair += x * x / (8 * 7 * hits);
    const double variance = ((x2 - pair) / 18 + pair - mean * mean) / (hits - 1);
    EXPECT_NEAR(csv.at(row, "rmse_pixel_error") / (std::sqrt(variance) / (2 * csv.at(row, "rmse"))), 1, 1e-5);
    EXPECT_NEAR(csv.at(row, "atom"), static_cast<double>(counts.atom) / static_cast<double>(counts.total()), 1e-9);
    EXPECT_TRUE(std::isnan(csv.at("spheres uni stratified shared mean 4 g", "predicted_rmse")));
    EXPECT_EQ(csv.rows.size(), 28u * 7 * 4);
}

TEST(Study, averages_and_short_chords_are_those_of_the_images) {
    const MediumScene scene(Engine{}, test::scenes()[2], {12, 9});
    const auto tau = tau_image(scene), reference = reference_image(scene);
    double of_ratios = 0, of_means = 0, hits = 0;
    for (std::uint64_t seed = 0; seed < 16; ++seed) {
        const auto a = render(scene, {Sampling::uni}, {seed, 0}, 1), b = render(scene, {Sampling::uni}, {seed, 1}, 1);
        for (std::size_t i = 0; i < tau.size(); ++i) {
            if (!(tau[i] > 0)) continue;
            const double exact = reference[i], whole = tau[i], am = a.m[i], at = a.t[i], bm = b.m[i], bt = b.t[i];
            of_ratios += whole * (am / at + bm / bt) / 2 - exact;
            of_means += whole * (am + bm) / (at + bt) - exact;
            ++hits;
        }
    }
    const Errors averages(whole().averages, 4);
    EXPECT_EQ(averages.rows.size(), 2u * 2 * 7);
    EXPECT_NEAR(averages.at("spheres uni mean-of-ratios 2", "bias"), of_ratios / hits, 1e-7);
    EXPECT_NEAR(averages.at("spheres uni ratio 2", "bias"), of_means / hits, 1e-7);
    EXPECT_GT(std::abs(of_ratios - of_means) / hits, 1e-5) << "the planted fault";
    EXPECT_EQ(averages.at("spheres uni ratio 1", "rmse"), averages.at("spheres uni mean-of-ratios 1", "rmse"));

    std::vector<std::pair<double, std::size_t>> chords;
    for (std::uint32_t p = 0; p < 12 * 9; ++p) {
        const Sightline line(scene.scene(), camera_ray(scene.scene().camera, {12, 9}, p % 12, p / 12));
        if (line.hit()) chords.emplace_back(line.leave() - line.enter(), p);
    }
    std::sort(chords.begin(), chords.end());
    const Errors shorts(whole().chords, 4);
    const std::string row = "spheres ds ratio 4";
    const auto rays = static_cast<std::size_t>(0.1 * static_cast<double>(chords.size() - 1)) + 1;
    EXPECT_EQ(shorts.at(row, "rays"), rays);
    double square = 0, others = 0;
    for (std::uint64_t seed = 0; seed < 16; ++seed) {
        const auto image = render(scene, {Sampling::ds}, {seed}, 4);
        for (std::size_t k = 0; k < 2 * rays; ++k)
            for (std::size_t i = 3 * chords[k].second; i < 3 * chords[k].second + 3; ++i) {
                const double e = tau[i] * (image.m[i] / image.t[i]) - reference[i];
                (k < rays ? square : others) +=
                    std::pow(e / static_cast<double>(tau[i]), 2) / static_cast<double>(48 * rays);
            }
    }
    EXPECT_NEAR(shorts.at(row, "relative_rmse"), std::sqrt(square), 1e-6);
    EXPECT_GT(std::abs(others - square), 1e-5) << "the planted fault: the next tenth";
}

TEST(Study, parts_have_their_times_in_a_file_of_their_own) {
    const Scratch scratch;
    const std::string a = scratch / "a", b = scratch / "b";
    answer(small + Words{"--shard", "1/2", "-o", a});
    const auto lines = [](const std::string& folder) { return split(bytes_of(folder + "/times.jsonl"), '\n'); };
    ASSERT_EQ(lines(a).size(), 15u);
    for (const auto& line : lines(a)) EXPECT_GT(json::parse(line)["seconds"].get<double>(), 0);
    Words with_report = small;
    with_report.pop_back();
    put_bytes(a + "/times.jsonl", bytes_of(a + "/times.jsonl") + "{broken\n");
    EXPECT_EQ(clratio_tool(with_report + Words{"--merge", a, "-o", b}).code, 0);
    EXPECT_EQ(lines(b).size(), 15u);
    EXPECT_NE(bytes_of(b + "/report.html").find("15 of 30 parts"), std::string::npos);
    EXPECT_EQ(clratio_tool(with_report + Words{"-o", a}).code, 0);
    EXPECT_NE(bytes_of(a + "/report.html").find("30 of 30 parts"), std::string::npos);
    EXPECT_EQ(StudyFiles(a), whole());
}

TEST(Study, report_stands_alone) {
    const Scratch scratch;
    const Words words{"study",   "--scenes", "spheres,window", "--size", "24x18",
                      "--seeds", "2",        "--quick",        "-o",     scratch / "s"};
    EXPECT_EQ(clratio_tool(words).code, 0);
    const std::string html = bytes_of(scratch / "s/report.html");
    EXPECT_GT(html.size(), 200000u);
    EXPECT_LT(html.size(), 6000000u);
    for (const char* outside : {"http:", "https:", "<script", "<link", "@import", "url("})
        EXPECT_EQ(html.find(outside), std::string::npos) << outside;
    for (const char* part : {"Table 1.", "Table 2.", "Figure 1.", "Figure 2.", "id=\"claims\"", "id=\"audit\"",
                             "id=\"chords\"", "id=\"averages\"", "id=\"speed\"", "data:image/png;base64,",
                             "prefers-color-scheme:dark", "Philox4x32-10", "</html>"})
        EXPECT_NE(html.find(part), std::string::npos) << part;
    EXPECT_EQ(html.find("nan"), std::string::npos);
}

// Slow where the programs of these widths are built for the first time.
TEST(Study, SlowBytesAreTheSameAtAnyWidth) {
    for (const char* lanes : {"1", "4"}) {
        const Scratch scratch;
        EXPECT_EQ(answer(small + Words{"--lanes", lanes, "-o", scratch / "s"})["computed"], pieces);
        EXPECT_EQ(StudyFiles(scratch / "s"), whole()) << lanes;
    }
}
