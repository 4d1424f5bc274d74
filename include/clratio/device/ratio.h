// Eq. (10), tau m / t with its guard i(tau), the policies for a zero denominator, and the flags of a value.
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
#define CLR_FLAG_FELL_BACK 64u   // too few batches or groups, or others that do not vary: the ratio or the mean stands in
#define CLR_FLAG_NO_SPREAD 128u  // the error bar is 0: the batches agree exactly, which says nothing of the next one
#define CLR_FLAG_BITS 8

// What stands in for tau m / t where the mean of t is 0.
#define CLR_ZERO_MC_MEAN 0u  // the plain mean of m
#define CLR_ZERO_ZERO 1u     // 0
#define CLR_ZERO_ONE 2u      // tau, as if the ratio were 1

CLR_FN clr_uint clr_flag_if(clr_mask m, clr_u32 flag) { return m ? (clr_uint)(flag) : (clr_uint)(0u); }

CLR_FN clr_uint clr_flag_unless_finite(clr_real x) {
    return clr_is_finite(x) ? (clr_uint)(0u) : (clr_uint)(CLR_FLAG_NONFINITE);
}

// The impulse i(tau): 1 where tau == 0, else 0 (eq. 3).
CLR_FN clr_real clr_impulse(clr_real tau) { return tau == (clr_real)(0.0f) ? (clr_real)(1.0f) : (clr_real)(0.0f); }

CLR_FN clr_real clr_zero_value(clr_u32 policy, clr_real tau, clr_real m) {
    if (policy == CLR_ZERO_MC_MEAN) return m;
    return policy == CLR_ZERO_ONE ? tau : (clr_real)(0.0f);
}

// Eq. (10): (tau + i) (m / (t + i)), the quotient first so that equal means give tau exactly. m / t is within 2^-44 of
// itself, 1 where m = t, and 0 where t is 0. `scale` keeps the reciprocal of the smallest means finite.
typedef struct {
    clr_two quotient;
    clr_real control, denominator, value;  // tau + i; t + i, 1 where that is 0
    clr_real inverse;                      // 1 / denominator
    clr_mask empty;                        // t + i is 0
} clr_quotient;

CLR_FN clr_quotient clr_divide_means(clr_two m, clr_two t, clr_real tau, clr_u32 zero_policy) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f), impulse = clr_impulse(tau);
    const clr_two sum = clr_two_sum(t.hi, impulse);
    const clr_mask empty = sum.hi == zero;
    const clr_two denominator = clr_two_make(empty ? one : sum.hi, sum.lo + t.lo);
    const clr_real scale = clr_abs(denominator.hi) < (clr_real)(0x1p-100f) ? (clr_real)(0x1p100f) : one;
    const clr_real inverse = one / (denominator.hi * scale);
    clr_quotient q;
    q.empty = empty;
    const clr_real first = m.hi / denominator.hi;
    const clr_real rest = clr_fma(-first, denominator.hi, m.hi) + clr_fma(-first, denominator.lo, m.lo);
    q.quotient = clr_two_make(empty ? zero : first, empty ? zero : (rest * scale) * inverse);
    q.control = tau + impulse;
    q.denominator = denominator.hi;
    q.inverse = inverse * scale;
    const clr_two product = clr_two_product(q.control, q.quotient.hi);
    q.value = empty ? clr_zero_value(zero_policy, tau, m.hi) : product.hi + clr_fma(q.control, q.quotient.lo, product.lo);
    return q;
}

CLR_FN clr_uint clr_quotient_flags(clr_quotient q, clr_real tau) {
    return clr_flag_if(q.empty, CLR_FLAG_ZERO_DENOMINATOR) | clr_flag_if(tau == (clr_real)(0.0f), CLR_FLAG_ZERO_TAU);
}

// The ratio of two means that come without a history, in float: within 1.5 ulp of eq. (10), where the two-float quotient is
// within 0.5. Equal means give tau exactly, and 0 <= m <= t stays in [0, tau]. One division: twice as fast in cache.
typedef struct {
    clr_real value;
    clr_uint flags;
} clr_plain_ratio;

CLR_FN clr_plain_ratio clr_read_means(clr_real m, clr_real t, clr_real tau, clr_u32 zero_policy) {
    const clr_real zero = (clr_real)(0.0f), impulse = clr_impulse(tau), denominator = t + impulse;
    const clr_mask empty = denominator == zero;
    const clr_real quotient = m / (empty ? (clr_real)(1.0f) : denominator);
    clr_plain_ratio r;
    r.value = empty ? clr_zero_value(zero_policy, tau, m) : (tau + impulse) * quotient;
    r.flags = clr_flag_if(empty, CLR_FLAG_ZERO_DENOMINATOR) | clr_flag_if(tau == zero, CLR_FLAG_ZERO_TAU) |
              clr_flag_unless_finite(r.value);
    return r;
}

CLR_NAMESPACE_END

#endif
