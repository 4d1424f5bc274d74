#include "law_integral.hpp"

#include <cmath>
#include <numbers>
#include <vector>

#include "quadrature.hpp"

namespace clratio {
namespace {

// The model in terms of u = (psi + i) / (tau + i), the denominator relative to its mean: u ~ N(1, s^2) and, given u,
// M ~ N(mu + k (u - 1), sigma^2).
struct Conditional {
    double mu, s, k, sigma;
};

Conditional conditional(const ErrorModel& e) {
    const double c = e.tau == 0 ? 1 : e.tau;
    const double scale = std::sqrt(static_cast<double>(e.n));
    const double s = e.sigma_t / std::abs(c) / scale, sigma_m = e.sigma_m / scale;
    const double r = std::copysign(1.0, c) * e.rho;
    return {e.mu, s, r * sigma_m / s, sigma_m * std::sqrt((1 - r) * (1 + r))};
}

// The integral over u of weight(u) g(u (x + mu); mu + k (u - 1), sigma) g(u; 1, s): the two normals multiply to one of
// centre `peak` and deviation `width` (eq. 20, corrected), around which the panels lie, parted where weight has its kink.
template <class Weight> double over_denominator(const Conditional& c, double x, Weight weight) {
    const double slope = (x + c.mu - c.k) / c.sigma, start = (c.mu - c.k) / c.sigma;
    const double precision = slope * slope + 1 / (c.s * c.s);
    const double peak = (slope * start + 1 / (c.s * c.s)) / precision, width = 1 / std::sqrt(precision);
    const auto exponent = [&](double u) {
        const double m = u * slope - start, t = (u - 1) / c.s;
        return -(m * m + t * t) / 2;
    };
    const double highest = exponent(peak);
    std::vector<double> breaks{0};
    for (int i = -12; i <= 12; ++i) breaks.push_back(peak + i * width);
    std::sort(breaks.begin(), breaks.end());
    const auto f = [&](double u) { return weight(u) * std::exp(exponent(u) - highest); };
    return integrate(f, breaks) * std::exp(highest) / (2 * std::numbers::pi * c.sigma * c.s);
}

}  // namespace

double published_integral(const ErrorModel& model, double x) {
    ErrorModel uncorrelated = model;
    uncorrelated.rho = 0;
    return over_denominator(conditional(uncorrelated), x, [](double) { return 1.0; });
}

double exact_integral(const ErrorModel& model, double x) {
    return over_denominator(conditional(model), x, [](double u) { return std::abs(u); });
}

double exact_integral_cdf(const ErrorModel& model, double x) {
    const Conditional c = conditional(model);
    const double slope = (x + c.mu - c.k) / c.sigma, start = (c.mu - c.k) / c.sigma;
    const auto below = [&](double u) {  // P(M <= u (x + mu)) where u > 0, P(M >= ..) where u < 0
        const double m = (u * slope - start) * std::numbers::sqrt2 / 2;
        return std::erfc(u < 0 ? m : -m) / 2;
    };
    const auto f = [&](double u) {
        const double t = (u - 1) / c.s;
        return std::exp(-t * t / 2) * below(u);
    };
    std::vector<double> breaks;
    const auto part_at = [&](double u) {
        if (std::abs(u - 1) <= 13 * c.s) breaks.push_back(u);
    };
    part_at(0);
    for (int i = -13; i <= 13; ++i) {
        breaks.push_back(1 + i * c.s);
        if (slope != 0) part_at((start + i) / slope);
    }
    std::sort(breaks.begin(), breaks.end());
    return integrate(f, breaks) / (c.s * std::sqrt(2 * std::numbers::pi));
}

}  // namespace clratio
