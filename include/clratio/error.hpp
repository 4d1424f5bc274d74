// The error of an estimator, estimate minus truth, as the supplement models it in eq. (14).
#pragma once

#include <cstdint>
#include <span>

#include "clratio/device/canonical.h"
#include "clratio/stream.hpp"

namespace clratio {

/// (M, T) are bivariate normal, the means of n samples each: M ~ N(mu, sigma_m^2 / n), T ~ N(tau, sigma_t^2 / n),
/// correlation rho. The ratio estimator's error is X = (tau + i) M / (T + i) - mu, i = 1 where tau == 0 and else 0 (eqs. 3,
/// 14). Units: mu and sigma_m those of m, tau and sigma_t those of t, sigmas for one sample, rho and n without. Ranges: all
/// finite, sigma_m >= 0, sigma_t >= 0, |rho| <= 1, n >= 1; checked by canonical() and all that take a model. Source:
/// supplement section 3, which has rho = 0.
struct ErrorModel {
    double mu = 0, tau = 1, sigma_m = 0, sigma_t = 0;
    double rho = 0;
    std::uint64_t n = 1;
};

/// X = (a Z2 + b Z1) / (1 + s Z2) with independent standard normals Z1, Z2.
using Canonical = device::clr_canonical_double;

/// With c = tau + i:  s = sigma_t / (|c| sqrt n),  a = (sign(c) rho sigma_m - mu sigma_t / |c|) / sqrt n,
/// b = sigma_m sqrt(1 - rho^2) / sqrt n; each within a few ulp, a also where its terms cancel.
/// Errors: InvalidArgument names the parameter that is NaN, infinite or out of range, and an s or a that overflows.
Canonical canonical(const ErrorModel& model);

/// The Monte Carlo estimator's error M - mu, a normal: s = a = 0, b = sigma_m / sqrt n. Errors as above.
Canonical monte_carlo_canonical(const ErrorModel& model);

/// Rounded to float for kernels. Errors: InvalidArgument where float overflows.
device::clr_canonical to_float(const Canonical& c);

/// Error samples first, first + 1, .. of a law: canonical(model) or monte_carlo_canonical(model). Sample i is made of normal
/// draws 2 i (Z1) and 2 i + 1 (Z2) of the stream in the domain `error`, whatever stream.domain says; the double forms use
/// normal_double draws. Units: those of m. A sample is infinite, or NaN, where its denominator 1 + s Z2 is 0. Error bound:
/// the quantiles' (stream.hpp) and five roundings. Errors: InvalidArgument for a law, stream, range or view out of range,
/// and doubles without fp64. Cost: the bytes of out. Determinism: the same bits at every width, work size and split, and on
/// the host (error_sample). Source: supplement eq. (14).
void error_samples(const Engine& engine, const Canonical& law, const Stream& stream, std::uint64_t first,
                   std::span<float> out);
void error_samples(const Engine& engine, const Canonical& law, const Stream& stream, std::uint64_t first,
                   std::span<double> out);

/// The same to device memory: enqueued after wait_list, nothing waits; the caller releases the event.
cl_event error_samples(const Engine& engine, const Canonical& law, const Stream& stream, std::uint64_t first, View out,
                       std::span<const cl_event> wait_list = {});
cl_event error_samples_double(const Engine& engine, const Canonical& law, const Stream& stream, std::uint64_t first,
                              View out, std::span<const cl_event> wait_list = {});

/// Sample `index` alone, on the host.
float error_sample(const Canonical& law, const Stream& stream, std::uint64_t index);
double error_sample_double(const Canonical& law, const Stream& stream, std::uint64_t index);

}  // namespace clratio
