// Do counts, or values, follow a law? Three tests with p-values that are usable from both sides.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace clratio {

class ErrorLaw;
struct Histogram;

/// What a test found. p is the probability of a statistic at least as large under the law, q = 1 - p without cancellation:
/// a p near 0 rejects the law, a q near 0 says that the counts agree too well to be independent draws.
struct Fit {
    double statistic = 0;
    double p = 1, q = 0;
    std::uint64_t n = 0;      ///< draws
    std::uint64_t cells = 0;  ///< chi-square: cells after pooling; dof is one less
    std::uint64_t dof = 0;

    /// p and q both above alpha.
    bool accepted(double alpha = 1e-6) const { return p > alpha && q > alpha; }
};

/// Pearson's chi-square. Shapes: counts and probabilities of the same cells, in order, outer ones (underflow, overflow)
/// included, so that the probabilities sum to 1 (within 1e-9). Neighbouring cells are pooled until each expects at least
/// `least_expected` draws. No degree of freedom is taken off: the law's parameters are known.
/// Errors: InvalidArgument for other shapes, probabilities that are NaN, negative or of another sum, no draws or 2^64 of
/// them, a least_expected that is not above 0, and fewer than two cells after pooling. Accuracy of p and q: 1e-12 relative,
/// above 1e-300. Source: Pearson 1900; p from the regularised incomplete gamma functions.
Fit chi_square(std::span<const std::uint64_t> counts, std::span<const double> probabilities, double least_expected = 25);

/// Kolmogorov and Smirnov's largest distance between distribution functions, at the cells' edges only. The statistic is D.
/// Conservative for that reason: p is an upper bound, and a q near 0 says nothing. Input and errors as chi_square, without
/// pooling. Source: Kolmogorov 1933, with Stephens' correction for finite n.
Fit kolmogorov_smirnov(std::span<const std::uint64_t> counts, std::span<const double> probabilities);

/// The cells of a histogram in order: underflow, the bins, overflow; what ErrorLaw::bin_probabilities() has probabilities
/// for.
std::vector<std::uint64_t> cells(const Histogram& histogram);

/// The tests above for a histogram, against law.bin_probabilities(histogram.edges()). NaN are in no cell and have
/// no probability: where there are any, the statistic is infinite and p = 0. Errors as above.
Fit chi_square(const Histogram& histogram, const ErrorLaw& law, double least_expected = 25);
Fit kolmogorov_smirnov(const Histogram& histogram, const ErrorLaw& law);

/// Anderson and Darling's A^2 for values whose cdf and sf under the law are given (both, so that neither tail loses digits),
/// in any order. p and q are those of the limiting law, 1e-13 absolute; at n = 100 it is 0.001 off.
/// Cost: a sorted copy. Errors: InvalidArgument for spans of different or zero length, or values outside [0, 1],
/// or a cdf and an sf whose sum is off 1 by more than 1e-3. A value of probability 0 gives an infinite statistic and p = 0.
/// Source: Anderson and Darling 1952.
Fit anderson_darling(std::span<const double> cdf, std::span<const double> sf);

}  // namespace clratio
