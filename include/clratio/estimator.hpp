// The ratio estimators: what each is, what it needs, and the same in double for one value on the host.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "clratio/device/estimator.h"

namespace clratio {

/// Estimators of E[m], where tau = E[t] is known. N: samples; bias and variance as N grows.
enum class Estimator : std::uint32_t {
    ratio = CLR_ESTIMATOR_RATIO,  ///< tau mean(m) / mean(t), eq. (10): bias O(1/N). The default
    mean = CLR_ESTIMATOR_MEAN,    ///< mean(m): unbiased; tau and t unused
    mean_of_ratios =
        CLR_ESTIMATOR_MEAN_OF_RATIOS,  ///< tau mean(m / t), eq. (5): a bias that no number of batches removes; no error bar
    beale = CLR_ESTIMATOR_BEALE,       ///< Beale 1962: bias O(1/N^2); 0 <= m <= t keeps it in [0, tau]
    tin = CLR_ESTIMATOR_TIN,           ///< Tin 1965: bias O(1/N^2); can leave [0, tau]
    hartley_ross = CLR_ESTIMATOR_HARTLEY_ROSS,  ///< Hartley and Ross 1954: unbiased for batches of equal weight; suffers
                                                ///< from small t
    regression = CLR_ESTIMATOR_REGRESSION,      ///< mean(m) - beta (mean(t) - tau): least variance for large N
    jackknife = CLR_ESTIMATOR_JACKKNIFE,        ///< delete-a-group, 2 groups: Quenouille 1956, Durbin 1959; any weights:
                                                ///< Busing, Meijer and van der Leeden 1999. Bias O(1/N^2)
    mickey = CLR_ESTIMATOR_MICKEY,              ///< Mickey 1959: unbiased, any weights
    crossfit_regression = CLR_ESTIMATOR_CROSSFIT_REGRESSION,  ///< regression with the slope of the other groups: unbiased
};

/// Every estimator, in the order of the enumeration.
std::span<const Estimator> all_estimators();

/// "ratio", "mean-of-ratios", ..: as the command line takes it.
std::string name_of(Estimator estimator);

/// What a state must hold for an estimator to be more than the ratio (or the mean) it falls back to.
struct Needs {
    bool ratios = false;        ///< MomentsOptions::ratios
    bool groups = false;        ///< MomentsOptions::groups > 1
    std::uint32_t batches = 1;  ///< at least
};
Needs needs_of(Estimator estimator);

enum class IntervalMethod : std::uint32_t {
    delta = CLR_INTERVAL_DELTA,      ///< symmetric; too narrow for few batches (80 % instead of 95 % at 4)
    fieller = CLR_INTERVAL_FIELLER,  ///< Fieller 1940: not always bounded
};

/// What lower and upper say: between them; all but the open interval between them; everything.
enum class IntervalKind : std::uint32_t {
    bounded = CLR_KIND_BOUNDED,
    exclusive = CLR_KIND_EXCLUSIVE,
    whole_line = CLR_KIND_WHOLE_LINE,
};

/// Student's quantile of a two-sided interval: P(|T| <= q) = level. Errors: InvalidArgument unless 0 < level < 1 and
/// freedom >= .5.
double student_quantile(double level, double freedom);

/// Moments of one value in double: the definition that the device's float states are tested against, and the way to check a
/// pixel on paper. Second moments are sums of weight times squared distance from the mean.
struct Statistics {
    double batches = 0, weight = 0, weight2 = 0;
    double mean_m = 0, mean_t = 0, m2_m = 0, m2_t = 0, c_mt = 0;
    double mean_quotient = 0;  ///< of m / t, 0 where t is 0

    void add(double m, double t, double batch_weight = 1);
    /// Chan, Golub, LeVeque 1979.
    void merge(const Statistics& other);
    /// Var(mean) = m2 * scale(): 1 / ((K - 1) W) for sample counts; 0 below two batches.
    double scale(bool reliability = false) const;
};

struct Interval {
    double lower = 0, upper = 0;
    IntervalKind kind = IntervalKind::bounded;
};

/// One value, read out in double. `groups`: one Statistics for each group of batches. tau and the mean of t must not be 0.
/// An estimator that needs more than there is gives NaN: this reference falls back to nothing. `reliability`, here and
/// below: weights are not sample counts, as Statistics::scale.
double estimate(std::span<const Statistics> groups, Estimator estimator, double tau, bool reliability = false);
/// The standard error as combine() defines it: sqrt(M2 / ((K - 1) W)), the M2 of m for the mean, of m - mean(m / t) t for
/// Hartley and Ross, of m about its line on t for the regressions (K - 2 for K - 1), else of m - mean(m) / mean(t) t, times
/// tau / mean(t). The jackknife has one of its groups' pseudo-values. +inf below two batches (regressions: three), NaN for
/// the mean of ratios.
double standard_error(std::span<const Statistics> groups, Estimator estimator, double tau, bool reliability = false);
/// Of the ratio, to first order: (R Var(t) / t^2 - tau Cov / t^2) of the means.
double bias_of_ratio(const Statistics& all, double tau, bool reliability = false);
/// quantile: Student's or the normal's.
Interval delta_interval(const Statistics& all, double tau, double quantile, bool reliability = false);
Interval fieller_interval(const Statistics& all, double tau, double quantile, bool reliability = false);

/// Central moments of one sample relative to the means: C_jk = E[((m - mu) / mu)^j ((t - tau) / tau)^k].
struct RelativeMoments {
    double c20 = 0, c11 = 0, c02 = 0, c21 = 0, c12 = 0, c03 = 0;
};
/// Bias, variance and mean squared error of the ratio of N samples, relative to mu and mu^2, to O(1/N^2). Meaningless where
/// t has no third moment.
struct Expansion {
    double bias = 0, variance = 0, mse = 0;
};
Expansion expand_ratio(const RelativeMoments& moments, double samples);

}  // namespace clratio
