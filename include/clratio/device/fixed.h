// Weighted sums of (m, t) and of their products in whole numbers: exact, so that no grouping and no order shows in them.
// A value x enters as the integer nearest to x 2^resolution, ties to even; every weight is an integer.
#ifndef CLRATIO_DEVICE_FIXED_H
#define CLRATIO_DEVICE_FIXED_H

#include "clratio/device/layout.h"
#include "clratio/device/limbs.h"
#include "clratio/device/moments.h"

CLR_NAMESPACE_BEGIN

typedef struct {
    clr_wide m, t;         // sums of w j, two's complement
    clr_limbs mm, tt, mt;  // sums of w j^2 and w j_m j_t
    clr_wide weight;
    clr_uint batches;
} clr_fixed;

// scale: 2^resolution; limit: 2^range, the largest magnitude that is taken.
typedef struct {
    float scale, limit;
    clr_u32 resolution, per_value;  // per_value: weight and batch count are planes
    clr_u64 stride, weight;
    clr_u32 batches, unused;
} clr_fixed_state;

typedef struct {
    clr_layout m, t;
} clr_fixed_batch;

#define CLR_FIXED_BATCHES_PER_LAUNCH 8

// The batches of a launch, all of one weight.
typedef struct {
    clr_fixed_batch of[CLR_FIXED_BATCHES_PER_LAUNCH];
    clr_u64 weight, count;
} clr_fixed_batches;

// A work-item's row of counters.
#define CLR_FIXED_TALLY_NEGATIVE 0
#define CLR_FIXED_TALLY_SKIPPED 1
#define CLR_FIXED_TALLY_OUTSIDE 2
#define CLR_FIXED_TALLY 3

CLR_FN clr_mask clr_fixed_takes(clr_real m, clr_real t, clr_real limit) {
    return clr_abs(m) <= limit && clr_abs(t) <= limit;
}

// The integer that stands for x, as high 2^24 + low; both have its sign, and 24 bits at most.
typedef struct {
    clr_uint low, high;
} clr_digits;

// Adding 2^23 rounds what has a fraction to the nearest integer, ties to even; larger floats are integers.
CLR_FN clr_digits clr_quantise(clr_real x, clr_real scale) {
    const clr_real whole_above = (clr_real)(0x1p23f);
    const clr_uint sign = clr_bits(x) & (clr_uint)(0x80000000u);
    const clr_real size = clr_abs(x) * scale;
    const clr_real rounded = size < whole_above ? (size + whole_above) - whole_above : size;
    const clr_real whole = clr_from_bits(clr_bits(rounded) | sign);
    const clr_int high = clr_to_int(whole * (clr_real)(0x1p-24f));
    clr_digits r;
    r.high = clr_to_uint(high);
    r.low = clr_to_uint(clr_to_int(clr_fma(clr_to_real(high), (clr_real)(-0x1p24f), whole)));
    return r;
}

// Sums of products of digits by their place, 1, 2^24 and 2^48. No carry is needed over CLR_FIXED_BATCHES_PER_LAUNCH.
typedef struct {
    clr_pairs low, middle, high;
} clr_columns;

CLR_FN clr_columns clr_columns_add(clr_columns s, clr_pairs a_low, clr_pairs a_high, clr_pairs b_low, clr_pairs b_high) {
    s.low += clr_signed_product(a_low, b_low);
    s.middle += clr_signed_product(a_low, b_high) + clr_signed_product(a_high, b_low);
    s.high += clr_signed_product(a_high, b_high);
    return s;
}

CLR_FN clr_columns clr_columns_zero(void) {
    clr_columns r;
    r.low = r.middle = r.high = (clr_pairs)(0u);
    return r;
}

// low + middle 2^24 + high 2^48 in limbs.
typedef struct {
    clr_pairs lo, hi;
} clr_column_limbs;

CLR_FN clr_column_limbs clr_columns_sum(clr_columns s) {
    const clr_pairs low = s.low + ((s.middle & (clr_pairs)(0xffffffu)) << 24);
    const clr_pairs high = s.high + clr_signed_shift(s.middle, 24) + clr_signed_shift(low, 48);
    clr_column_limbs r;
    r.lo = (low & (clr_pairs)(0xffffffffffffu)) | (high << 48);
    r.hi = clr_signed_shift(high, 16);
    return r;
}

// The even lanes' columns, and the odd lanes'.
typedef struct {
    clr_columns even, odd;
} clr_products;

CLR_FN clr_products clr_products_add(clr_products s, clr_digits a, clr_digits b) {
    s.even = clr_columns_add(s.even, clr_even_lanes(a.low), clr_even_lanes(a.high), clr_even_lanes(b.low),
                             clr_even_lanes(b.high));
    s.odd = clr_columns_add(s.odd, clr_odd_lanes(a.low), clr_odd_lanes(a.high), clr_odd_lanes(b.low), clr_odd_lanes(b.high));
    return s;
}

CLR_FN clr_limbs clr_products_sum(clr_products s) {
    const clr_column_limbs even = clr_columns_sum(s.even), odd = clr_columns_sum(s.odd);
    return clr_limbs_make(clr_interleave_wide(even.lo, odd.lo), clr_interleave_wide(even.hi, odd.hi));
}

// Up to CLR_FIXED_BATCHES_PER_LAUNCH batches of one weight, before it is applied.
typedef struct {
    clr_digits m, t;  // sums
    clr_products mm, tt, mt;
    clr_uint batches;
} clr_fixed_run;

CLR_FN clr_fixed_run clr_fixed_run_zero(void) {
    clr_fixed_run r;
    r.m.low = r.m.high = r.t.low = r.t.high = r.batches = (clr_uint)(0u);
    r.mm.even = r.mm.odd = r.tt.even = r.tt.odd = r.mt.even = r.mt.odd = clr_columns_zero();
    return r;
}

// One more batch; lanes that fixed point cannot hold stay as they are.
CLR_FN clr_fixed_run clr_fixed_take(clr_fixed_run s, clr_real m, clr_real t, clr_real scale, clr_real limit) {
    const clr_real zero = (clr_real)(0.0f);
    const clr_mask takes = clr_fixed_takes(m, t, limit);
    const clr_digits a = clr_quantise(takes ? m : zero, scale), b = clr_quantise(takes ? t : zero, scale);
    s.m.low += a.low;
    s.m.high += a.high;
    s.t.low += b.low;
    s.t.high += b.high;
    s.mm = clr_products_add(s.mm, a, a);
    s.tt = clr_products_add(s.tt, b, b);
    s.mt = clr_products_add(s.mt, a, b);
    s.batches += takes ? (clr_uint)(1u) : (clr_uint)(0u);
    return s;
}

CLR_FN clr_wide clr_wide_of_signed(clr_uint x) { return clr_to_wide(x) - (clr_to_wide(x >> 31) << 32); }

CLR_FN clr_wide clr_digits_sum(clr_digits x) { return clr_wide_of_signed(x.low) + (clr_wide_of_signed(x.high) << 24); }

CLR_FN clr_fixed clr_fixed_add(clr_fixed s, clr_fixed_run run, clr_u64 weight) {
    clr_limbs mm = clr_products_sum(run.mm), tt = clr_products_sum(run.tt), mt = clr_products_sum(run.mt);
    const clr_wide w = (clr_wide)(weight);
    if (weight != 1u) {
        mm = clr_limbs_multiply(mm, w);
        tt = clr_limbs_multiply(tt, w);
        mt = clr_limbs_multiply(mt, w);
    }
    s.m += clr_digits_sum(run.m) * w;
    s.t += clr_digits_sum(run.t) * w;
    s.mm = clr_limbs_add(s.mm, mm);
    s.tt = clr_limbs_add(s.tt, tt);
    s.mt = clr_limbs_add(s.mt, mt);
    s.weight += clr_to_wide(run.batches) * w;
    s.batches += run.batches;
    return s;
}

CLR_FN clr_fixed clr_fixed_merge(clr_fixed a, clr_fixed b) {
    a.m += b.m;
    a.t += b.t;
    a.mm = clr_limbs_add(a.mm, b.mm);
    a.tt = clr_limbs_add(a.tt, b.tt);
    a.mt = clr_limbs_add(a.mt, b.mt);
    a.weight += b.weight;
    a.batches += b.batches;
    return a;
}

// (-1)^sign size / divisor 2^exponent as two floats: hi the nearest float, lo the one nearest to what hi leaves, ties to
// even; a lo below 2^-126 is 0.
CLR_FN clr_two clr_fixed_quotient(clr_limbs size, clr_wide sign, clr_wide divisor, clr_wide exponent) {
    const clr_wide zero = (clr_wide)(0u), one = (clr_wide)(1u);
    const clr_wide none = (size.lo | size.hi) == zero ? one : zero;
    const clr_quotient_digits hi = clr_quotient_nearest(clr_limbs_make(size.lo | none, size.hi), divisor);
    const clr_wide rest_sign = clr_wide_sign(hi.rest.hi);
    clr_limbs rest = clr_limbs_negate(hi.rest, rest_sign);
    const clr_wide exact = (rest.lo | rest.hi) == zero ? one : zero;
    rest.lo |= exact;
    const clr_quotient_digits lo = clr_quotient_nearest(rest, divisor);
    const clr_wide rest_exponent = hi.exponent & clr_wide_sign(hi.exponent);
    return clr_two_make(
        clr_real_of_digits(hi.digits & (none - one), hi.exponent + exponent, sign),
        clr_real_of_digits(lo.digits & ((none | exact) - one), lo.exponent + rest_exponent + exponent, sign ^ rest_sign));
}

// The exact weight, below 2^48, as two floats.
CLR_FN clr_two clr_fixed_weight(clr_wide weight) {
    const clr_real high = clr_to_real(weight >> 24) * (clr_real)(16777216.0f);
    return clr_two_quick_sum(high, clr_to_real(weight & (clr_wide)(0xffffffu)));
}

// W sum(w a b) - sum(w a) sum(w b), exact, over W: the second moment about the means.
CLR_FN clr_two clr_fixed_second(clr_limbs products, clr_wide a, clr_wide b, clr_wide weight, clr_wide exponent) {
    const clr_limbs sum = clr_limbs_subtract(clr_limbs_multiply(products, weight), clr_limbs_signed_product(a, b));
    const clr_wide sign = clr_wide_sign(sum.hi);
    return clr_fixed_quotient(clr_limbs_negate(sum, sign), sign, weight, exponent);
}

CLR_FN clr_two clr_fixed_mean(clr_wide sum, clr_wide weight, clr_wide exponent) {
    const clr_wide sign = clr_wide_sign(sum);
    return clr_fixed_quotient(clr_limbs_make(clr_wide_negate(sum, sign), (clr_wide)(0u)), sign, weight, exponent);
}

// Each number is the exact one, rounded once to two floats. All are 0 where the weight is.
CLR_FN clr_moments clr_fixed_moments(clr_fixed s, clr_u32 resolution) {
    const clr_wide weight = s.weight == (clr_wide)(0u) ? (clr_wide)(1u) : s.weight;
    const clr_wide once = (clr_wide)(0u) - (clr_wide)(resolution), twice = once + once;
    clr_moments r;
    r.m = clr_fixed_mean(s.m, weight, once);
    r.t = clr_fixed_mean(s.t, weight, once);
    r.mm = clr_fixed_second(s.mm, s.m, s.m, weight, twice);
    r.tt = clr_fixed_second(s.tt, s.t, s.t, weight, twice);
    r.mt = clr_fixed_second(s.mt, s.m, s.t, weight, twice);
    return r;
}

CLR_NAMESPACE_END

#endif
