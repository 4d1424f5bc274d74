// From means to an estimate: tau m / t with the guard of eq. (10), policies for a zero denominator, error bars and flags.
#ifndef CLRATIO_DEVICE_RATIO_H
#define CLRATIO_DEVICE_RATIO_H

#include "clratio/device/moments.h"

CLR_NAMESPACE_BEGIN

// Flags of a value; a flag image holds their union.
#define CLR_FLAG_ZERO_DENOMINATOR 1u  // mean t was 0 although tau was not: the zero policy gave the value
#define CLR_FLAG_ZERO_TAU 2u          // tau was 0: the impulse guard of eq. (10) gave the value
#define CLR_FLAG_SKIPPED 4u           // a batch had a NaN or an infinity here and was left out
#define CLR_FLAG_NO_DATA 8u           // every batch was left out: the value is 0
#define CLR_FLAG_NO_ERROR_BAR 16u     // the standard error is +inf: fewer than two batches, or a zero policy's constant
#define CLR_FLAG_NONFINITE 32u        // the estimate itself is NaN or infinite
#define CLR_FLAG_BITS 6

// What stands in for tau m / t where the mean of t is 0.
#define CLR_ZERO_MC_MEAN 0u  // the plain mean of m
#define CLR_ZERO_ZERO 1u     // 0
#define CLR_ZERO_ONE 2u      // tau, as if the ratio were 1

#define CLR_ESTIMATOR_RATIO 0u
#define CLR_ESTIMATOR_MEAN 1u
#define CLR_ESTIMATOR_MEAN_OF_RATIOS 2u

typedef struct {
    clr_real value, error;
    clr_uint flags;
} clr_estimate;

// What the batches weigh: their number K and the sum W of their sample counts.
typedef struct {
    clr_uint batches;
    clr_real weight;
} clr_evidence;

CLR_FN clr_uint clr_flag_if(clr_mask m, clr_u32 flag) { return m ? (clr_uint)(flag) : (clr_uint)(0u); }

// The impulse i(tau): 1 where tau == 0, else 0 (eq. 3).
CLR_FN clr_real clr_impulse(clr_real tau) { return tau == (clr_real)(0.0f) ? (clr_real)(1.0f) : (clr_real)(0.0f); }

CLR_FN clr_real clr_zero_value(clr_u32 policy, clr_real tau, clr_real m) {
    if (policy == CLR_ZERO_MC_MEAN) return m;
    return policy == CLR_ZERO_ONE ? tau : (clr_real)(0.0f);
}

// +inf for K < 2, else 0.
CLR_FN clr_real clr_error_if_few(clr_evidence n) {
    return n.batches < (clr_uint)(2u) ? (clr_real)(INFINITY) : (clr_real)(0.0f);
}

// sqrt(sum / ((K - 1) W)), the standard error of a mean of batches whose weights are sample counts, for K > 1.
CLR_FN clr_real clr_error_of_mean(clr_real sum, clr_evidence n) {
    const clr_mask few = n.batches < (clr_uint)(2u);
    const clr_real freedom = clr_to_real(few ? (clr_uint)(1u) : n.batches - (clr_uint)(1u));
    const clr_real weight = few ? (clr_real)(1.0f) : n.weight;
    return clr_sqrt((sum > (clr_real)(0.0f) ? sum : sum * (clr_real)(0.0f)) / (freedom * weight));
}

// M2 of the residual m - r t.
CLR_FN clr_real clr_residual(clr_moments s, clr_two r) {
    const clr_two twice = clr_two_make(s.mt.hi + s.mt.hi, s.mt.lo + s.mt.lo);
    const clr_two inner = clr_two_subtract(twice, clr_two_multiply(r, s.tt));
    const clr_two sum = clr_two_subtract(s.mm, clr_two_multiply(r, inner));
    return sum.hi;
}

// Eq. (10): (tau + i) (m / (t + i)), the quotient first so that equal means give tau exactly.
typedef struct {
    clr_two quotient;
    clr_real control, denominator, value;
    clr_mask empty;
} clr_quotient;

CLR_FN clr_quotient clr_divide_means(clr_two m, clr_two t, clr_real tau, clr_u32 zero_policy) {
    const clr_real impulse = clr_impulse(tau);
    clr_two denominator = clr_two_add(t, clr_two_make(impulse, (clr_real)(0.0f)));
    clr_quotient q;
    q.empty = denominator.hi == (clr_real)(0.0f);
    denominator.hi = q.empty ? (clr_real)(1.0f) : denominator.hi;
    q.quotient = clr_two_divide(m, denominator);
    q.control = tau + impulse;
    q.denominator = denominator.hi;
    const clr_two product = clr_two_product(q.control, q.quotient.hi);
    q.value = q.empty ? clr_zero_value(zero_policy, tau, m.hi) : product.hi + clr_fma(q.control, q.quotient.lo, product.lo);
    return q;
}

CLR_FN clr_uint clr_quotient_flags(clr_quotient q, clr_real tau) {
    return clr_flag_if(q.empty, CLR_FLAG_ZERO_DENOMINATOR) | clr_flag_if(tau == (clr_real)(0.0f), CLR_FLAG_ZERO_TAU);
}

CLR_FN clr_estimate clr_ratio_of_means(clr_moments s, clr_evidence n, clr_real tau, clr_u32 zero_policy, bool with_error) {
    const clr_real infinite = (clr_real)(INFINITY), one = (clr_real)(1.0f);
    const clr_quotient q = clr_divide_means(s.m, s.t, tau, zero_policy);
    clr_estimate e;
    e.value = q.value;
    e.error = zero_policy == CLR_ZERO_MC_MEAN ? clr_error_if_few(n) : (q.empty ? infinite : clr_error_if_few(n));
    if (with_error) {
        const clr_real slope = q.empty ? one : clr_abs(q.control / q.denominator);
        e.error += slope * clr_error_of_mean(q.empty ? s.mm.hi : clr_residual(s, q.quotient), n);
    }
    e.flags = clr_quotient_flags(q, tau);
    return e;
}

CLR_FN clr_estimate clr_plain_mean(clr_moments s, clr_evidence n) {
    clr_estimate e;
    e.value = s.m.hi;
    e.error = clr_error_if_few(n) + clr_error_of_mean(s.mm.hi, n);
    e.flags = (clr_uint)(0u);
    return e;
}

// Eq. (5), tau mean(m / t), with the zero policy for each batch; the plain mean where tau == 0. It has no error bar.
CLR_FN clr_estimate clr_mean_of_ratios(clr_moments s, clr_ratios q, clr_real tau, clr_u32 zero_policy) {
    const clr_mask no_tau = tau == (clr_real)(0.0f);
    const clr_mask some_empty = q.zero_share.hi != (clr_real)(0.0f);
    const clr_real stand_in =
        zero_policy == CLR_ZERO_ONE ? tau * q.zero_share.hi : clr_zero_value(zero_policy, tau, q.zero_m.hi);
    const clr_real sum = clr_fma(tau, q.quotient.hi, stand_in);
    clr_estimate e;
    e.value = no_tau ? s.m.hi : sum;
    e.error = (clr_real)(INFINITY);
    e.flags = clr_flag_if(no_tau, CLR_FLAG_ZERO_TAU) |
              (no_tau ? (clr_uint)(0u) : clr_flag_if(some_empty, CLR_FLAG_ZERO_DENOMINATOR));
    return e;
}

// The ratio of two means that come without a history: no error bar is known, and none is flagged as missing.
CLR_FN clr_estimate clr_read_means(clr_real m, clr_real t, clr_real tau, clr_u32 zero_policy) {
    const clr_real zero = (clr_real)(0.0f);
    const clr_quotient q = clr_divide_means(clr_two_make(m, zero), clr_two_make(t, zero), tau, zero_policy);
    clr_estimate e;
    e.value = q.value;
    e.error = (clr_real)(INFINITY);
    e.flags = clr_quotient_flags(q, tau) | (clr_is_finite(e.value) ? (clr_uint)(0u) : (clr_uint)(CLR_FLAG_NONFINITE));
    return e;
}

// Any of the estimators, with all flags; `added` is the number of batches that were offered to the state. Without with_error
// the error is only told to be finite or infinite.
CLR_FN clr_estimate clr_read_out(clr_moments s, clr_ratios q, clr_evidence n, clr_u32 added, clr_real tau, clr_u32 estimator,
                                 clr_u32 zero_policy, bool with_error) {
    s = clr_moments_settle(s);
    clr_estimate e;
    if (estimator == CLR_ESTIMATOR_MEAN)
        e = clr_plain_mean(s, n);
    else if (estimator == CLR_ESTIMATOR_MEAN_OF_RATIOS)
        e = clr_mean_of_ratios(s, q, tau, zero_policy);
    else
        e = clr_ratio_of_means(s, n, tau, zero_policy, with_error);
    const clr_mask no_data = n.batches == (clr_uint)(0u);
    e.value = no_data ? (clr_real)(0.0f) : e.value;
    e.flags = (no_data ? (clr_uint)(0u) : e.flags) | clr_flag_if(no_data, CLR_FLAG_NO_DATA) |
              clr_flag_if(n.batches < (clr_uint)(added), CLR_FLAG_SKIPPED) |
              clr_flag_if(e.error == (clr_real)(INFINITY), CLR_FLAG_NO_ERROR_BAR) |
              (clr_is_finite(e.value) ? (clr_uint)(0u) : (clr_uint)(CLR_FLAG_NONFINITE));
    return e;
}

CLR_NAMESPACE_END

#endif
