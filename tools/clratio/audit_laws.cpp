// Equations (14) to (23): error samples, and the density they should have.
#include <algorithm>
#include <array>
#include <numbers>

#include "audit_samples.hpp"
#include "clratio/stream.hpp"
#include "quadrature.hpp"

namespace tool::audit {
namespace {

using clratio::ErrorLaw;
using clratio::ErrorModel;
using clratio::Law;
using Numbers = std::vector<Number>;

// s = .35, .25, and .2 with the impulse; then a denominator that is negative one time in six, s = 1.
constexpr ErrorModel figure{.5, 1, .5, .35}, half{1, 2, .5, .5}, impulse{1, 0, .3, .2}, wild{1, 2, .5, 2};
constexpr std::array models{figure, half, impulse, wild};
const std::array<std::string, 4> labels{"s = .35", "s = .25", "tau 0, s = .2", "s = 1"};

constexpr double rounding = 1e-11;  ///< the library's bound for its integrals
constexpr double infinity = std::numeric_limits<double>::infinity();

double control(const ErrorModel& e) { return e.tau == 0 ? 1 : e.tau; }

// Eq. (14) as it stands, of two normals.
double literal_error(const ErrorModel& e, double z1, double z2) {
    return control(e) * (e.mu + e.sigma_m * z1) / (control(e) + e.sigma_t * z2) - e.mu;
}

// What the two ends of xi in [0, 1] make of (14).
Number closed_interval() {
    int not_finite = 0;
    for (const double z1 : {-infinity, infinity})
        for (const double z2 : {-infinity, infinity}) not_finite += !std::isfinite(literal_error(figure, z1, z2));
    return computed("not finite, of the 4 corners of xi", not_finite, 0, 4, 0);
}

Numbers samples_follow_exact_law(const Work& work) {
    Numbers out;
    for (std::uint32_t k = 0; k < models.size(); ++k)
        out.push_back(computed("KS to the exact law, " + labels[k], Counts(work, models[k], k).distance(Law::exact),
                               farthest(work.samples), 0));
    out.push_back(closed_interval());
    return out;
}

// P(X <= 0) among denominators of one sign, by (15) and by its complement, averaged over the denominator.
struct Conditional {
    Average seen;
    double mapped, complement;
};

Conditional below_zero(const Work& work, bool same_sign) {
    std::vector<float> z(2 * work.samples / 10);
    clratio::fill_normals(work.engine, {1, 100}, 0, std::span(z));
    double hits = 0, n = 0;
    for (std::size_t i = 0; i < z.size(); i += 2) {
        const bool same = (control(wild) + wild.sigma_t * z[i + 1]) / control(wild) > 0;
        if (same != same_sign) continue;
        ++n;
        hits += literal_error(wild, z[i], z[i + 1]) <= 0;
    }
    const double edge = -control(wild) / wild.sigma_t, far = same_sign ? 12 : -12;
    const auto mapped = [&](double z2) {
        const double denominator = control(wild) + wild.sigma_t * z2;
        return normal_density(z2) * normal_cdf((denominator * wild.mu / control(wild) - wild.mu) / wild.sigma_m);
    };
    const double xi =
        simpson(mapped, edge, far, 4000) / simpson([](double v) { return normal_density(v); }, edge, far, 4000);
    const double p = hits / n;
    return {{p, std::sqrt(xi * (1 - xi) / n)}, xi, 1 - xi};
}

Numbers mapping(const Work& work) {
    const auto same = below_zero(work, true), opposite = below_zero(work, false);
    return {sampled("P(X <= 0), denominators of tau's sign", same.seen, same.mapped),
            sampled("the same of the opposite sign", opposite.seen, opposite.complement, opposite.mapped)};
}

// The largest relative distance of two laws over 12 deviations, all models.
double apart(Law one, Law other) {
    double worst = 0;
    for (const auto& model : models) {
        const ErrorLaw a(one, model), b(other, model);
        for (double x = -4; x <= 4; x += 0.25) worst = std::max(worst, std::abs(a.pdf(x) / b.pdf(x) - 1));
    }
    return worst;
}

// A bin well above 0, where small denominators count most. (At x = 0 and x = -mu the missing factor is 1 on the average.)
Number density_of_samples(const Work& work) {
    const double lo = 0.45, hi = 0.55;
    const ErrorLaw exact(Law::exact, figure), published(Law::integral, figure);
    return sampled("P(.45 <= X < .55), s = .35", share_between(work, figure, 10, lo, hi), exact.cdf(hi) - exact.cdf(lo),
                   simpson([&](double x) { return published.pdf(x); }, lo, hi, 200));
}

Numbers mass_of_17(const ErrorModel& model) {
    const ErrorLaw law(Law::integral, model), exact(Law::exact, model);
    const double s = clratio::canonical(model).s, body = 12 * law.scale();
    const double decade = std::log(1e3), growth = mass(law, 1e7) - mass(law, 1e4);
    return {
        computed("integral of the exact law, tails added", mass(exact, body) + exact.cdf(-body) + exact.sf(body), 1e-9, 1),
        [&] {
            Number n = computed("integral of (17), +-12 sd, s = .35", mass(law, body), 1e-9, 1);
            n.relation = Relation::above;
            return n;
        }(),
        computed("its gain with each factor e of window", growth / decade, 1e-6, 2 * normal_density(1 / s) / s, 0)};
}

// The integrand of (17), and (18, 19), where it is a normal in psi of centre mu' and deviation sigma'.
Number rescaled() {
    double worst = 0;
    for (const auto& e : models)
        for (const double x : {-.8, -.3, .2, .7, 1.9})
            for (double psi = -2.9; psi < 3; psi += 0.1) {
                const double i = e.tau == 0, c = control(e), scale = std::abs(c / (x + e.mu));
                const double centre = e.mu * c / (x + e.mu) - i, deviation = e.sigma_m * scale;
                const double direct = normal_density((psi + i) * (x + e.mu) / c, e.mu, e.sigma_m);
                const double scaled = scale * normal_density(psi, centre, deviation);
                worst = std::max(worst, std::abs(direct - scaled) * e.sigma_m);
            }
    return computed("integrand of (17) - of (18, 19)", worst, 1e-13, 0);
}

Numbers singular_point() {
    const double x = -figure.mu;
    const double deviation = figure.sigma_m * std::abs(figure.tau / (x + figure.mu));
    return {computed("1 / sigma' at x = -mu", 1 / deviation, 0, 0),
            computed("the density (17) there", ErrorLaw(Law::integral, figure).pdf(x), 1e-11,
                     normal_density(figure.mu, 0, figure.sigma_m))};
}

// Two normals in psi and their product, as (20) should have it.
struct Product {
    double tau, st, mu, sm;

    double variance() const { return st * st + sm * sm; }
    double centre() const { return (tau * sm * sm + mu * st * st) / variance(); }
    double direct(double psi) const { return normal_density(psi, tau, st) * normal_density(psi, mu, sm); }
    double joined(double psi) const {
        return normal_density(tau, mu, std::sqrt(variance())) *
               normal_density(psi, centre(), st * sm / std::sqrt(variance()));
    }
};

constexpr Product same_centre{1, .5, 1, .4}, shifted{1, .5, .7, .4};

Numbers product_of_normals() {
    double worst = 0;
    for (double psi = -1; psi < 3; psi += 0.05)
        worst = std::max(worst, std::abs(shifted.direct(psi) / shifted.joined(psi) - 1));
    // At a common centre the exponents are 0 and the constants stand alone.
    const auto& p = same_centre;
    const double literal_constant = 1 / (std::sqrt(2 * std::numbers::pi) * p.st * p.sm);
    const double drop = std::log(p.direct(p.tau + 0.3) / p.direct(p.tau)), literal_drop = -0.3 * 0.3 * p.variance() / 2;
    return {computed("g g / corrected product - 1, at most", worst, 1e-12, 0),
            computed("g g / printed form, at the centre", p.direct(p.tau) / literal_constant, 1e-14,
                     1 / std::sqrt(2 * std::numbers::pi), 1),
            computed("exponent .3 off the centre", drop, 1e-13, literal_drop / std::pow(p.st * p.sm, 2), literal_drop)};
}

// The exponent of the product, times -2 st^2 sm'^2.
Number completed_square() {
    const auto& p = shifted;
    double worst = 0;
    for (double psi = -3; psi < 5; psi += 0.05) {
        const double open = std::pow(p.sm * (psi - p.tau), 2) + std::pow(p.st * (psi - p.mu), 2);
        const double square =
            p.variance() * std::pow(psi - p.centre(), 2) + std::pow(p.st * p.sm * (p.tau - p.mu), 2) / p.variance();
        worst = std::max(worst, std::abs(open - square));
    }
    return computed("completed square - open form, at most", worst, 1e-13, 0);
}

Numbers published_law(const Work& work) {
    Numbers out{computed("(22) / (17) - 1, at most, 4 models", apart(Law::published, Law::integral), rounding, 0)};
    const ErrorModel tenth{.5, 1, .5, .1};
    const double s = .1, body = 12 * ErrorLaw(Law::exact, tenth).scale();
    out.push_back(computed("integral of (22), +-12 sd, s = .1", mass(ErrorLaw(Law::published, tenth), body),
                           30 * std::pow(s, 6), 1 + s * s + 3 * std::pow(s, 4), 1));
    for (const std::uint32_t k : {0u, 1u, 2u}) {
        const Counts counts(work, models[k], 20 + k);
        out.push_back(computed("KS to (22), " + labels[k], counts.distance(Law::published), farthest(work.samples),
                               counts.distance(Law::exact, Law::published), 0));
    }
    return out;
}

Numbers limit(const Work& work) {
    const ErrorModel narrow{1, 1, .5, 1e-4};
    double worst = 0;
    const ErrorLaw exact(Law::exact, narrow), normal(Law::mc, narrow);
    for (double x = -2; x <= 2; x += 0.05) worst = std::max(worst, std::abs(exact.pdf(x) - normal.pdf(x)));
    // s and a = -mu s are both small, so that the two differ by the order of s^2.
    return {computed("exact law - N(0, sm^2), s = 1e-4", worst, 30e-8, 0),
            computed("KS to N(0, sm^2), s = 1e-4", Counts(work, narrow, 30).distance(Law::mc), farthest(work.samples), 0)};
}

}  // namespace

std::vector<Finding> law_findings(const Work& work) {
    using enum Verdict;
    return {
        {"14", "the error of the estimator is (tau + i)(mu + sm Q(xi1)) / (tau + st Q(xi2) + i) - mu, xi in [0, 1]",
         misleading,
         "Right for normal means without correlation, and for xi in (0, 1): an end of the interval gives infinities, and "
         "NaN "
         "for inf / inf. The library draws from the open interval and takes a correlation.",
         samples_follow_exact_law(work)},
        {"15", "given psi, x is mapped to xi1 = Xi(x, psi)", misleading,
         "Where (psi + i) / (tau + i) is positive. For the opposite sign X falls as xi1 grows: its distribution function is "
         "1 - Xi.",
         mapping(work)},
        {"16",
         "f(x) is the integral of g(G^-1(Xi)) g(psi) over psi",
         wrong,
         "The density of x for one psi is dXi/dx: |psi + i| / |tau + i| is missing. With it, the integral is the exact law.",
         {computed("(16) corrected / exact law - 1, 4 models", apart(Law::exact_integral, Law::exact), 1e-10, 0),
          density_of_samples(work)}},
        {"17", "the same integral, simplified", wrong,
         "Without the factor it is no density: weighted by E[1/|psi + i|] it has an infinite integral, for every "
         "sigma_t > 0.",
         mass_of_17(figure)},
        {"18, 19", "the second normal rescaled to a normal in psi, of mean mu' and deviation sm'", right,
         "As algebra of (17). At x = -mu both mu' and sm' are infinite; the singularity is removable.",
         [] {
             Numbers out = singular_point();
             out.insert(out.begin(), rescaled());
             return out;
         }()},
        {"20", "the product of the two normals", wrong,
         "A factor 1 / sqrt(2 pi) is missing, the exponent is not divided by st^2 sm'^2, and two mu should be mu'. It is "
         "g(tau; mu', sqrt(st^2 + sm'^2)) g(psi; (tau sm'^2 + mu' st^2) / (st^2 + sm'^2), st sm' / sqrt(st^2 + sm'^2)).",
         product_of_normals()},
        {"21",
         "the square in psi completed",
         misleading,
         "The third line is right. The denominators of the first two are not as they should be: the inner one is "
         "st^2 + sm'^2.",
         {completed_square()}},
        {"22", "the law is N(0, sqrt(((mu + x) / (tau + i))^2 st^2 + sm^2)) at x, a skew normal", wrong,
         "The value of (17) exactly, through lines with a lost square and stray 2 pi, but not the density of (14): that is "
         "(22) times E|N(m, v^2)|. Its deviation depends on x, so it is no normal and no skew normal, and its integral is "
         "not 1.",
         published_law(work)},
        {"23", "for st -> 0 the law tends to N(0, sm^2)", right, "The exact law too.", limit(work)},
    };
}

}  // namespace tool::audit
