// The law's integrals by quadrature over the denominator, from the model's own numbers: nothing here knows the closed forms.
#pragma once

#include "clratio/error.hpp"

namespace clratio {

/// Eq. (17) with its correlation 0.
double published_integral(const ErrorModel& model, double x);
/// Eq. (16) with the Jacobian, any correlation.
double exact_integral(const ErrorModel& model, double x);
double exact_integral_cdf(const ErrorModel& model, double x);

}  // namespace clratio
