#include "clratio/fit.hpp"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>
#include <vector>

#include "clratio/exception.hpp"
#include "clratio/histogram.hpp"
#include "clratio/law.hpp"
#include "quadrature.hpp"

namespace clratio {
namespace {

constexpr double pi = std::numbers::pi;

std::uint64_t checked_total(std::span<const std::uint64_t> counts, std::span<const double> probabilities) {
    if (counts.size() != probabilities.size())
        throw InvalidArgument("probabilities", std::to_string(counts.size()) + ", one for each cell",
                              std::to_string(probabilities.size()));
    for (double p : probabilities)
        if (!(p >= 0)) throw InvalidArgument("probabilities", "none that is negative or NaN", std::to_string(p));
    const double sum = std::accumulate(probabilities.begin(), probabilities.end(), 0.0);
    if (!(std::abs(sum - 1) <= 1e-9)) throw InvalidArgument("probabilities", "a sum of 1", std::to_string(sum));
    std::uint64_t n = 0;
    for (const std::uint64_t count : counts)
        if (__builtin_add_overflow(n, count, &n)) throw InvalidArgument("counts", "fewer than 2^64 draws", "more");
    if (n == 0) throw InvalidArgument("counts", "at least one draw", "none");
    return n;
}

struct Cell {
    double expected = 0, observed = 0;
};

std::vector<Cell> pooled(std::span<const std::uint64_t> counts, std::span<const double> probabilities, double n,
                         double least_expected) {
    std::vector<Cell> cells;
    Cell open;
    for (std::size_t i = 0; i < counts.size(); ++i) {
        open.expected += n * probabilities[i];
        open.observed += static_cast<double>(counts[i]);
        if (open.expected < least_expected) continue;
        cells.push_back(open);
        open = {};
    }
    if (!cells.empty()) {
        cells.back().expected += open.expected;
        cells.back().observed += open.observed;
    }
    return cells;
}

// P(K <= x) of Kolmogorov's law by its theta series, which converges fast below 1.
double kolmogorov_below(double x) {
    double sum = 0;
    for (int k = 1; k < 40; k += 2) sum += std::exp(-k * k * pi * pi / (8 * x * x));
    return x > 0 ? std::sqrt(2 * pi) / x * sum : 0;
}

double kolmogorov_above(double x) {
    double sum = 0;
    for (int k = 1; k < 40; ++k) sum += (k % 2 ? 2 : -2) * std::exp(-2.0 * k * k * x * x);
    return sum;
}

// P(A^2 <= z) of the limiting law, Anderson and Darling's series. Panels lie denser near 0, where the integrand bends.
double anderson_darling_below(double z) {
    if (z > 36) return 1;  // above lie 4e-17, and the series cancels
    constexpr int panels = 16;
    double sum = 0, binomial = 1;
    for (int j = 0; j < 400; ++j) {
        const double c = (4 * j + 1) * (4 * j + 1) * pi * pi / (8 * z);
        const double reach = std::sqrt(40 / c);
        const auto f = [&](double w) { return std::exp(z / (8 * (1 + w * w)) - c * (1 + w * w)); };
        double integral = 0;
        for (int k = 0; k < panels; ++k)
            integral += integrate(f, reach * k * k / (panels * panels), reach * (k + 1) * (k + 1) / (panels * panels));
        const double term = binomial * (4 * j + 1) * integral;
        sum += term;
        if (std::abs(term) <= 1e-18 * std::abs(sum)) break;
        binomial *= -(j + 0.5) / (j + 1);
    }
    return std::clamp(std::sqrt(2 * pi) / z * sum, 0.0, 1.0);
}

std::vector<double> cell_probabilities(const Histogram& h, const ErrorLaw& law) { return law.bin_probabilities(h.edges()); }

Fit with_nan_rejected(Fit fit, const Histogram& h) {
    if (h.nonfinite == 0) return fit;
    fit.statistic = std::numeric_limits<double>::infinity();
    fit.p = 0;
    fit.q = 1;
    fit.n += h.nonfinite;
    return fit;
}

void check_sums(std::span<const double> cdf, std::span<const double> sf) {
    for (std::size_t i = 0; i < cdf.size(); ++i)
        if (std::abs(cdf[i] + sf[i] - 1) > 1e-3)
            throw InvalidArgument("sf", "1 - cdf", std::to_string(sf[i]) + " beside a cdf of " + std::to_string(cdf[i]));
}

void check_unit(const char* name, std::span<const double> values) {
    for (double v : values)
        if (!(v >= 0 && v <= 1)) throw InvalidArgument(name, "values in [0, 1]", std::to_string(v));
}

}  // namespace

Fit chi_square(std::span<const std::uint64_t> counts, std::span<const double> probabilities, double least_expected) {
    if (!(least_expected > 0)) throw InvalidArgument("least_expected", "a number above 0", std::to_string(least_expected));
    const std::uint64_t n = checked_total(counts, probabilities);
    const auto cells = pooled(counts, probabilities, static_cast<double>(n), least_expected);
    if (cells.size() < 2)
        throw InvalidArgument("counts", "two cells that expect " + std::to_string(least_expected) + " draws or more",
                              std::to_string(n) + " draws in " + std::to_string(counts.size()) + " cells");
    Fit fit;
    for (const Cell& c : cells) fit.statistic += (c.observed - c.expected) * (c.observed - c.expected) / c.expected;
    fit.n = n;
    fit.cells = cells.size();
    fit.dof = fit.cells - 1;
    const double half_dof = static_cast<double>(fit.dof) / 2;
    fit.p = boost::math::gamma_q(half_dof, fit.statistic / 2);
    fit.q = boost::math::gamma_p(half_dof, fit.statistic / 2);
    return fit;
}

Fit kolmogorov_smirnov(std::span<const std::uint64_t> counts, std::span<const double> probabilities) {
    Fit fit;
    fit.n = checked_total(counts, probabilities);
    fit.cells = counts.size();
    const double n = static_cast<double>(fit.n);
    double law = 0;
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i < counts.size(); ++i) {
        law += probabilities[i];
        seen += counts[i];
        fit.statistic = std::max(fit.statistic, std::abs(static_cast<double>(seen) / n - law));
    }
    const double x = (std::sqrt(n) + 0.12 + 0.11 / std::sqrt(n)) * fit.statistic;
    fit.p = x < 1 ? 1 - kolmogorov_below(x) : kolmogorov_above(x);
    fit.q = x < 1 ? kolmogorov_below(x) : 1 - kolmogorov_above(x);
    return fit;
}

std::vector<std::uint64_t> cells(const Histogram& histogram) {
    std::vector<std::uint64_t> out{histogram.underflow};
    out.insert(out.end(), histogram.bins.begin(), histogram.bins.end());
    out.push_back(histogram.overflow);
    return out;
}

Fit chi_square(const Histogram& histogram, const ErrorLaw& law, double least_expected) {
    return with_nan_rejected(chi_square(cells(histogram), cell_probabilities(histogram, law), least_expected), histogram);
}

Fit kolmogorov_smirnov(const Histogram& histogram, const ErrorLaw& law) {
    return with_nan_rejected(kolmogorov_smirnov(cells(histogram), cell_probabilities(histogram, law)), histogram);
}

Fit anderson_darling(std::span<const double> cdf, std::span<const double> sf) {
    if (cdf.empty() || sf.size() != cdf.size())
        throw InvalidArgument("sf", std::to_string(std::max<std::size_t>(cdf.size(), 1)) + " values",
                              std::to_string(sf.size()));
    check_unit("cdf", cdf);
    check_unit("sf", sf);
    check_sums(cdf, sf);
    std::vector<double> below(cdf.begin(), cdf.end()), above(sf.begin(), sf.end());
    std::sort(below.begin(), below.end());
    std::sort(above.begin(), above.end());
    Fit fit;
    fit.n = below.size();
    const double n = static_cast<double>(fit.n);
    double sum = 0;
    for (std::size_t i = 0; i < below.size(); ++i)
        sum += (2 * static_cast<double>(i) + 1) * (std::log(below[i]) + std::log(above[i]));
    fit.statistic = -n - sum / n;
    if (!std::isfinite(fit.statistic)) return {std::numeric_limits<double>::infinity(), 0, 1, fit.n};
    fit.q = anderson_darling_below(fit.statistic);
    fit.p = 1 - fit.q;
    return fit;
}

}  // namespace clratio
