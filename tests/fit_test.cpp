// Goodness of fit: known p-values, draws that must pass, and planted faults that must not.
#include "clratio/fit.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "clratio/exception.hpp"
#include "clratio/law.hpp"

using namespace clratio;
using Counts = std::vector<std::uint64_t>;
using Reals = std::vector<double>;

namespace {

// Draws of eq. (14) in canonical form, by Box and Muller's transform of a generator that is not ours.
Reals draws(const ErrorModel& model, std::size_t n, std::uint64_t seed) {
    const auto [s, a, b] = canonical(model);
    std::mt19937_64 words(seed);
    const auto uniform = [&] { return (static_cast<double>(words() >> 11) + .5) * 0x1p-53; };
    Reals x(n);
    for (double& v : x) {
        const double r = std::sqrt(-2 * std::log(uniform())), angle = 2 * std::numbers::pi * uniform();
        const double z1 = r * std::cos(angle), z2 = r * std::sin(angle);
        v = (a * z2 + b * z1) / (1 + s * z2);
    }
    return x;
}

constexpr int bins = 256;
constexpr double low = -2, high = 4;

Counts count(const Reals& x) {
    Counts c(bins + 2);
    for (double v : x)
        ++c[v < low ? 0 : v >= high ? bins + 1 : 1 + static_cast<std::size_t>((v - low) / (high - low) * bins)];
    return c;
}

Reals probabilities(Law law, const ErrorModel& model) { return ErrorLaw(law, model).bin_probabilities(low, high, bins); }

Fit anderson_darling(const ErrorLaw& law, const Reals& x) {
    Reals below, above;
    for (double v : x) {
        below.push_back(law.cdf(v));
        above.push_back(law.sf(v));
    }
    return clratio::anderson_darling(below, above);
}

constexpr std::size_t n = 1'000'000;
const ErrorModel paper{.5, 1, .5, .35};
const ErrorModel models[] = {paper, {.5, 1, .5, .1}, {1, 0, .3, .2}, {1, 2, .5, .5, .7}, {.5, 1, .5, .35, 0, 16}};

double near(double want) { return 1e-12 * want; }

}  // namespace

TEST(ChiSquare, known_values) {
    // A die thrown 60 times; the p-value of chi-square 13.4 with 5 degrees of freedom.
    const Fit die = chi_square(Counts{5, 8, 9, 8, 10, 20}, Reals(6, 1. / 6), 5);
    EXPECT_NEAR(die.statistic, 13.4, 1e-12);
    EXPECT_EQ(die.dof, 5u);
    EXPECT_NEAR(die.p, 0.0199052, 1e-7);
    EXPECT_NEAR(die.p + die.q, 1, 1e-15);
    // From 40-digit arithmetic.
    const Fit ten = chi_square(Counts{5, 15, 10, 10, 5, 15}, Reals(6, 1. / 6), 5);
    EXPECT_NEAR(ten.statistic, 10, 1e-12);
    EXPECT_NEAR(ten.p, 0.075235246146512179, near(.0753));
}

TEST(ChiSquare, pools_neighbours_until_each_expects_enough) {
    const Fit fit = chi_square(Counts{4, 26, 40, 18, 12}, Reals{.05, .2, .5, .15, .1}, 25);
    EXPECT_EQ(fit.cells, 3u);  // {5 + 20}, {50}, {15 + 10}
    EXPECT_NEAR(fit.statistic, 25. / 25 + 100. / 50 + 25. / 25, 1e-12);
    const Fit rest = chi_square(Counts{40, 50, 10}, Reals{.4, .5, .1}, 25);
    EXPECT_EQ(rest.cells, 2u);  // what is left over joins the last
    EXPECT_NEAR(rest.statistic, 0, 1e-12);
}

TEST(ChiSquare, counts_are_64_bit) {
    const std::uint64_t big = 1ull << 60;
    const Fit fit = chi_square(Counts{big, big, 0}, Reals{.5, .5, 0});
    EXPECT_EQ(fit.n, 2 * big);
    EXPECT_EQ(fit.statistic, 0);
}

TEST(KolmogorovSmirnov, known_values) {
    // K's upper tail from 40-digit arithmetic.
    for (const auto& [x, p] : {std::pair{.3, .99999069419866543},
                               {.5, .96394524366487509},
                               {1., .26999967167735452},
                               {1.5, .022217962616525129},
                               {3., 3.0459959489425257e-8}}) {
        const double total = 1e14, d = x / (std::sqrt(total) + .12 + .11 / std::sqrt(total));
        const auto first = static_cast<std::uint64_t>(std::llround(total * (.5 + d)));
        const Fit fit = kolmogorov_smirnov(Counts{first, 100'000'000'000'000 - first}, Reals{.5, .5});
        EXPECT_NEAR(fit.statistic, d, 1e-14) << x;
        EXPECT_NEAR(fit.p, p, 4e-5 * x * x * p) << x;
        EXPECT_NEAR(fit.p + fit.q, 1, 1e-15) << x;
    }
}

TEST(AndersonDarling, known_values) {
    // One value u has A^2 = -1 - log(u (1 - u)); the limiting law's upper tail from 40-digit arithmetic.
    for (const auto& [z, p] : {std::pair{.5, .74681437353034448},
                               {1., .35726667321401909},
                               {1.933, .099994623208223505},
                               {2.492, .050022186359607866},
                               {3.857, .010241153229861212},
                               {8., .00011381415572658301},
                               {14., 2.1463291757045062e-7}}) {
        const double product = std::exp(-1 - z), root = std::sqrt(1 - 4 * product);
        const Fit fit = clratio::anderson_darling(Reals{2 * product / (1 + root)}, Reals{(1 + root) / 2});
        EXPECT_NEAR(fit.statistic, z, 1e-13) << z;
        EXPECT_NEAR(fit.p, p, 1e-13) << z;
        EXPECT_NEAR(fit.q, 1 - p, 1e-13) << z;
    }
}

TEST(AndersonDarling, large_statistics_have_no_probability) {
    double last = 1;
    for (double u = .01; u > 1e-300; u *= u) {
        const Fit fit = clratio::anderson_darling(Reals(100, u), Reals(100, 1 - u));
        EXPECT_LE(fit.p, std::min(last, 2e-13)) << fit.statistic;
        EXPECT_EQ(fit.p + fit.q, 1) << fit.statistic;
        last = std::max(fit.p, 0.);
    }
}

TEST(AndersonDarling, an_impossible_value_rejects) {
    const Fit fit = clratio::anderson_darling(Reals{0, .5}, Reals{1, .5});
    EXPECT_EQ(fit.p, 0);
    EXPECT_FALSE(fit.accepted());
}

TEST(Fit, exact_law_is_accepted) {
    for (const auto& model : models)
        for (const std::uint64_t seed : {1, 2, 3}) {
            const Reals x = draws(model, n, seed);
            const Fit chi = chi_square(count(x), probabilities(Law::exact, model));
            const Fit ks = kolmogorov_smirnov(count(x), probabilities(Law::exact, model));
            const Fit ad = anderson_darling(ErrorLaw(Law::exact, model), Reals(x.begin(), x.begin() + 100'000));
            EXPECT_TRUE(chi.accepted()) << chi.statistic << " dof " << chi.dof << " p " << chi.p;
            EXPECT_GT(ks.p, 1e-6) << ks.statistic;
            EXPECT_TRUE(ad.accepted()) << ad.statistic << " p " << ad.p;
        }
}

// Theory, section 6: at s = .35 and n = 10^6, p < 1e-12.
TEST(Fit, published_law_is_rejected) {
    for (const std::uint64_t seed : {1, 2, 3}) {
        const Counts counts = count(draws(paper, n, seed));
        EXPECT_LT(chi_square(counts, probabilities(Law::published, paper)).p, 1e-12);
        EXPECT_LT(kolmogorov_smirnov(counts, probabilities(Law::published, paper)).p, 1e-12);
        EXPECT_LT(chi_square(counts, probabilities(Law::mc, paper)).p, 1e-12);
    }
}

// Non-centrality n (shift / scale)^2 = 400, where sqrt(2 dof) = 22.
TEST(Fit, planted_shift_is_rejected) {
    Reals x = draws(paper, n, 1);
    for (double& v : x) v += .02 * ErrorLaw(Law::exact, paper).scale();
    EXPECT_LT(chi_square(count(x), probabilities(Law::exact, paper)).p, 1e-6);
    EXPECT_LT(kolmogorov_smirnov(count(x), probabilities(Law::exact, paper)).p, 1e-6);
    EXPECT_LT(anderson_darling(ErrorLaw(Law::exact, paper), x).p, 1e-6);
}

TEST(Fit, planted_lost_bin_is_rejected) {
    Counts counts = count(draws(paper, n, 1));
    counts[90] = 0;
    EXPECT_LT(chi_square(counts, probabilities(Law::exact, paper)).p, 1e-6);
}

TEST(Fit, planted_lost_tail_is_rejected) {
    Counts counts = count(draws(paper, n, 1));
    counts[bins] += counts[bins + 1];  // clamped into the last bin
    counts[bins + 1] = 0;
    EXPECT_LT(chi_square(counts, probabilities(Law::exact, paper)).p, 1e-6);
}

// Draws without replacement: each count falls short of its binomial deviation by a quarter.
TEST(Fit, planted_under_dispersion_is_rejected_from_the_other_side) {
    const Reals p = probabilities(Law::exact, paper);
    Counts counts = count(draws(paper, n, 1));
    for (std::size_t i = 0; i < counts.size(); ++i) {
        const double expected = p[i] * static_cast<double>(n), excess = static_cast<double>(counts[i]) - expected;
        counts[i] = static_cast<std::uint64_t>(std::llround(expected + .75 * excess));
    }
    const Fit fit = chi_square(counts, p);
    EXPECT_LT(fit.q, 1e-6);
    EXPECT_GT(fit.p, 1e-6);
    EXPECT_FALSE(fit.accepted());
}

TEST(Fit, bad_input_is_refused) {
    EXPECT_THROW(chi_square(Counts{1, 2}, Reals{1}), InvalidArgument);
    EXPECT_THROW(chi_square(Counts{100, 200}, Reals{.5, .4}), InvalidArgument);
    EXPECT_THROW(chi_square(Counts{100, 200}, Reals{1.5, -.5}), InvalidArgument);
    EXPECT_THROW(chi_square(Counts{100, 200}, Reals{NAN, .5}), InvalidArgument);
    EXPECT_THROW(chi_square(Counts{0, 0}, Reals{.5, .5}), InvalidArgument);
    EXPECT_THROW(chi_square(Counts{10, 10}, Reals{.5, .5}), InvalidArgument);
    for (const double least : {0., -1., double{NAN}})
        EXPECT_THROW(chi_square(Counts{100, 200}, Reals{1, 0}, least), InvalidArgument);
    EXPECT_THROW(chi_square(Counts{1ull << 63, 1ull << 63}, Reals{.5, .5}), InvalidArgument);
    EXPECT_THROW(kolmogorov_smirnov(Counts{}, Reals{}), InvalidArgument);
    EXPECT_THROW(clratio::anderson_darling(Reals{}, Reals{}), InvalidArgument);
    EXPECT_THROW(clratio::anderson_darling(Reals{.5}, Reals{}), InvalidArgument);
    EXPECT_THROW(clratio::anderson_darling(Reals{1.5}, Reals{-.5}), InvalidArgument);
    EXPECT_THROW(clratio::anderson_darling(Reals{1}, Reals{1}), InvalidArgument);
}
