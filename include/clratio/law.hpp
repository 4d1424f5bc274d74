// The law that errors of an estimator follow: densities, probabilities and what they say about a model.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "clratio/device/law.h"
#include "clratio/engine.hpp"
#include "clratio/error.hpp"
#include "clratio/view.hpp"

namespace clratio {

enum class Law {
    exact,           ///< the ratio estimator's, with correlation: Hinkley 1969, which eq. (16) with its Jacobian gives
    published,       ///< eq. (22) as the supplement prints it: no correlation, and for sigma_t > 0 no finite integral
    mc,              ///< the plain mean's: N(0, sigma_m^2 / n), eq. (23)
    integral,        ///< eq. (17) by quadrature, a check of eq. (22)
    exact_integral,  ///< eq. (16) with the missing factor |psi + i| / |tau + i|, by quadrature, a check of `exact`
};

/// One law of one model, on the host in double.
///
/// Units: x those of m; densities one over those. Cost: a few hundred nanoseconds a value, integrals a few microseconds.
/// Accuracy: exact, published and mc: density 1e-12 relative (5e-12 where |log density| > 100), probability 1e-14 and,
/// in both tails, 1e-12 relative. The integrals: 1e-11 relative.
/// Edge cases: sigma_t = 0 is the normal law. rho = +-1 is handled. sigma_m and mu with no residual at all
/// (m proportional to t) are a point mass: density +inf at 0 and else 0, a step for a cdf. x = +-inf is allowed, NaN
/// stays NaN. The published law and its integral have no cdf, sf, quantile, median or bias for sigma_t > 0: NaN.
/// Errors: InvalidArgument for what canonical() refuses, and for integrals of a model with |rho| = 1 or sigma_m = 0.
/// Determinism: a pure function. Safe to share between threads.
class ErrorLaw {
public:
    ErrorLaw(Law law, const ErrorModel& model);

    double pdf(double x) const;
    double log_pdf(double x) const;
    double cdf(double x) const;
    double sf(double x) const;  ///< 1 - cdf, accurate in the upper tail
    /// x with cdf(x) = p within a few ulp of x; p = 0 and 1 give -inf and +inf, of a point mass 0 as all p do.
    /// InvalidArgument outside [0, 1].
    double quantile(double p) const;

    double median() const { return quantile(0.5); }
    /// Local maxima of the density within 10^10 standard deviations, the highest first, each within 1e-7 of its size
    /// or of the standard deviation. Where |a| is a few times b the exact law has a second one, of a mass below
    /// Phi(-1 / s): that of denominators of the wrong sign.
    std::vector<double> modes() const;
    /// lim x^2 f(x), the same on both sides; P(X > x) ~ tail_constant() / x. 0 for a normal law.
    /// +inf for the published law: its tails are those of 1 / |x|.
    double tail_constant() const;
    /// The principal value of E X (E X itself does not exist for sigma_t > 0): -s a (1 + 3 s^2 + 15 s^4 + ..), which is
    /// what simulations see as bias.
    double bias() const;
    /// sqrt(a^2 + b^2): the standard deviation of the residual, to first order that of the error.
    double scale() const { return sd_; }

    /// Probabilities of x < edges[0], of each [edges[i], edges[i+1]), and of x >= the last edge; they sum to 1 within 1e-12.
    /// Accuracy: 1e-16 + 1e-12 of the tail from the bin outwards. The published law and its integral are given the exact
    /// law's two outer probabilities, and are scaled to what remains: the best case for them.
    /// Errors: InvalidArgument for fewer than two edges, or edges not finite and ascending.
    std::vector<double> bin_probabilities(std::span<const double> edges) const;
    /// The same for `count` bins of equal width on [lo, hi). Errors: InvalidArgument for count 0, or lo, hi not finite and
    /// ascending.
    std::vector<double> bin_probabilities(double lo, double hi, std::uint32_t count) const;

    Law law() const { return law_; }
    const ErrorModel& model() const { return model_; }
    /// What kernels read. Errors: InvalidArgument where float overflows, and for the two integrals.
    device::clr_law device_form() const;

    /// Averages of the density over `count` bins of equal width on [lo, hi): of the published law as it stands, unscaled.
    /// Errors as above.
    std::vector<double> bin_densities(double lo, double hi, std::uint32_t count) const;

private:
    bool integral() const { return law_ == Law::integral || law_ == Law::exact_integral; }
    bool improper() const;  ///< no finite integral
    bool left(double x) const;
    double tail(double x) const;
    double tail_quantile(double probability, double sign) const;
    std::vector<double> integrals(std::span<const double> edges) const;
    std::vector<double> improper_masses(std::span<const double> edges) const;

    Law law_;
    ErrorModel model_;
    Canonical canonical_;
    double sd_;
    device::clr_law_double terms_;
};

/// Densities and probabilities on the device, in float.
///
/// Shapes: `points` values of x for `models.size()` models: x holds either `points` values, the same for every model, or
/// points * models.size(), those of model 0 first; out holds points * models.size() values in that order. One x for each
/// of many models (a model for each pixel) is points = 1. What is not divisible is refused.
/// Units, edge cases, NaN: as ErrorLaw. The published law has a density only: InvalidArgument for its cdf and sf where
/// sigma_t > 0. The integrals are for the host: InvalidArgument.
/// Accuracy: density 5e-7 of the peak, cdf and sf 2e-7, log density 1e-6 (1 + |log f|), for |x| below 10^18 scale(), where
/// s <= 6 and |a| <= 6 b (canonical()); beyond, those times s / 6 or |a| / (6 b), whichever is more.
/// Cost: 8 bytes a value moved, 20 bytes a model.
/// Determinism: the same bits as the host twin of device/law.h, at every width and work size.
/// Errors: InvalidArgument before anything is enqueued.
void law_pdf(const Engine& engine, Law law, std::span<const ErrorModel> models, std::span<const float> x,
             std::span<float> out);
void law_log_pdf(const Engine& engine, Law law, std::span<const ErrorModel> models, std::span<const float> x,
                 std::span<float> out);
void law_cdf(const Engine& engine, Law law, std::span<const ErrorModel> models, std::span<const float> x,
             std::span<float> out);
void law_sf(const Engine& engine, Law law, std::span<const ErrorModel> models, std::span<const float> x,
            std::span<float> out);

/// Event form: enqueues and returns; the caller releases the event. The models are copied before it returns.
cl_event law_pdf(const Engine& engine, Law law, std::span<const ErrorModel> models, View x, View out,
                 std::span<const cl_event> wait_list = {});
cl_event law_log_pdf(const Engine& engine, Law law, std::span<const ErrorModel> models, View x, View out,
                     std::span<const cl_event> wait_list = {});
cl_event law_cdf(const Engine& engine, Law law, std::span<const ErrorModel> models, View x, View out,
                 std::span<const cl_event> wait_list = {});
cl_event law_sf(const Engine& engine, Law law, std::span<const ErrorModel> models, View x, View out,
                std::span<const cl_event> wait_list = {});

}  // namespace clratio
