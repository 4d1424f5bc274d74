// From means to an estimate: tau m / t with the guards of eq. (10), the policies for a zero denominator, and flags.
#ifndef CLRATIO_DEVICE_RATIO_H
#define CLRATIO_DEVICE_RATIO_H

#include "clratio/device/portable.h"

CLR_NAMESPACE_BEGIN

// Flags of a value; a flag image holds their union.
#define CLR_FLAG_ZERO_DENOMINATOR 1u  // mean t was 0 although tau was not: the zero policy gave the value
#define CLR_FLAG_ZERO_TAU 2u          // tau was 0: the impulse guard of eq. (10) gave the value
#define CLR_FLAG_SKIPPED 4u           // a batch had a NaN or an infinity here and was left out
#define CLR_FLAG_NO_DATA 8u           // every batch was left out: the value is 0
#define CLR_FLAG_NO_ERROR_BAR 16u     // fewer than two batches: the standard error is +inf
#define CLR_FLAG_NONFINITE 32u        // the estimate itself is NaN or infinite
#define CLR_FLAG_BITS 6

// What stands in for tau m / t where the mean of t is 0.
#define CLR_ZERO_MC_MEAN 0u  // the plain mean of m
#define CLR_ZERO_ZERO 1u     // 0
#define CLR_ZERO_ONE 2u      // tau, as if the ratio were 1

typedef struct {
    clr_real value;
    clr_uint flags;
} clr_estimate;

// The impulse i(tau): 1 where tau == 0, else 0 (eq. 3).
CLR_FN clr_real clr_impulse(clr_real tau) { return tau == (clr_real)(0.0f) ? (clr_real)(1.0f) : (clr_real)(0.0f); }

CLR_FN clr_real clr_zero_value(clr_uint policy, clr_real tau, clr_real m) {
    const clr_real other = policy == (clr_uint)(CLR_ZERO_ONE) ? tau : (clr_real)(0.0f);
    return policy == (clr_uint)(CLR_ZERO_MC_MEAN) ? m : other;
}

// Eq. (10) for the means m and t: (tau + i) (m / (t + i)), the quotient first so that m == t gives tau exactly.
CLR_FN clr_estimate clr_ratio(clr_real m, clr_real t, clr_real tau, clr_uint zero_policy) {
    const clr_uint none = (clr_uint)(0u);
    const clr_real impulse = clr_impulse(tau);
    const clr_real denominator = t + impulse;
    const clr_mask empty = denominator == (clr_real)(0.0f);
    const clr_real quotient = m / (empty ? (clr_real)(1.0f) : denominator);
    clr_estimate e;
    e.value = empty ? clr_zero_value(zero_policy, tau, m) : (tau + impulse) * quotient;
    e.flags = (empty ? (clr_uint)(CLR_FLAG_ZERO_DENOMINATOR) : none) |
              (tau == (clr_real)(0.0f) ? (clr_uint)(CLR_FLAG_ZERO_TAU) : none) |
              (clr_is_finite(e.value) ? none : (clr_uint)(CLR_FLAG_NONFINITE));
    return e;
}

CLR_NAMESPACE_END

#endif
