// The law on the host, against 40-digit numbers, integrals and its own other forms.
#include "clratio/law.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

#include "law_integral.hpp"
#include "quadrature.hpp"
#include "support/theory.hpp"

using namespace clratio;
using clratio::test::model_of;
using clratio::test::text;
using clratio::test::theory;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Theory, section 7: 1e-12 relative, 5e-12 where |log density| > 100.
double density_tolerance(double log_pdf) { return std::abs(log_pdf) > 100 ? 5e-12 : 1e-12; }

double relative(double got, double want) { return want == 0 ? std::abs(got) : std::abs(got / want - 1); }

// Models of every kind: tau = 0, tau < 0, mu <= 0, small and large s, correlation up to near 1.
const std::vector<ErrorModel> models = {
    {1, 2, .5, .5},    {.5, 1, .5, .35},         {.5, 1, .5, .1},       {-1, 2, .5, .5, .5},   {.5, -1, .2, .3, .4},
    {1, 0, .3, .2},    {0, 0, .3, .5, .3},       {0, 1, .5, .3},        {3, 1, .1, .3, .99},   {1, 2, .5, 1e-3},
    {1, 2, .5, 2, .6}, {1e4, 3e4, 2e3, 5e3, .9}, {1, 2, .5, .5, 0, 64}, {.3, .7, 1e-3, .2, .5}};

}  // namespace

TEST(Error, canonical_form_is_the_vectors) {
    for (const auto& v : theory("density")) {
        const Canonical c = canonical(model_of(v));
        EXPECT_LE(relative(c.s, v["s"]), 1e-15) << v;
        EXPECT_LE(relative(c.a, v["a"]), 1e-15) << v;
        EXPECT_LE(relative(c.b, v["b"]), 1e-15) << v;
    }
}

TEST(Error, n_divides_every_deviation_by_its_root) {
    const Canonical one = canonical({1, 2, .5, .5, .3}), many = canonical({1, 2, .5, .5, .3, 16});
    EXPECT_DOUBLE_EQ(many.s, one.s / 4);
    EXPECT_DOUBLE_EQ(many.a, one.a / 4);
    EXPECT_DOUBLE_EQ(many.b, one.b / 4);
}

TEST(Error, m_proportional_to_t_has_no_residual) {
    const Canonical c = canonical({.25, 2, .125, 1, 1});
    EXPECT_EQ(c.a, 0);
    EXPECT_EQ(c.b, 0);
}

// Values from 60-digit arithmetic; the first three lose all digits of a where a product is rounded, vanishes or overflows.
TEST(Error, a_keeps_its_digits_where_its_terms_cancel_and_where_products_leave_the_range) {
    struct Case {
        ErrorModel model;
        double a;
    };
    const Case cases[] = {
        {{.7, 1, .14, .18, .9}, 2.7755575615628914e-17},
        {{-2.4551665823715934, -1, .08476586427009128, .03452550424839018, .999999999981079}, 1.6886237984080623e-12},
        {{1e-158, 1e-158, 0, 1e-158}, -1e-158},
        {{1e-170, 1e-170, 0, 1e-170}, -1e-170},
        {{1e200, 1e200, 0, 1e200}, -1e200},
        {{1, 1e200, 1e150, 1e150, .5}, 5e149},
        {{0, 1e-300, 1e300, 0, 1}, 1e300},
        {{1e-300, 1e-300, 0, 5e-324}, -5e-324}};
    for (const auto& [model, a] : cases) EXPECT_LE(relative(canonical(model).a, a), 1e-15) << text(model);
    EXPECT_EQ(canonical({0, 0, 0, 0}).a, 0);
    EXPECT_EQ(canonical({0, 1e300, 0, 0}).a, 0);
}

TEST(Error, bad_parameters_are_refused_by_name) {
    const auto refused = [](const ErrorModel& e) -> std::string {
        try {
            canonical(e);
        } catch (const InvalidArgument& a) {
            return a.name;
        }
        return "";
    };
    EXPECT_EQ(refused({1, 2, -.5, .5}), "error model: sigma_m");
    EXPECT_EQ(refused({1, 2, NAN, .5}), "error model: sigma_m");
    EXPECT_EQ(refused({1, 2, .5, -1}), "error model: sigma_t");
    EXPECT_EQ(refused({1, 2, .5, INFINITY}), "error model: sigma_t");
    EXPECT_EQ(refused({1, 2, .5, .5, 1.01}), "error model: rho");
    EXPECT_EQ(refused({1, 2, .5, .5, NAN}), "error model: rho");
    EXPECT_EQ(refused({NAN, 2, .5, .5}), "error model: mu");
    EXPECT_EQ(refused({1, INFINITY, .5, .5}), "error model: tau");
    EXPECT_EQ(refused({1, 2, .5, .5, 0, 0}), "error model: n");
    EXPECT_EQ(refused({1, 1e-300, .5, 1e100}), "error model: sigma_t / |tau|");
}

TEST(Law, owens_t_is_the_vectors) {
    for (const auto& v : theory("owens_t")) {
        const double h = v["h"], a = v["a"], want = v["T"];
        const double got = std::copysign(device::clr_owens_t_twice(h, h * std::abs(a), std::abs(a), 1.0) / 2, a);
        EXPECT_LE(std::abs(got - want), 1e-16) << v;
        if (want < 1e-40) continue;  // the file's own quadrature ends there
        EXPECT_LE(relative(got, want), 1e-12) << v;
    }
    const auto t = [](double h, double a) { return device::clr_owens_t_twice(h, h * a, a, 1.0) / 2; };
    EXPECT_LE(relative(t(15, .1), 1.5933474067772863391e-51), 1e-12);  // 90 digits
    EXPECT_LE(relative(t(15, .5), 1.8354830996562819701e-51), 1e-12);
}

TEST(Law, exact_density_is_the_vectors) {
    for (const auto& v : theory("density")) {
        const ErrorLaw law(Law::exact, model_of(v));
        const double x = v["x"], log_pdf = v["logpdf"];
        EXPECT_LE(relative(law.pdf(x), v["pdf"]), density_tolerance(log_pdf)) << v;
        EXPECT_LE(std::abs(law.log_pdf(x) - log_pdf), density_tolerance(log_pdf)) << v;
    }
}

TEST(Law, exact_probability_is_the_vectors) {
    for (const auto& v : theory("density")) {
        const ErrorLaw law(Law::exact, model_of(v));
        const double x = v["x"], below = v["cdf"], above = v["sf"];
        EXPECT_LE(std::abs(law.cdf(x) - below), 1e-14) << v;
        EXPECT_LE(std::abs(law.sf(x) - above), 1e-14) << v;
        EXPECT_LE(relative(std::min(law.cdf(x), law.sf(x)), std::min(below, above)), 1e-12) << v;
    }
}

TEST(Law, published_density_is_the_vectors) {
    for (const auto& v : theory("density")) {
        const double want = v["eq22"];
        EXPECT_LE(relative(ErrorLaw(Law::published, model_of(v)).pdf(v["x"]), want), density_tolerance(std::log(want))) << v;
    }
}

TEST(Law, the_published_law_is_not_the_exact_one) {
    int caught = 0;
    for (const auto& v : theory("density"))
        caught += relative(ErrorLaw(Law::published, model_of(v)).pdf(v["x"]), v["pdf"]) > density_tolerance(v["logpdf"]);
    EXPECT_GE(caught, static_cast<int>(theory("density").size()) - 1);  // they agree at sigma_t = 0
}

TEST(Law, quantile_is_the_vectors_and_inverts_the_cdf) {
    for (const auto& v : theory("quantile_exact_law")) {
        const ErrorLaw law(Law::exact, model_of(v));
        const double p = v["prob"], x = v["x"];
        const double tolerance = 1e-15 * std::abs(x) + 1e-15 * std::max(p, 1e-2) / law.pdf(x);
        EXPECT_LE(std::abs(law.quantile(p) - x), tolerance) << v;
    }
    for (const auto& model : models)
        for (const auto kind : {Law::exact, Law::mc})
            for (const double p : {1e-300, 1e-30, 1e-9, .01, .3, .5, .7, .99, 1 - 1e-12}) {
                const ErrorLaw law(kind, model);
                const double x = law.quantile(p);
                EXPECT_LE(relative(x < 0 ? law.cdf(x) : law.sf(x), x < 0 ? p : 1 - p), 1e-10) << text(model) << p;
            }
}

TEST(Law, quantile_at_the_ends) {
    const ErrorLaw law(Law::exact, {1, 2, .5, .5});
    EXPECT_EQ(law.quantile(0), -infinity);
    EXPECT_EQ(law.quantile(1), infinity);
    EXPECT_THROW(law.quantile(-.1), InvalidArgument);
    EXPECT_THROW(law.quantile(NAN), InvalidArgument);
    EXPECT_EQ(ErrorLaw(Law::mc, {1, 2, .5, .5}).median(), 0);
}

TEST(Law, bias_is_the_principal_value_of_the_vectors) {
    for (const auto& v : theory("pv_mean"))
        EXPECT_LE(relative(ErrorLaw(Law::exact, model_of(v)).bias(), v["pv_mean"]), 1e-12) << v;
    for (const double s : {.1199999, .1200001}) {  // both branches of Dawson's function
        const double got = ErrorLaw(Law::exact, {1, 1, .5, s}).bias(), s2 = s * s;
        EXPECT_LE(std::abs(got / (s2 * (1 + s2 * (3 + s2 * (15 + s2 * 105)))) - 1), 2 * 945 * s2 * s2 * s2 * s2) << s;
    }
}

TEST(Law, mc_is_the_normal_law) {
    const ErrorLaw law(Law::mc, {1, 2, .5, .7, .3, 4});
    for (const double x : {-2., -.3, 0., .1, 1.})
        EXPECT_LE(relative(law.pdf(x), std::exp(-8 * x * x) * 4 / std::sqrt(2 * std::numbers::pi)), 1e-14) << x;
    EXPECT_LE(relative(law.cdf(-2), std::erfc(8 / std::numbers::sqrt2) / 2), 1e-13);
    EXPECT_EQ(law.modes(), std::vector<double>{0});
    EXPECT_EQ(law.bias(), 0);
    EXPECT_EQ(law.tail_constant(), 0);
}

TEST(Law, tail_constant_is_the_limit_of_density_and_probability) {
    for (const auto& model : models) {
        const ErrorLaw law(Law::exact, model);
        if (canonical(model).s < .05) continue;  // exp(-1 / (2 s^2)) underflows
        const double c = law.tail_constant();
        for (const double sign : {-1., 1.}) {
            const double x = sign * 1e12 * law.scale() / canonical(model).s;
            EXPECT_LE(relative(law.pdf(x) * x * x, c), 1e-9) << text(model);
            EXPECT_LE(relative((x < 0 ? law.cdf(x) : law.sf(x)) * std::abs(x), c), 1e-9) << text(model);
        }
    }
}

TEST(Law, density_integrates_to_the_probability) {
    for (const auto& model : models) {
        const ErrorLaw law(Law::exact, model);
        for (const double from : {-30., -3., -1., 0., .5, 2., 20.}) {
            const double a = from * law.scale(), b = (from + .25) * law.scale();
            const double mass = integrate([&](double x) { return law.pdf(x); }, a, b);
            EXPECT_LE(std::abs(law.cdf(b) - law.cdf(a) - mass), 1e-14) << text(model) << from;
            EXPECT_LE(std::abs(law.sf(a) - law.sf(b) - mass), 1e-14) << text(model) << from;
        }
    }
}

TEST(Law, far_tail_joins_owens_form) {
    for (const auto& model : models) {
        const ErrorLaw law(Law::exact, model);
        const double s = canonical(model).s;
        const double join = law.scale() * std::max(16., .1 / (s * s)) / s;
        if (s < .05) continue;
        for (const double sign : {-1., 1.}) {
            const double near = sign * join * (1 - 1e-9), far = sign * join * (1 + 1e-9);
            const auto tail = [&](double x) { return x < 0 ? law.cdf(x) : law.sf(x); };
            EXPECT_LE(relative(tail(near), tail(far)), 4e-9) << text(model);
        }
    }
}

// Where s > 16 no x is too near 0 for the far tail's test of its distance: it was taken there for x within sd, too.
TEST(Law, probabilities_of_a_wide_denominator_are_the_densitys_integral) {
    for (const double sigma_t : {15., 17., 40., 1000., 1e4}) {
        const ErrorLaw law(Law::exact, {.5, 1, .5, sigma_t});
        for (const double k : {-1e3, -2., -1., -.5, -1e-2, -1e-5, 0., 1e-5, 1e-2, .5, 1., 2., 1e3}) {
            const double a = k * law.scale(), b = a + .25 * std::max(std::abs(a), 1e-3 * law.scale());
            std::vector<double> breaks;
            for (int i = 0; i <= 64; ++i) breaks.push_back(a + (b - a) * i / 64);
            const double mass = integrate([&](double x) { return law.pdf(x); }, breaks);
            EXPECT_LE(std::abs(law.cdf(b) - law.cdf(a) - mass), 2e-14) << sigma_t << " " << k;
            EXPECT_LE(std::abs(law.cdf(a) + law.sf(a) - 1), 1e-15) << sigma_t << " " << k;
            EXPECT_GE(law.cdf(a), 0) << sigma_t << " " << k;
        }
        const double x = law.quantile(.3);  // within a few ulp
        EXPECT_LE(std::abs(law.cdf(x) - .3), 1e-14 + 4 * 0x1p-52 * std::abs(x) * law.pdf(x)) << sigma_t;
    }
}

TEST(Law, modes_are_where_the_density_is_highest) {
    for (const auto& model : models) {
        const ErrorLaw law(Law::exact, model);
        const auto modes = law.modes();
        ASSERT_FALSE(modes.empty()) << text(model);
        for (double k = -20; k <= 20; k += 1e-3)
            ASSERT_LE(law.log_pdf(k * law.scale()), law.log_pdf(modes[0]) + 1e-12) << text(model) << k;
    }
    const ErrorLaw paper(Law::exact, {.5, 1, .5, .35});
    EXPECT_NEAR(paper.modes()[0], -.089, 5e-4);  // theory, section 6
    EXPECT_NEAR(paper.pdf(paper.modes()[0]), .768, 5e-4);
    EXPECT_NEAR(paper.median(), -.002, 5e-4);
    EXPECT_NEAR(paper.bias(), .10, 5e-3);
    EXPECT_EQ(paper.modes().size(), 1u);
    EXPECT_NEAR(ErrorLaw(Law::exact, {0, 1, .5, .3}).modes()[0], 0, 1e-7);
    for (const double unit : {1e-12, 1e-6, 1e9}) {
        const ErrorLaw other(Law::exact, {.5 * unit, 1, .5 * unit, .35});
        EXPECT_LE(relative(other.modes()[0], paper.modes()[0] * unit), 1e-7) << unit;
    }
    const ErrorLaw many(Law::exact, {.5, 1, .5, .35, 0, 1'000'000'000'000'000'000});
    EXPECT_LE(std::abs(many.modes()[0]), 1e-7 * many.scale());
    const ErrorLaw bimodal(Law::exact, {3, 1, .5, .35});
    ASSERT_EQ(bimodal.modes().size(), 2u);
    const double second = bimodal.modes()[1];
    EXPECT_GT(bimodal.pdf(second), bimodal.pdf(second * 1.01));
    EXPECT_GT(bimodal.pdf(second), bimodal.pdf(second * .99));
}

TEST(LawIntegral, eq_17_is_eq_22) {
    for (const auto& model : models) {
        const ErrorLaw closed(Law::published, model), numerical(Law::integral, model);
        for (const double k : {-50., -3., -1., 0., .25, 2., 30.}) {
            const double x = k * closed.scale();
            EXPECT_LE(relative(numerical.pdf(x), closed.pdf(x)), 1e-11) << text(model) << k;
        }
    }
}

TEST(LawIntegral, eq_16_with_the_jacobian_is_the_exact_law) {
    for (const auto& model : models) {
        const ErrorLaw closed(Law::exact, model), numerical(Law::exact_integral, model);
        for (const double k : {-50., -3., -1., 0., .25, 2., 30.}) {
            const double x = k * closed.scale();
            EXPECT_LE(relative(numerical.pdf(x), closed.pdf(x)), 1e-11) << text(model) << k;
            EXPECT_LE(std::abs(numerical.cdf(x) - closed.cdf(x)), 1e-13) << text(model) << k;
        }
    }
}

TEST(LawIntegral, a_dropped_jacobian_is_caught) {
    for (ErrorModel model : models) {
        model.rho = 0;
        const ErrorLaw exact(Law::exact, model);
        double worst = 0;
        for (const double k : {-3., -1., 1., 3.})
            worst = std::max(worst, relative(published_integral(model, k * exact.scale()), exact.pdf(k * exact.scale())));
        EXPECT_GT(worst, 1e-11) << text(model);
    }
}

TEST(LawIntegral, refuses_what_it_cannot_integrate) {
    EXPECT_THROW(ErrorLaw(Law::exact_integral, {1, 2, .5, .5, 1}), InvalidArgument);
    EXPECT_THROW(ErrorLaw(Law::integral, {1, 2, 0, .5}), InvalidArgument);
    EXPECT_DOUBLE_EQ(ErrorLaw(Law::integral, {1, 2, .5, 0}).pdf(.75), ErrorLaw(Law::mc, {1, 2, .5, 0}).pdf(.75));
}

TEST(LawEdge, infinities_and_nan) {
    for (const auto kind : {Law::exact, Law::published, Law::mc, Law::exact_integral}) {
        const ErrorLaw law(kind, {1, 2, .5, .5});
        EXPECT_TRUE(std::isnan(law.pdf(NAN)));
        EXPECT_TRUE(std::isnan(law.log_pdf(NAN)));
        EXPECT_TRUE(std::isnan(law.cdf(NAN)));
        EXPECT_EQ(law.pdf(infinity), 0);
        EXPECT_EQ(law.pdf(-infinity), 0);
        EXPECT_EQ(law.log_pdf(infinity), -infinity);
        if (kind == Law::published) continue;
        EXPECT_EQ(law.cdf(-infinity), 0);
        EXPECT_EQ(law.cdf(infinity), 1);
        EXPECT_EQ(law.sf(infinity), 0);
    }
}

TEST(LawEdge, no_x_overflows) {
    const ErrorLaw law(Law::exact, {1, 2, .5, .5});
    EXPECT_NEAR(law.log_pdf(1e300), std::log(law.tail_constant()) - 2 * std::log(1e300), 1e-10);
    EXPECT_LE(relative(law.sf(1e300), law.tail_constant() / 1e300), 1e-12);
    EXPECT_GE(law.pdf(1.7e308), 0);
}

TEST(LawEdge, point_mass) {
    for (const ErrorModel& model : {ErrorModel{.25, 2, .125, 1, 1}, ErrorModel{0, 1, 0, .5}, ErrorModel{1, 2, 0, 0}}) {
        const ErrorLaw law(Law::exact, model);
        EXPECT_EQ(law.pdf(0), infinity);
        EXPECT_EQ(law.pdf(1e-300), 0);
        EXPECT_EQ(law.pdf(1), 0);
        EXPECT_EQ(law.log_pdf(0), infinity);
        EXPECT_EQ(law.log_pdf(-1), -infinity);
        EXPECT_EQ(law.cdf(-1e-300), 0);
        EXPECT_EQ(law.cdf(0), 1);
        EXPECT_EQ(law.sf(0), 0);
        EXPECT_EQ(law.sf(-1), 1);
        EXPECT_EQ(law.quantile(.3), 0);
        EXPECT_EQ(law.modes(), std::vector<double>{0});
        EXPECT_EQ(law.bin_probabilities(std::vector<double>{-1, 0, 1}), (std::vector<double>{0, 0, 1, 0}));
    }
}

// X = a Z / (1 + s Z) has its density and probability by hand.
TEST(LawEdge, full_correlation) {
    const ErrorModel model{1, 2, .5, .5, 1};
    const ErrorLaw law(Law::exact, model);
    const auto [s, a, b] = canonical(model);
    EXPECT_EQ(b, 0);
    for (const double x : {-3., -.2, 0., .3, .99, 1.01, 40.}) {
        const double z = x / (a - s * x);
        EXPECT_LE(relative(law.pdf(x), std::exp(-z * z / 2) / std::sqrt(2 * std::numbers::pi) * a / std::pow(a - s * x, 2)),
                  1e-11)
            << x;
        const double below_pole = std::erfc(1 / s / std::numbers::sqrt2) / 2;
        const double to_z = std::erfc(-z / std::numbers::sqrt2) / 2;
        EXPECT_NEAR(law.cdf(x), x < a / s ? to_z - below_pole : 1 - (below_pole - to_z), 1e-14) << x;
    }
    EXPECT_EQ(law.pdf(a / s), 0);
}

TEST(LawBins, sum_to_one_and_are_the_density) {
    for (const auto& model : models)
        for (const auto kind : {Law::exact, Law::mc, Law::published}) {
            const ErrorLaw law(kind, model);
            std::vector<double> edges;
            for (int i = 0; i <= 64; ++i) edges.push_back((-3 + i * 6.5 / 64) * law.scale());
            const auto p = law.bin_probabilities(edges);
            ASSERT_EQ(p.size(), 66u);
            EXPECT_NEAR(std::accumulate(p.begin(), p.end(), 0.), 1, 1e-12) << text(model);
            if (kind == Law::published) continue;
            for (int i = 0; i < 64; ++i) {
                const double mass = integrate([&](double x) { return law.pdf(x); }, edges[i], edges[i + 1]);
                EXPECT_NEAR(p[i + 1], mass, 1e-15 + 1e-12 * mass) << text(model) << i;
            }
        }
}

// Of the published law too, whose integral over the line is infinite: nothing is scaled.
TEST(LawBins, densities_are_averages_of_the_density) {
    for (const Law kind : {Law::exact, Law::published, Law::mc}) {
        const ErrorLaw law(kind, {.5, 1, .5, .35});
        const auto densities = law.bin_densities(-1, 1, 50);
        ASSERT_EQ(densities.size(), 50u);
        for (int i = 0; i < 50; ++i) {
            const double low = -1 + .04 * i;
            const double mean = integrate([&](double x) { return law.pdf(x); }, low, low + .04) / .04;
            EXPECT_LE(relative(densities[static_cast<std::size_t>(i)], mean), 1e-12) << i;
        }
    }
    EXPECT_NE(ErrorLaw(Law::published, {.5, 1, .5, .35}).bin_densities(-1, 1, 50)[25],
              25 * ErrorLaw(Law::published, {.5, 1, .5, .35}).bin_probabilities(-1, 1, 50)[26])
        << "planted fault: scaled";
}

TEST(LawBins, far_tails_keep_their_digits) {
    const ErrorLaw law(Law::exact, {.5, 1, .5, .35});
    const auto p = law.bin_probabilities(std::vector<double>{-1e9, -1e8, 1e8, 2e8});
    const double c = law.tail_constant();
    EXPECT_LE(relative(p[0], c / 1e9), 1e-7);
    EXPECT_LE(relative(p[1], c / 1e8 - c / 1e9), 1e-7);
    EXPECT_LE(relative(p[3], c / 2e8), 1e-7);
    EXPECT_LE(relative(p[4], c / 2e8), 1e-7);
}

TEST(LawBins, bad_edges_are_refused) {
    const ErrorLaw law(Law::exact, {.5, 1, .5, .35});
    EXPECT_THROW(law.bin_probabilities(0, 1, 0), InvalidArgument);
    EXPECT_THROW(law.bin_probabilities(1, 1, 4), InvalidArgument);
    EXPECT_THROW(law.bin_probabilities(0, infinity, 4), InvalidArgument);
    EXPECT_EQ(law.bin_probabilities(0, 1, 4), law.bin_probabilities(std::vector<double>{0, .25, .5, .75, 1}));
    EXPECT_THROW(law.bin_probabilities(std::vector<double>{0}), InvalidArgument);
    EXPECT_THROW(law.bin_probabilities(std::vector<double>{0, 0}), InvalidArgument);
    EXPECT_THROW(law.bin_probabilities(std::vector<double>{1, 0}), InvalidArgument);
    EXPECT_THROW(law.bin_probabilities(std::vector<double>{0, NAN}), InvalidArgument);
    EXPECT_THROW(law.bin_probabilities(std::vector<double>{0, infinity}), InvalidArgument);
}

TEST(Law, published_has_no_probability) {
    const ErrorLaw law(Law::published, {.5, 1, .5, .35});
    EXPECT_TRUE(std::isnan(law.cdf(.1)));
    EXPECT_TRUE(std::isnan(law.quantile(.1)));
    EXPECT_TRUE(std::isnan(law.bias()));
    EXPECT_EQ(law.tail_constant(), infinity);
    EXPECT_EQ(ErrorLaw(Law::published, {.5, 1, .5, 0}).cdf(0), .5);
}
