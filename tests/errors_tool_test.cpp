// clratio errors and clratio figures, run as a user runs them.
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>
#include <numbers>
#include <numeric>

#include "clratio/fit.hpp"
#include "clratio/histogram.hpp"
#include "clratio/law.hpp"
#include "support/split.hpp"
#include "support/tool.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

const ErrorModel paper{.5, 1, .5, .35};
const Words model{"errors", "--mu", ".5", "--tau", "1", "--sigma-m", ".5", "--sigma-t", ".35"};

json counted(const Words& words) { return answer(model + words); }

struct Csv {
    std::string header;
    std::vector<std::vector<std::string>> rows;

    explicit Csv(const std::string& file) {
        auto lines = split(bytes_of(file), '\n');
        if (lines.empty()) return;
        header = lines.front();
        for (std::size_t i = 1; i < lines.size(); ++i) rows.push_back(split(lines[i], ','));
    }
    std::uint64_t count(std::size_t row) const { return std::stoull(rows.at(row).at(4)); }
    double number(std::size_t row, std::size_t column) const { return std::stod(rows.at(row).at(column)); }
    std::vector<std::uint64_t> counts() const {
        std::vector<std::uint64_t> all;
        for (std::size_t i = 0; i < rows.size(); ++i) all.push_back(count(i));
        return all;
    }
};

std::vector<std::uint64_t> together(std::vector<std::uint64_t> a, const std::vector<std::uint64_t>& b) {
    EXPECT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
    return a;
}

std::vector<std::uint64_t> counts_of(const Words& words) {
    const Scratch scratch;
    counted(words + Words{"--bins", "64", "--csv", scratch / "h.csv"});
    return Csv(scratch / "h.csv").counts();
}

bool is_png(const std::string& bytes) { return bytes.rfind("\x89PNG\r\n", 0) == 0 && bytes.size() > 5000; }
bool is_svg(const std::string& bytes) {
    return bytes.find("<svg") != std::string::npos && bytes.find("</svg>") != std::string::npos && bytes.size() > 5000;
}

}  // namespace

TEST(Errors, json_has_every_field_and_the_counts_of_the_library) {
    const json j = counted({"--n", "1,4", "--count", "2e5", "--first", "7", "--bins", "100", "--range", "-2", "4", "--seed",
                            "3", "--stream", "5"});
    EXPECT_EQ(j["estimator"], "ratio");
    EXPECT_EQ(j["count"], 200000);
    EXPECT_EQ(j["first"], 7);
    EXPECT_EQ(j["rng"], "philox");
    EXPECT_EQ(j["device"], Engine{}.info().name);
    ASSERT_EQ(j["results"].size(), 2u);
    for (std::size_t k = 0; k < 2; ++k) {
        const json& r = j["results"][k];
        ErrorModel m = paper;
        m.n = k ? 4 : 1;
        EXPECT_EQ(r["n"], m.n);
        const auto h =
            error_histogram(Engine{}, canonical(m), {3, static_cast<std::uint32_t>(5 + k)}, {7, 200000}, {-2, 4, 100});
        EXPECT_EQ(r["counts"]["total"], 200000);
        EXPECT_EQ(r["counts"]["underflow"], h.underflow);
        EXPECT_EQ(r["counts"]["overflow"], h.overflow);
        EXPECT_EQ(r["counts"]["nonfinite"], h.nonfinite);
        const Fit fit = chi_square(h, ErrorLaw(Law::exact, m));
        EXPECT_EQ(r["chi2"], fit.statistic);
        EXPECT_EQ(r["dof"], fit.dof);
        EXPECT_EQ(r["p_exact"], fit.p);
        EXPECT_TRUE(fit.accepted()) << fit.p;
        EXPECT_EQ(r["p_published"], chi_square(h, ErrorLaw(Law::published, m)).p);
        EXPECT_GT(r["seconds"], 0);
        EXPECT_GT(r["samples_per_second"], 0);
    }
}

TEST(Errors, the_published_law_is_rejected_where_the_exact_one_is_not) {
    for (const char* seed : {"1", "2", "3"})
        for (const char* rng : {"philox", "pcg4d3x"}) {
            const json j = counted({"--count", "1e6", "--seed", seed, "--rng", rng});
            const double p = j["results"][0]["p_exact"];
            EXPECT_GT(p, 1e-6);
            EXPECT_LT(p, 1 - 1e-6);
            EXPECT_LT(j["results"][0]["p_published"], 1e-12);
        }
}

TEST(Errors, mc_follows_its_published_law) {
    const json j = counted({"--count", "1e6", "--estimator", "mc"});
    const double p = j["results"][0]["p_exact"];
    EXPECT_GT(p, 1e-6);
    EXPECT_LT(p, 1 - 1e-6);
    EXPECT_EQ(j["results"][0]["p_published"], p);
}

TEST(Errors, too_few_samples_have_no_p) {
    const json j = counted({"--count", "10"});
    EXPECT_TRUE(j["results"][0]["p_exact"].is_null());
    EXPECT_TRUE(j["results"][0]["chi2"].is_null());
}

TEST(Errors, csv_holds_every_cell) {
    const Scratch scratch;
    counted({"--n", "1,2", "--count", "1e5", "--bins", "50", "--range", "-2", "3", "--csv", scratch / "h.csv"});
    const Csv csv(scratch / "h.csv");
    EXPECT_EQ(csv.header, "estimator,n,lo,hi,count,density,exact,published");
    ASSERT_EQ(csv.rows.size(), 2 * 53u);
    for (std::size_t start : {0u, 53u}) {
        std::uint64_t total = 0;
        for (std::size_t i = start; i < start + 53; ++i) {
            ASSERT_EQ(csv.rows[i].size(), 8u);
            EXPECT_EQ(csv.rows[i][1], start ? "2" : "1");
            total += csv.count(i);
        }
        EXPECT_EQ(total, 100000u);
        ErrorModel m = paper;
        m.n = start ? 2 : 1;
        const auto exact = ErrorLaw(Law::exact, m).bin_densities(-2, 3, 50);
        const auto published = ErrorLaw(Law::published, m).bin_densities(-2, 3, 50);
        EXPECT_EQ(csv.rows[start][2], "-inf");
        EXPECT_EQ(csv.rows[start + 51][3], "inf");
        EXPECT_EQ(csv.rows[start + 52][2], "nan");
        for (std::size_t b = 1; b <= 50; ++b) {
            const std::size_t i = start + b;
            EXPECT_NEAR(csv.number(i, 2), -2 + .1 * static_cast<double>(b - 1), 1e-15);
            EXPECT_EQ(csv.rows[i][3], b < 50 ? csv.rows[i + 1][2] : "3");
            EXPECT_DOUBLE_EQ(csv.number(i, 5), static_cast<double>(csv.count(i)) / 1e4);
            EXPECT_NEAR(csv.number(i, 6), exact[b - 1], 1e-15);
            EXPECT_NEAR(csv.number(i, 7), published[b - 1], 1e-15);
        }
    }
}

TEST(Errors, parts_add_up_to_the_whole) {
    const auto whole = counts_of({"--n", "1,2", "--count", "300000"});
    const auto first = counts_of({"--n", "1,2", "--count", "123457"});
    const auto rest = counts_of({"--n", "1,2", "--count", "176543", "--first", "123457"});
    EXPECT_EQ(together(first, rest), whole);
    const auto beside = counts_of({"--n", "1,2", "--count", "176543", "--first", "123458"});  // one draw late
    EXPECT_NE(together(first, beside), whole);
    EXPECT_NE(counts_of({"--n", "1,2", "--count", "300000", "--seed", "2"}), whole);
    EXPECT_NE(counts_of({"--n", "1,2", "--count", "300000", "--rng", "pcg4d3x"}), whole);
}

TEST(Errors, draws_svg_and_png) {
    const Scratch scratch;
    counted({"--n", "1,4,16", "--count", "1e5", "--plot", scratch / "e.svg"});
    EXPECT_TRUE(is_svg(bytes_of(scratch / "e.svg")));
    counted({"--count", "1e5", "--estimator", "mc", "--plot", scratch / "e.png"});
    EXPECT_TRUE(is_png(bytes_of(scratch / "e.png")));
    EXPECT_FALSE(is_png(bytes_of(scratch / "e.svg")));
    EXPECT_EQ(scratch.files(), 2u) << "nothing else is left";
}

TEST(Errors, no_shell_and_no_script_sees_a_file_name) {
    const Scratch scratch;
    const std::string name = "a';system \"touch hit\";'`touch hit`$(touch hit)\n.svg";
    counted({"--count", "1e5", "--plot", scratch / name});
    EXPECT_TRUE(is_svg(bytes_of(scratch / name)));
    EXPECT_EQ(scratch.files(), 1u);
    EXPECT_FALSE(std::filesystem::exists("hit"));
}

TEST(Errors, without_gnuplot_the_package_is_named_before_the_work) {
    const Scratch scratch;
    Surroundings empty;
    empty.environment = {{"PATH", scratch / ""}};
    expect_refused(model + Words{"--count", "1e15", "--plot", scratch / "e.svg"}, 1, "gnuplot-nox", empty);
    expect_refused({"figures", "-o", scratch / "f", "--count", "1e15"}, 1, "gnuplot-nox", empty);
}

TEST(Errors, a_gnuplot_that_fails_leaves_no_file) {
    const Scratch scratch, bin;
    put_bytes(bin / "gnuplot", "#!/bin/sh\n[ \"$2\" = --version ] && exit 0\necho 'no such terminal' >&2\nexit 1\n");
    std::filesystem::permissions(bin / "gnuplot", std::filesystem::perms::owner_all);
    Surroundings broken;
    broken.environment = {{"PATH", bin / ""}};
    expect_refused(model + Words{"--count", "1e5", "--plot", scratch / "e.svg"}, 1, "gnuplot: no such terminal", broken);
    EXPECT_EQ(scratch.files(), 0u);
}

TEST(Errors, bad_arguments_are_usage_errors) {
    const Scratch scratch;
    const std::map<std::string, Words> bad{
        {"range: expected at least one sample", {"--count", "0"}},
        {"--count: expected a whole number", {"--count", "1.5"}},
        {"--count: expected a whole number", {"--count", "many"}},
        {"--n: expected a whole number", {"--count", "1", "--n", "1,x"}},
        {"error model: n", {"--count", "1", "--n", "0"}},
        {"error model: rho", {"--count", "1", "--rho", "2"}},
        {"bins: expected lo < hi", {"--count", "1", "--range", "1", "1"}},
        {"bins: expected 1 to 2^23", {"--count", "1", "--bins", "0"}},
        {"range", {"--count", "1e18", "--first", "5e17"}},
        {"seed", {"--count", "1", "--rng", "pcg4d3x", "--seed", "5e9"}},
        {"--stream: ids", {"--count", "1", "--stream", "4294967295", "--n", "1,2"}},
        {"--rng", {"--count", "1", "--rng", "dice"}},
        {"ends in .svg or .png", {"--count", "1", "--plot", "e.pdf"}},
        {"named for two outputs", {"--count", "1", "--plot", scratch / "e.svg", "--csv", scratch / "e.svg"}},
        {"--count is required", {}}};
    for (const auto& [part, words] : bad) expect_refused(model + words, 2, part);
    expect_refused({"figures", "-o", scratch / "f", "--count", "0"}, 2, "range");
    expect_refused(model + Words{"--count", "1", "--csv", scratch / "no/e.csv"}, 1, "no folder");
    expect_refused(model + Words{"--count", "1", "--plot", scratch / "no/e.svg"}, 1, "no folder");
}

TEST(Errors, a_full_disk_is_said_and_leaves_no_file) {
    const Scratch scratch;
    Surroundings small;
    small.file_size_limit = 4096;
    counted({"--count", "1e5"});  // a program that is not built yet needs files of its own
    expect_refused(model + Words{"--count", "1e5", "--csv", scratch / "h.csv"}, 1, "h.csv: cannot be written", small);
    EXPECT_EQ(scratch.files(), 0u);
}

// On a terminal, with a Ctrl-C once the bar is there.
TEST(Errors, shows_a_bar_and_ends_on_ctrl_c) {
    const Scratch scratch;
    int terminal = -1;
    const pid_t child = forkpty(&terminal, nullptr, nullptr, nullptr);
    if (child == 0) {
        Words words = Words{CLRATIO_TOOL} + model + Words{"--count", "1e15", "--csv", scratch / "h.csv"};
        std::vector<char*> argv;
        for (auto& w : words) argv.push_back(w.data());
        argv.push_back(nullptr);
        execv(CLRATIO_TOOL, argv.data());
        _exit(127);
    }
    std::string said;
    char block[4096];
    bool stopped = false;
    for (ssize_t n; (n = read(terminal, block, sizeof block)) > 0;) {
        said.append(block, static_cast<std::size_t>(n));
        if (!stopped && said.find(" of 1e+15 samples") != std::string::npos) {
            EXPECT_EQ(write(terminal, "\x03", 1), 1);
            stopped = true;
        }
    }
    int status = 0;
    waitpid(child, &status, 0);
    close(terminal);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 130) << said;
    EXPECT_NE(said.find("clratio: cancelled"), std::string::npos) << said;
    EXPECT_EQ(scratch.files(), 0u);
}

TEST(Figures, files_and_numbers) {
    const Scratch scratch;
    const Said said = clratio_tool({"figures", "-o", scratch / "new/folder", "--count", "1e5"});
    ASSERT_EQ(said.code, 0) << said.err;
    EXPECT_EQ(said.err, "");
    for (const char* figure : {"figure1", "figure2"}) {
        const std::string stem = scratch / ("new/folder/" + std::string(figure));
        EXPECT_TRUE(is_svg(bytes_of(stem + ".svg")));
        EXPECT_TRUE(is_png(bytes_of(stem + ".png")));
        EXPECT_NE(bytes_of(stem + ".svg").find("published eq. (22)"), std::string::npos);
    }
    const Csv samples(scratch / "new/folder/figure2.csv");
    EXPECT_EQ(samples.rows.size(), 14 * 303u);
    const auto counts = samples.counts();
    EXPECT_EQ(std::accumulate(counts.begin(), counts.end(), std::uint64_t{0}), 1'400'000u);

    // The peaks of theory, to three decimals; between two of 901 points a peak loses peak * N (step / 2)^2 / (2 * .28).
    const auto rows = split(bytes_of(scratch / "new/folder/figure1.csv"), '\n');
    EXPECT_EQ(rows.front(), "estimator,n,error,exact,published");
    std::map<std::string, double> peak, difference;
    for (std::size_t i = 1; i < rows.size(); ++i) {
        const auto row = split(rows[i], ',');
        auto& top = peak[row[0] + row[1]];
        auto& off = difference[row[0] + row[1]];
        top = std::max(top, std::stod(row[3]));
        off = std::max(off, std::abs(std::stod(row[3]) - std::stod(row[4])));
    }
    for (const auto& [n, want] : std::map<int, double>{{1, .768}, {4, 1.515}, {16, 3.017}, {64, 6.027}}) {
        const std::string mc = "mc" + std::to_string(n), ratio = "ratio" + std::to_string(n);
        EXPECT_NEAR(peak[ratio], want, 5e-4 + want * n * std::pow(1. / 600, 2) / .56) << n;
        EXPECT_NEAR(peak[mc], std::sqrt(2 * n / std::numbers::pi), 1e-12) << n;
        EXPECT_EQ(difference[mc], 0) << n;
        EXPECT_GT(difference[ratio], .01) << n;
    }
}

// 10^10 samples in the memory of 10^6: the peak of the children's resident sets does not move.
TEST(Errors, SlowMemoryDoesNotGrow) {
    const auto peak_kb = [](const std::string& count, std::uint64_t total) {
        EXPECT_EQ(counted({"--count", count, "--rng", "pcg4d3x"})["results"][0]["counts"]["total"], total);
        rusage used{};
        getrusage(RUSAGE_CHILDREN, &used);
        return used.ru_maxrss;
    };
    const long few = peak_kb("1e6", 1'000'000), many = peak_kb("1e10", 10'000'000'000);
    std::cout << "peak resident set: " << few << " kB with 10^6 samples, " << many << " kB with 10^10\n";
    EXPECT_LT(many, few + 4096);
}
