// The samples of this library and the law of this library, against each other: billions of draws, three tests of fit.
#include <gtest/gtest.h>

#include <array>
#include <iostream>

#include "clratio/fit.hpp"
#include "clratio/histogram.hpp"
#include "clratio/law.hpp"

using namespace clratio;

namespace {

struct Case {
    const char* name;
    ErrorModel model;
    double lo, hi;
};

// s = .35, s = .1, and tau = 0 with its impulse (s = .2), in ranges that leave both tails some draws.
const std::array cases{Case{"s_35", {.5, 1, .5, .35}, -2, 4}, Case{"s_10", {.5, 1, .5, .1}, -2, 3},
                       Case{"tau_0", {1, 0, .3, .2}, -1.5, 2}};

constexpr std::uint64_t seeds[] = {1, 2, 3};  // fixed before anyone looked

const Engine& engine() {
    static const Engine shared;
    return shared;
}

Stream stream_of(Generator generator, std::uint64_t seed) { return {.seed = seed, .generator = generator}; }

ErrorHistogram histogram_of(const Case& c, const Stream& stream, std::uint64_t count) {
    return error_histogram(engine(), canonical(c.model), stream, {0, count}, {c.lo, c.hi, 1024});
}

std::string numbers(const Fit& fit) {
    return "statistic " + std::to_string(fit.statistic) + ", dof " + std::to_string(fit.dof) + ", p " +
           std::to_string(fit.p);
}

Fit anderson_darling_of(const ErrorLaw& law, std::span<const float> samples) {
    std::vector<double> below, above;
    for (const float x : samples) {
        const double nearer = x < 0 ? law.cdf(x) : law.sf(x), other = 1 - nearer;
        below.push_back(x < 0 ? nearer : other);
        above.push_back(x < 0 ? other : nearer);
    }
    return anderson_darling(below, above);
}

std::vector<float> samples_of(const Case& c, const Stream& stream, std::size_t count) {
    std::vector<float> x(count);
    error_samples(engine(), canonical(c.model), stream, 0, x);
    return x;
}

struct Subject {
    Case model;
    Generator generator;
};

std::string name_of(const Subject& s) {
    return std::string(s.model.name) + (s.generator == Generator::philox ? "_philox" : "_pcg4d3x");
}

void PrintTo(const Subject& s, std::ostream* out) { *out << name_of(s); }

std::vector<Subject> subjects() {
    std::vector<Subject> all;
    for (const Case& c : cases)
        for (const auto generator : {Generator::philox, Generator::pcg4d3x}) all.push_back({c, generator});
    return all;
}

class FitLaw : public testing::TestWithParam<Subject> {
protected:
    Case model() const { return GetParam().model; }
    Stream stream(std::uint64_t seed) const { return stream_of(GetParam().generator, seed); }
    ErrorLaw law() const { return {Law::exact, model().model}; }
};

class SlowFitLaw : public FitLaw {};

const auto name_of_test = [](const testing::TestParamInfo<Subject>& info) { return name_of(info.param); };
INSTANTIATE_TEST_SUITE_P(Models, FitLaw, testing::ValuesIn(subjects()), name_of_test);
INSTANTIATE_TEST_SUITE_P(Models, SlowFitLaw, testing::ValuesIn(subjects()), name_of_test);

}  // namespace

TEST_P(FitLaw, histograms_are_accepted) {
    for (const std::uint64_t seed : seeds) {
        const auto h = histogram_of(model(), stream(seed), 30'000'000);
        const Fit chi = chi_square(h, law()), ks = kolmogorov_smirnov(h, law());
        EXPECT_TRUE(chi.accepted()) << "seed " << seed << ": " << numbers(chi);
        EXPECT_GT(ks.p, 1e-6) << "seed " << seed << ": " << numbers(ks);
        EXPECT_EQ(h.nonfinite, 0u);
    }
}

TEST_P(FitLaw, tails_are_accepted) {
    for (const std::uint64_t seed : seeds) {
        const Fit fit = anderson_darling_of(law(), samples_of(model(), stream(seed), 1'000'000));
        EXPECT_TRUE(fit.accepted()) << "seed " << seed << ": " << numbers(fit);
    }
}

// At s = .35 a million draws are enough (theory, section 6).
TEST(FitOfLaws, the_published_law_is_rejected) {
    const Case& c = cases[0];
    const ErrorLaw exact(Law::exact, c.model), published(Law::published, c.model);
    for (const auto generator : {Generator::philox, Generator::pcg4d3x})
        for (const std::uint64_t seed : seeds) {
            const auto h = histogram_of(c, stream_of(generator, seed), 1'000'000);
            EXPECT_TRUE(chi_square(h, exact).accepted()) << numbers(chi_square(h, exact));
            EXPECT_LT(chi_square(h, published).p, 1e-12);
            EXPECT_LT(kolmogorov_smirnov(h, published).p, 1e-12);
        }
}

// The Monte Carlo estimator is a normal with s = a = 0: its law is eq. (23), and the ratio's is not.
TEST(FitOfLaws, monte_carlo_follows_its_own_law_only) {
    const ErrorModel model = cases[0].model;
    for (const std::uint64_t seed : seeds) {
        const auto h =
            error_histogram(engine(), monte_carlo_canonical(model), {.seed = seed}, {0, 10'000'000}, {-2, 2, 1024});
        EXPECT_TRUE(chi_square(h, ErrorLaw(Law::mc, model)).accepted());
        EXPECT_LT(chi_square(h, ErrorLaw(Law::exact, model)).p, 1e-12);
    }
}

TEST(FitOfLaws, correlation_and_many_samples_an_estimate) {
    for (const ErrorModel& model : {ErrorModel{1, 2, .5, .5, .7}, {1, 2, .5, .5, -.7, 4}, {.5, 1, .5, .35, 0, 64}}) {
        const ErrorLaw law(Law::exact, model);
        const double reach = 6 * law.scale();
        for (const std::uint64_t seed : seeds) {
            const auto h =
                error_histogram(engine(), canonical(model), {.seed = seed}, {0, 10'000'000}, {-reach, reach, 1024});
            EXPECT_TRUE(chi_square(h, law).accepted()) << numbers(chi_square(h, law));
        }
    }
}

// A deviation wrong by a part e has the non-centrality 2 n e^2 = 540, where sqrt(2 dof) is 45.
TEST(FitOfLaws, planted_faults_are_rejected) {
    const Case& c = cases[0];
    const ErrorLaw exact(Law::exact, c.model);
    const auto h = histogram_of(c, stream_of(Generator::philox, 1), 30'000'000);
    EXPECT_TRUE(chi_square(h, exact).accepted());

    ErrorModel wider = c.model;
    wider.sigma_m *= 1.003;
    wider.sigma_t *= 1.003;
    EXPECT_LT(chi_square(h, ErrorLaw(Law::exact, wider)).p, 1e-6);

    auto lost = h;
    lost.bins[300] = 0;
    EXPECT_LT(chi_square(lost, exact).p, 1e-6);

    auto clamped = h;
    clamped.bins.back() += clamped.overflow;
    clamped.overflow = 0;
    EXPECT_LT(chi_square(clamped, exact).p, 1e-6);

    Histogram repeated = h;  // a stream that starts again after 30 million samples
    for (int k = 0; k < 3; ++k) repeated += Histogram(repeated);
    EXPECT_LT(chi_square(repeated, exact).p, 1e-6);

    auto nan = h;
    nan.nonfinite = 1;
    EXPECT_EQ(chi_square(nan, exact).p, 0);
    EXPECT_EQ(kolmogorov_smirnov(nan, exact).p, 0);
    EXPECT_EQ(chi_square(nan, exact).n, 30'000'001u);
}

TEST(Cells, are_underflow_bins_overflow) {
    Histogram h;
    h.bins = {3, 4, 5};
    h.underflow = 1;
    h.overflow = 2;
    h.nonfinite = 9;
    EXPECT_EQ(cells(h), (std::vector<std::uint64_t>{1, 3, 4, 5, 2}));
}

// The edges of float bins on [-1.5, 1.5) are off by up to 6e-8, which a law 5e-5 wide shows.
TEST(Cells, a_narrow_law_fits_the_edges_that_were_counted) {
    const Engine engine;
    const ErrorModel model{.5, 1, .5, .35, 0, 100'000'000};
    const ErrorLaw law(Law::exact, model);
    const auto h = error_histogram(engine, canonical(model), {.seed = 1}, {0, 100'000'000}, {-1.5, 1.5, 1024});
    EXPECT_TRUE(chi_square(h, law).accepted());
    EXPECT_LT(chi_square(cells(h), law.bin_probabilities(-1.5, 1.5, 1024)).p, 1e-6) << "planted fault: edges of equal width";
    const auto edges = h.edges();
    ASSERT_EQ(edges.size(), 1025u);
    for (std::size_t i = 0; i <= 1024; ++i) {
        EXPECT_NEAR(edges[i], -1.5 + 3. * static_cast<double>(i) / 1024, 3 * 0x1p-22) << i;
        const auto least = static_cast<float>(edges[i]);
        const std::vector<float> around{std::nextafter(least, -10.f), least};
        const auto counted = cells(histogram(engine, around, {-1.5, 1.5, 1024}));
        EXPECT_EQ(counted[i] + 2 * counted[i + 1], 3u) << i;
    }
}

TEST(Cells, go_with_the_laws_probabilities) {
    const Case& c = cases[0];
    const ErrorLaw law(Law::exact, c.model);
    const auto h = histogram_of(c, {.seed = 1}, 100'000);
    EXPECT_EQ(chi_square(h, law).statistic, chi_square(cells(h), law.bin_probabilities(h.edges())).statistic);
    EXPECT_EQ(kolmogorov_smirnov(h, law).p, kolmogorov_smirnov(cells(h), law.bin_probabilities(h.edges())).p);
    EXPECT_GT(chi_square(h, law, 1000).cells, 2u);
    EXPECT_LT(chi_square(h, law, 1000).cells, chi_square(h, law).cells);
}

TEST_P(SlowFitLaw, a_billion_samples_are_accepted_by_the_exact_law_alone) {
    const ErrorLaw published(Law::published, model().model);
    for (const std::uint64_t seed : seeds) {
        const auto h = histogram_of(model(), stream(seed), 1'000'000'000);
        const Fit chi = chi_square(h, law()), ks = kolmogorov_smirnov(h, law());
        std::cout << "seed " << seed << ": " << numbers(chi) << ", Kolmogorov-Smirnov p " << ks.p
                  << ", published law: " << numbers(chi_square(h, published)) << "\n";
        EXPECT_TRUE(chi.accepted()) << "seed " << seed << ": " << numbers(chi);
        EXPECT_GT(ks.p, 1e-6) << "seed " << seed << ": " << numbers(ks);
        EXPECT_LT(chi_square(h, published).p, 1e-12);
        EXPECT_EQ(h.total(), 1'000'000'000u);
    }
}
