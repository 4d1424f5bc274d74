// Integers of 128 bits in two 64-bit limbs, two's complement, and their exact quotients as floats. Needs no fp64.
#ifndef CLRATIO_DEVICE_LIMBS_H
#define CLRATIO_DEVICE_LIMBS_H

#include "clratio/device/portable.h"

CLR_NAMESPACE_BEGIN

typedef struct {
    clr_wide lo, hi;
} clr_limbs;

CLR_FN clr_limbs clr_limbs_make(clr_wide lo, clr_wide hi) {
    clr_limbs r;
    r.lo = lo;
    r.hi = hi;
    return r;
}

// All ones where x is negative, else 0.
CLR_FN clr_wide clr_wide_sign(clr_wide x) { return (clr_wide)(0u) - (x >> 63); }

// -x where sign is all ones, x where it is 0.
CLR_FN clr_wide clr_wide_negate(clr_wide x, clr_wide sign) { return (x ^ sign) - sign; }

CLR_FN clr_limbs clr_limbs_add(clr_limbs a, clr_limbs b) {
    const clr_wide lo = a.lo + b.lo;
    const clr_wide carry = lo < a.lo ? (clr_wide)(1u) : (clr_wide)(0u);
    return clr_limbs_make(lo, a.hi + b.hi + carry);
}

CLR_FN clr_limbs clr_limbs_subtract(clr_limbs a, clr_limbs b) {
    const clr_wide borrow = a.lo < b.lo ? (clr_wide)(1u) : (clr_wide)(0u);
    return clr_limbs_make(a.lo - b.lo, a.hi - b.hi - borrow);
}

CLR_FN clr_limbs clr_limbs_negate(clr_limbs x, clr_wide sign) {
    const clr_wide lo = clr_wide_negate(x.lo, sign);
    const clr_wide carry = lo == (clr_wide)(0u) ? sign & (clr_wide)(1u) : (clr_wide)(0u);
    return clr_limbs_make(lo, (x.hi ^ sign) + carry);
}

// Of two numbers without a sign.
CLR_FN clr_limbs clr_limbs_product(clr_wide a, clr_wide b) {
    const clr_wide word = (clr_wide)(0xffffffffu);
    const clr_wide a0 = a & word, a1 = a >> 32, b0 = b & word, b1 = b >> 32;
    const clr_wide low = a0 * b0, left = a1 * b0, right = a0 * b1;
    const clr_wide middle = (low >> 32) + (left & word) + (right & word);
    return clr_limbs_make((low & word) | (middle << 32), a1 * b1 + (left >> 32) + (right >> 32) + (middle >> 32));
}

// Of two numbers with a sign.
CLR_FN clr_limbs clr_limbs_signed_product(clr_wide a, clr_wide b) {
    const clr_wide sa = clr_wide_sign(a), sb = clr_wide_sign(b);
    return clr_limbs_negate(clr_limbs_product(clr_wide_negate(a, sa), clr_wide_negate(b, sb)), sa ^ sb);
}

// x * factor modulo 2^128.
CLR_FN clr_limbs clr_limbs_multiply(clr_limbs x, clr_wide factor) {
    const clr_limbs low = clr_limbs_product(x.lo, factor);
    return clr_limbs_make(low.lo, low.hi + x.hi * factor);
}

// x * 2^by modulo 2^128, by < 128.
CLR_FN clr_limbs clr_limbs_shift(clr_limbs x, clr_wide by) {
    const clr_wide zero = (clr_wide)(0u), limb = (clr_wide)(64u), in_limb = by & (clr_wide)(63u);
    const clr_wide lo = by < limb ? x.lo : zero, hi = by < limb ? x.hi : x.lo;
    return clr_limbs_make(lo << in_limb, (hi << in_limb) | ((lo >> 1) >> ((clr_wide)(63u) - in_limb)));
}

// The place of the highest bit of x > 0. With no two neighbouring bits at the top, the conversion cannot round up to the
// next power of two.
CLR_FN clr_wide clr_wide_log2(clr_wide x) {
    return clr_to_wide(clr_bits(clr_to_real(x & ~(x >> 1))) >> 23) - (clr_wide)(127u);
}

CLR_FN clr_wide clr_limbs_log2(clr_limbs x) {
    const clr_wide none = (clr_wide)(0u);
    return clr_wide_log2(x.hi == none ? x.lo : x.hi) + (x.hi == none ? none : (clr_wide)(64u));
}

// numerator / divisor as digits 2^exponent, the nearest such number with 24 bits (or 2^24), ties to even. What it leaves is
// rest / divisor 2^min(exponent, 0). exponent and rest have signs.
typedef struct {
    clr_wide digits, exponent;
    clr_limbs rest;
} clr_quotient_digits;

// One step of division: takes a divisor's multiple out of the rest where it goes in.
CLR_FN clr_quotient_digits clr_quotient_step(clr_quotient_digits q, clr_limbs divisor, clr_u32 times_log2) {
    const clr_wide zero = (clr_wide)(0u);
    const clr_limbs less = clr_limbs_subtract(q.rest, clr_limbs_shift(divisor, (clr_wide)(times_log2)));
    const clr_wide fits = ~clr_wide_sign(less.hi);
    q.rest.lo = fits == zero ? q.rest.lo : less.lo;
    q.rest.hi = fits == zero ? q.rest.hi : less.hi;
    q.digits += fits & ((clr_wide)(1u) << times_log2);
    return q;
}

// 0 < numerator < 2^127, 0 < divisor < 2^63. Float arithmetic only guesses, within 7 of the true digits even where a
// division is off by 2.5 ulp; from 8 below, the exact rest decides. So no device's rounding enters.
CLR_FN clr_quotient_digits clr_quotient_nearest(clr_limbs numerator, clr_wide divisor) {
    const clr_wide zero = (clr_wide)(0u), one = (clr_wide)(1u);
    const clr_wide top = clr_limbs_log2(numerator), divisor_top = clr_wide_log2(divisor);
    const clr_wide n = clr_limbs_shift(numerator, (clr_wide)(127u) - top).hi;
    const clr_wide d = divisor << ((clr_wide)(63u) - divisor_top);
    const clr_wide below = n < d ? one : zero;
    clr_quotient_digits q;
    q.exponent = top - divisor_top - below - (clr_wide)(23u);
    const clr_wide down = clr_wide_sign(q.exponent);
    const clr_wide up = q.exponent & ~down;
    const clr_real guess = clr_to_real(n) / clr_to_real(d) * (clr_to_real(below + one) * (clr_real)(0x1p23f));
    q.digits = clr_to_wide(guess) - (clr_wide)(8u);
    const clr_limbs unit = clr_limbs_shift(clr_limbs_make(divisor, zero), up);
    q.rest = clr_limbs_subtract(clr_limbs_shift(numerator, (zero - q.exponent) & down),
                                clr_limbs_shift(clr_limbs_product(q.digits, divisor), up));
    q = clr_quotient_step(q, unit, 3u);
    q = clr_quotient_step(q, unit, 2u);
    q = clr_quotient_step(q, unit, 1u);
    q = clr_quotient_step(q, unit, 0u);
    const clr_limbs over = clr_limbs_subtract(unit, clr_limbs_shift(q.rest, one));
    const clr_wide tie = (over.lo | over.hi) == zero ? q.digits & one : zero;
    const clr_wide round = clr_wide_sign(over.hi) | (zero - tie);
    q.rest = clr_limbs_subtract(q.rest, clr_limbs_make(unit.lo & round, unit.hi & round));
    q.digits -= round;
    return q;
}

// digits 2^exponent with a sign, for digits up to 2^24; 0 where that is below 2^-126.
CLR_FN clr_real clr_real_of_digits(clr_wide digits, clr_wide exponent, clr_wide sign) {
    const clr_wide biased = exponent + (clr_wide)(150u);
    const clr_wide normal = ~clr_wide_sign(biased - (clr_wide)(1u));
    const clr_real power = clr_from_bits(clr_to_uint(biased & normal) << 23);
    const clr_real value = clr_to_real(digits) * (clr_real)(0x1p-23f) * power;
    return clr_from_bits(clr_bits(value) | (clr_to_uint(sign) & (clr_uint)(0x80000000u)));
}

CLR_NAMESPACE_END

#endif
