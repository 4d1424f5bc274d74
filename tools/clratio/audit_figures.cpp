// The sentences on Figures 1 and 2: variance, spread, brightness, precision.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "audit_models.hpp"
#include "audit_pipelines.hpp"
#include "audit_samples.hpp"
#include "clratio/device/quantile.h"
#include "clratio/fit.hpp"
#include "clratio/stream.hpp"
#include "quadrature.hpp"

namespace tool::audit {
namespace {

using clratio::ErrorLaw;
using clratio::ErrorModel;
using clratio::Law;
using Numbers = std::vector<Number>;

ErrorModel figure(std::uint64_t n) { return {.5, 1, .5, .35, 0, n}; }

std::string after(const std::string& what, std::uint64_t n) { return what + ", n = " + std::to_string(n); }

enum Streams : std::uint32_t { spreads = 200, tails = 210, blocks = 220, brightness = 230, pipelines = 240 };
enum Runs : std::uint32_t { unrelated = 40, heavy = 42, shadowed = 44 };

// MSE over that of the plain mean. The errors of both come from the same pairs: their bar is an upper bound.
Average relative_mse(const Trial& trial) {
    const Average ratio = trial.mse(trial.ratio), mean = trial.mse(trial.mean);
    const double value = ratio.value / mean.value;
    return {value, value * (ratio.error / ratio.value + mean.error / mean.value)};
}

double predicted(Model model, std::uint64_t n) {
    const auto count = static_cast<double>(n);
    return delta_mse(model, count) * count / central_moment(model, 2, 0);
}

Numbers variance_without_correlation(const Work& work) {
    const Trial b = simulate(work, Model::unrelated, unrelated, {64}).front();
    const Trial a = simulate(work, Model::shadowed, shadowed, {64}).front();
    const auto c = simulate(work, Model::heavy, heavy, {2, 64});
    return {sampled(after("MSE / MSE of the mean, B (rho 0)", 64), relative_mse(b), predicted(Model::unrelated, 64), 1),
            sampled(after("the same, C (rho .13)", 2), relative_mse(c[0]), Relation::below, 1),
            sampled(after("the same, C", 64), relative_mse(c[1]), Relation::above, 1),
            sampled(after("the same, A (rho .77)", 64), relative_mse(a), predicted(Model::shadowed, 64), 1)};
}

std::vector<double> sorted_samples(const Work& work, const ErrorModel& model, std::uint32_t id, std::uint64_t count) {
    std::vector<float> x(count);
    clratio::error_samples(work.engine, clratio::canonical(model), {1, id}, 0, std::span(x));
    std::vector<double> out(x.begin(), x.end());
    std::sort(out.begin(), out.end());
    return out;
}

// The distance between the quartiles; its error from the density at both, which are correlated by 1/3.
Average quartile_width(const Work& work, const ErrorModel& model, std::uint32_t id) {
    const auto x = sorted_samples(work, model, id, work.samples / 10);
    const ErrorLaw law(Law::exact, model);
    const double n = static_cast<double>(x.size()), low = x[x.size() / 4], high = x[3 * x.size() / 4];
    const double a = 1 / law.pdf(low), b = 1 / law.pdf(high);
    return {high - low, std::sqrt((3 * a * a + 3 * b * b - 2 * a * b) / 16 / n)};
}

// Sums of x^2 of a law with tails C / |x| have a Levy law of scale pi/2 (2 C n)^2, whose median is 1 / (2 erfcinv(1/2)^2)
// = 2.19811 of it: the median of sample variances of n samples is that over n, and the body's part.
struct MedianVariance {
    Average seen;
    double expected, body;
    std::uint64_t n;
};

MedianVariance median_variance(const Work& work, const ErrorModel& model) {
    constexpr std::size_t count = 1000;
    const std::uint64_t n = 10 * work.samples / count;
    std::vector<double> variances(count);
    std::vector<float> x(n);
    for (std::size_t k = 0; k < count; ++k) {
        clratio::error_samples(work.engine, clratio::canonical(model), {1, blocks}, k * n, std::span(x));
        const double mean = std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(n);
        double squares = 0;
        for (const float v : x) squares += (v - mean) * (v - mean);
        variances[k] = squares / static_cast<double>(n - 1);
    }
    std::sort(variances.begin(), variances.end());
    const ErrorLaw law(Law::exact, model);
    const auto c = clratio::canonical(model);
    const double body = law.scale() * law.scale() * (1 + 3 * c.s * c.s) + 5 * c.s * c.s * c.a * c.a;
    const double scale = std::numbers::pi / 2 * std::pow(2 * law.tail_constant(), 2) * static_cast<double>(n);
    // The median of `count` values has the error 1 / (2 f sqrt(count)), f = 0.0975 / scale the density there.
    return {{variances[count / 2], scale / (2 * 0.0975 * std::sqrt(double{count}))}, 2.19811 * scale + body, body, n};
}

Numbers spread(const Work& work) {
    Numbers out;
    for (const double x : {10.0, 1000.0}) {
        const Average inside = share_between(work, figure(1), tails, -x, x);
        const ErrorLaw law(Law::exact, figure(1));
        out.push_back(sampled(x == 10 ? "x P(|X| > x), x = 10, s = .35" : "the same, x = 1000",
                              {(1 - inside.value) * x, inside.error * x}, (law.cdf(-x) + law.sf(x)) * x, 0));
    }
    out.push_back(computed("2 C, the limit of x P(|X| > x)", 1e6 * 2 * ErrorLaw(Law::exact, figure(1)).sf(1e6), 1e-6,
                           2 * ErrorLaw(Law::exact, figure(1)).tail_constant(), 0));
    const auto variance = median_variance(work, figure(1));
    out.push_back(sampled("median variance of blocks of " + std::to_string(variance.n), variance.seen, variance.expected,
                          variance.body));
    const Average wide = quartile_width(work, figure(16), spreads), narrow = quartile_width(work, figure(64), spreads + 1);
    const ErrorLaw law16(Law::exact, figure(16)), law64(Law::exact, figure(64));
    const double value = narrow.value / wide.value;
    out.push_back(sampled("quartiles' distance, n = 64 / n = 16",
                          {value, value * std::hypot(wide.error / wide.value, narrow.error / narrow.value)},
                          (law64.quantile(.75) - law64.quantile(.25)) / (law16.quantile(.75) - law16.quantile(.25)), 1));
    return out;
}

// Darker samples are denser next to 0: the counts of two equal bins right and left of it, their difference over their sum.
Average lean(const Work& work, const ErrorModel& model, double width) {
    const auto counts = clratio::error_histogram(work.engine, clratio::canonical(model), {1, brightness}, {0, work.samples},
                                                 {-width, width, 2});
    const auto left = static_cast<double>(counts.bins[0]), right = static_cast<double>(counts.bins[1]);
    return {(right - left) / (right + left), 1 / std::sqrt(left + right)};
}

// The mean of samples within 12 deviations, which is what a simulation sees.
Average mean_within(const Work& work, const ErrorModel& model) {
    std::vector<float> x(work.samples);
    clratio::error_samples(work.engine, clratio::canonical(model), {1, brightness + 1}, 0, std::span(x));
    const double far = 12 * ErrorLaw(Law::exact, model).scale();
    std::erase_if(x, [&](float v) { return !(std::abs(v) < far); });
    return average(x.size(), [&](std::size_t i) { return x[i]; });
}

Numbers dark_and_bright(const Work& work) {
    const ErrorModel model = figure(16);
    const ErrorLaw exact(Law::exact, model), published(Law::published, model);
    const auto canonical = clratio::canonical(model);
    const double c = canonical.s * canonical.a, s2 = canonical.s * canonical.s, width = exact.scale() / 2;
    const double left = exact.cdf(0) - exact.cdf(-width), right = exact.cdf(width) - exact.cdf(0);
    const double far = 12 * exact.scale();
    const auto first_moment = [&](double x) { return x * published.pdf(x); };
    const double published_mean =
        simpson(first_moment, -far, far, 4000) / simpson([&](double x) { return published.pdf(x); }, -far, far, 4000);
    Numbers out{computed("mode / c, n = 16, s = .0875", exact.modes().front() / c, 8 * s2, 2, 1),
                sampled("(just above - just below 0) / all", lean(work, model, width), (right - left) / (right + left), 0)};
    const Average below = share_between(work, model, brightness, -far, 0);
    out.push_back(sampled("share below 0", {below.value, .5 / std::sqrt(static_cast<double>(work.samples))}, .5));
    out.push_back(sampled("mean within 12 sd", mean_within(work, model), exact.bias(), published_mean));
    return out;
}

// chi-square of counts over its degrees of freedom: 1, with deviation sqrt(2 / dof), where the law is right; the non-central
// chi-square's deviation where it is not.
Number chi_square_of(const std::string& what, const clratio::Histogram& counts, Law law) {
    std::vector<std::uint64_t> cells{counts.underflow};
    cells.insert(cells.end(), counts.bins.begin(), counts.bins.end());
    cells.push_back(counts.overflow);
    const auto bins = static_cast<std::uint32_t>(counts.bins.size());
    const auto fit = clratio::chi_square(cells, ErrorLaw(law, figure(1)).bin_probabilities(counts.lo, counts.hi, bins));
    const auto dof = static_cast<double>(fit.dof);
    const double value = fit.statistic / dof;
    return law == Law::exact ? sampled(what + ", exact law", {value, std::sqrt(2 / dof)}, 1)
                             : sampled(what + ", (22)", {value, std::sqrt(2 * (2 * value - 1) / dof)}, Relation::above, 2);
}

void add_fits(Numbers& to, const std::string& name, const clratio::Histogram& counts) {
    to.push_back(chi_square_of("chi2 / dof, " + name, counts, Law::exact));
    to.push_back(chi_square_of("chi2 / dof, " + name, counts, Law::published));
}

// Words at both ends of the range: where anything but a finite normal comes out, and the largest that does.
struct Ends {
    std::uint64_t not_finite = 0;
    double largest = 0;
};

template <class Normal> Ends ends(Normal normal) {
    Ends out;
    for (std::uint32_t i = 0; i < 1u << 16; ++i)
        for (const std::uint32_t h : {i, ~i}) {
            const double z = std::abs(normal(h));
            if (std::isfinite(z))
                out.largest = std::max(out.largest, z);
            else
                ++out.not_finite;
        }
    return out;
}

Numbers precision(const Work& work) {
    const Ends literal = ends(literal_normal), ours = ends([](std::uint32_t h) { return clratio::device::clr_normal(h); });
    const Ends wide = ends([](std::uint32_t h) { return clratio::device::clr_normal_double(h, h); });
    const ErrorLaw normal(Law::mc, {0, 1, 1, 0});
    const double most = -normal.quantile(0x1p-33), most_wide = -normal.quantile(0x1p-65);
    Numbers out{computed("words without a normal, literal", static_cast<double>(literal.not_finite), 0, 193, 0),
                computed("the same, ours, float and double", static_cast<double>(ours.not_finite + wide.not_finite), 0, 0),
                computed("|z| at most, literal", literal.largest, 2e-3, -normal.quantile(0x1p-25), most),
                computed("|z| at most, ours, float", ours.largest, 6e-7 * most, most),
                computed("|z| at most, ours, double", wide.largest, 2e-15 * most_wide, most_wide)};
    const clratio::Bins bins{-1.5, 1.5, 1024};
    const clratio::Stream stream{1, pipelines};
    const auto drawn = [&](clratio::Precision p) {
        return clratio::error_histogram(work.engine, clratio::canonical(figure(1)), stream, {0, work.samples}, bins,
                                        {.precision = p});
    };
    add_fits(out, "literal", literal_histogram(figure(1), work.samples, bins));
    add_fits(out, "ours, float", drawn(clratio::Precision::single_precision));
    if (work.engine.info().fp64) add_fits(out, "ours, double", drawn(clratio::Precision::double_precision));
    return out;
}

}  // namespace

std::vector<Finding> figure_findings(const Work& work) {
    using enum Verdict;
    return {
        {"text", "where m and t are uncorrelated there is no variance reduction", misleading,
         "The variance rises, by mu^2 CV(t)^2 / n. The ratio wins in the limit only where rho > CV(t) / (2 CV(m)); with few "
         "samples, and 0 <= m <= t, it wins earlier.",
         variance_without_correlation(work)},
        {"text", "the standard deviation decreases with the number of samples", wrong,
         "For st > 0 there is no standard deviation, nor a mean: the tails are C / x^2 and sample variances grow with the "
         "sample. Distances of quantiles do shrink, as 1 / sqrt n.",
         spread(work)},
        {"text", "the estimate is darker first, then slightly brighter", misleading,
         "With c = Cov(D, U), the residual's covariance with the relative denominator: the mode is at 2c, darker where mu > "
         "0; "
         "the median at 0; the mean in the sense of principal values at -c, brighter. All vanish as 1/n. (22) has the mode "
         "at c and the mean at -2c.",
         dark_and_bright(work)},
        {"text", "samples would agree better at higher precision and with a better generator", wrong,
         "Float and a 32-bit hash agree with the exact law as well as double and Philox do, at this many samples. What is "
         "left "
         "is the error of (22). The literal map does lose the tails: normals that are infinite, and none beyond 5.42.",
         precision(work)},
    };
}

}  // namespace tool::audit
