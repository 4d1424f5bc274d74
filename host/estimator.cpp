#include "clratio/estimator.hpp"

#include <algorithm>
#include <array>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <limits>

#include "clratio/exception.hpp"

namespace clratio {
namespace {

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double not_known = std::numeric_limits<double>::quiet_NaN();

struct Row {
    Estimator estimator;
    const char* name;
    Needs needs;
};

constexpr std::array table{
    Row{Estimator::ratio, "ratio", {}},
    Row{Estimator::mean, "mean", {}},
    Row{Estimator::mean_of_ratios, "mean-of-ratios", {.ratios = true}},
    Row{Estimator::beale, "beale", {.batches = 2}},
    Row{Estimator::tin, "tin", {.batches = 2}},
    Row{Estimator::hartley_ross, "hartley-ross", {.ratios = true, .batches = 2}},
    Row{Estimator::regression, "regression", {.batches = 2}},
    Row{Estimator::jackknife, "jackknife", {.groups = true, .batches = 2}},
    Row{Estimator::mickey, "mickey", {.groups = true, .batches = 2}},
    Row{Estimator::crossfit_regression, "crossfit-regression", {.groups = true, .batches = 2}},
};

const Row& row(Estimator estimator) {
    const auto place = static_cast<std::size_t>(estimator);
    if (place >= table.size()) throw InvalidArgument("estimator", "one of all_estimators()", std::to_string(place));
    return table[place];
}

Statistics sum_of(std::span<const Statistics> groups) {
    Statistics all;
    for (const auto& g : groups) all.merge(g);
    return all;
}

/// All batches but those of group k.
Statistics without(std::span<const Statistics> groups, std::size_t k) {
    Statistics rest;
    for (std::size_t g = 0; g < groups.size(); ++g)
        if (g != k) rest.merge(groups[g]);
    return rest;
}

std::size_t filled(std::span<const Statistics> groups) {
    return static_cast<std::size_t>(
        std::count_if(groups.begin(), groups.end(), [](const Statistics& g) { return g.batches > 0; }));
}

double ratio(const Statistics& s) { return s.mean_m / s.mean_t; }
double slope(const Statistics& s) { return s.m2_t > 0 ? s.c_mt / s.m2_t : 0; }

/// The sum of squares of the residual m - r t.
double residual(const Statistics& s, double r) { return s.m2_m - r * (2 * s.c_mt - r * s.m2_t); }
double regression_residual(const Statistics& s) { return s.m2_t > 0 ? s.m2_m - s.c_mt * s.c_mt / s.m2_t : s.m2_m; }

double jackknife(std::span<const Statistics> groups, double tau) {
    const Statistics all = sum_of(groups);
    double value = static_cast<double>(filled(groups)) * ratio(all);
    for (std::size_t k = 0; k < groups.size(); ++k)
        if (groups[k].batches > 0) value -= (1 - groups[k].weight / all.weight) * ratio(without(groups, k));
    return tau * value;
}

double jackknife_variance(std::span<const Statistics> groups, double tau) {
    const Statistics all = sum_of(groups);
    const double middle = jackknife(groups, tau);
    double sum = 0;
    for (std::size_t k = 0; k < groups.size(); ++k) {
        if (groups[k].batches == 0) continue;
        const double h = all.weight / groups[k].weight;
        const double pseudo = tau * (h * ratio(all) - (h - 1) * ratio(without(groups, k)));
        sum += (pseudo - middle) * (pseudo - middle) / (h - 1);
    }
    return sum / static_cast<double>(filled(groups));
}

template <class Coefficient> double cross_fitted(std::span<const Statistics> groups, double tau, Coefficient coefficient) {
    const double weight = sum_of(groups).weight;
    double sum = 0;
    for (std::size_t k = 0; k < groups.size(); ++k)
        if (groups[k].batches > 0)
            sum +=
                groups[k].weight / weight * (groups[k].mean_m - coefficient(without(groups, k)) * (groups[k].mean_t - tau));
    return sum;
}

}  // namespace

std::span<const Estimator> all_estimators() {
    static constexpr auto all = [] {
        std::array<Estimator, table.size()> list{};
        for (std::size_t i = 0; i < list.size(); ++i) list[i] = table[i].estimator;
        return list;
    }();
    return all;
}

std::string name_of(Estimator estimator) { return row(estimator).name; }
Needs needs_of(Estimator estimator) { return row(estimator).needs; }

double student_quantile(double level, double freedom) {
    if (!(level > 0 && level < 1)) throw InvalidArgument("level", "a number in (0, 1)", std::to_string(level));
    if (!(freedom >= 0.5)) throw InvalidArgument("freedom", "a number from .5 on", std::to_string(freedom));
    return boost::math::quantile(boost::math::complement(boost::math::students_t(freedom), (1 - level) / 2));
}

void Statistics::add(double m, double t, double batch_weight) {
    merge({1, batch_weight, batch_weight * batch_weight, m, t, 0, 0, 0, t == 0 ? 0 : m / t});
}

void Statistics::merge(const Statistics& b) {
    if (b.weight == 0) return;
    const double sum = weight + b.weight, share = b.weight / sum, spread = weight * share;
    const double dm = b.mean_m - mean_m, dt = b.mean_t - mean_t;
    m2_m += b.m2_m + dm * dm * spread;
    m2_t += b.m2_t + dt * dt * spread;
    c_mt += b.c_mt + dm * dt * spread;
    mean_m += dm * share;
    mean_t += dt * share;
    mean_quotient += (b.mean_quotient - mean_quotient) * share;
    batches += b.batches;
    weight = sum;
    weight2 += b.weight2;
}

double Statistics::scale(bool reliability) const {
    if (batches < 2) return 0;
    return reliability ? weight2 / (weight * (weight * weight - weight2)) : 1 / ((batches - 1) * weight);
}

double estimate(std::span<const Statistics> groups, Estimator estimator, double tau, bool reliability) {
    const Statistics s = sum_of(groups);
    const Needs needs = needs_of(estimator);
    if (s.batches < needs.batches || (needs.groups && filled(groups) < 2)) return not_known;
    const double n = s.scale(reliability), r = ratio(s);
    switch (estimator) {
    case Estimator::ratio:
        return tau * r;
    case Estimator::mean:
        return s.mean_m;
    case Estimator::mean_of_ratios:
        return tau * s.mean_quotient;
    case Estimator::beale:
        return tau * (s.mean_m * s.mean_t + s.c_mt * n) / (s.mean_t * s.mean_t + s.m2_t * n);
    case Estimator::tin:
        return tau * (r * (1 - s.m2_t * n / (s.mean_t * s.mean_t)) + s.c_mt * n / (s.mean_t * s.mean_t));
    case Estimator::hartley_ross:
        return tau * s.mean_quotient + s.batches / (s.batches - 1) * (s.mean_m - s.mean_quotient * s.mean_t);
    case Estimator::regression:
        return s.mean_m - slope(s) * (s.mean_t - tau);
    case Estimator::jackknife:
        return jackknife(groups, tau);
    case Estimator::mickey:
        return cross_fitted(groups, tau, ratio);
    case Estimator::crossfit_regression:
        return cross_fitted(groups, tau, slope);
    }
    return not_known;
}

double standard_error(std::span<const Statistics> groups, Estimator estimator, double tau, bool reliability) {
    const Statistics s = sum_of(groups);
    const double n = s.scale(reliability), k = s.batches;
    if (estimator == Estimator::mean_of_ratios) return not_known;
    const bool regresses = estimator == Estimator::regression || estimator == Estimator::crossfit_regression;
    if (k < (regresses ? 3 : 2)) return infinite;
    if (estimator == Estimator::mean) return std::sqrt(s.m2_m * n);
    if (regresses) return std::sqrt(std::max(0.0, regression_residual(s)) * n * (k - 1) / (k - 2));
    if (estimator == Estimator::jackknife) return std::sqrt(jackknife_variance(groups, tau));
    if (estimator == Estimator::hartley_ross) return std::sqrt(std::max(0.0, residual(s, s.mean_quotient)) * n);
    return std::fabs(tau / s.mean_t) * std::sqrt(std::max(0.0, residual(s, ratio(s))) * n);
}

double bias_of_ratio(const Statistics& s, double tau, bool reliability) {
    return tau * (ratio(s) * s.m2_t - s.c_mt) * s.scale(reliability) / (s.mean_t * s.mean_t);
}

Interval delta_interval(const Statistics& s, double tau, double quantile, bool reliability) {
    const double value = tau * ratio(s);
    const double width = quantile * standard_error(std::span(&s, 1), Estimator::ratio, tau, reliability);
    if (!std::isfinite(width)) return {-infinite, infinite, IntervalKind::whole_line};
    return {value - width, value + width, IntervalKind::bounded};
}

// a x^2 - 2 b x + c <= 0 with the discriminant from residual variances, which do not cancel.
Interval fieller_interval(const Statistics& s, double tau, double quantile, bool reliability) {
    const double n = s.scale(reliability), q2 = quantile * quantile, vm = s.m2_m * n, vt = s.m2_t * n, cov = s.c_mt * n;
    const double a = s.mean_t * s.mean_t - q2 * vt, b = s.mean_m * s.mean_t - q2 * cov;
    const double square = q2 * (s.mean_t * s.mean_t * residual(s, ratio(s)) * n - q2 * (vm * vt - cov * cov));
    if (s.batches < 2 || (a <= 0 && square <= 0)) return {-infinite, infinite, IntervalKind::whole_line};
    const double root = std::sqrt(std::max(0.0, square)), x = tau * (b - root) / a, y = tau * (b + root) / a;
    return {std::min(x, y), std::max(x, y), a > 0 ? IntervalKind::bounded : IntervalKind::exclusive};
}

Expansion expand_ratio(const RelativeMoments& c, double samples) {
    const double vd = c.c20 - 2 * c.c11 + c.c02, slope = c.c02 - c.c11;
    const double third = -2 * (c.c21 - 2 * c.c12 + c.c03) + 3 * vd * c.c02, n2 = samples * samples;
    return {slope / samples + (c.c12 - c.c03 + 3 * c.c02 * slope) / n2, vd / samples + (third + 5 * slope * slope) / n2,
            vd / samples + (third + 6 * slope * slope) / n2};
}

}  // namespace clratio
