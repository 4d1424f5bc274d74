// exp, log and erfc from + - * / and fma alone, so that every device and the host give the same bits.
// Minimax fits of our own; the worst errors stated here are asserted over bit patterns in tests/law_test.cpp.
// C++ adds double overloads, which are the standard library's.
#ifndef CLRATIO_DEVICE_EXPONENTIAL_H
#define CLRATIO_DEVICE_EXPONENTIAL_H

#include "clratio/device/portable.h"

CLR_NAMESPACE_BEGIN

// ln 2 = high + low; high has 9 bits, so n * high is exact.
#define CLR_LN2_HIGH 0.693359375f
#define CLR_LN2_LOW -2.12194440e-4f

// 2^n for -126 <= n <= 127.
CLR_FN clr_real clr_power_of_two(clr_int n) { return clr_from_bits(clr_to_uint(n + 127) << 23); }

// e^x within 1.1 ulp; subnormal below -87.4 (2 ulp of the least subnormal), 0 below -104, +inf above 88.73; NaN stays.
CLR_FN clr_real clr_exp(clr_real x) {
    const clr_real low = (clr_real)(-105.0f), high = (clr_real)(89.0f);
    const clr_real above = x < low ? low : x;
    const clr_real below = above > high ? high : above;
    const clr_real c = x == x ? below : (clr_real)(0.0f);
    const clr_real n = clr_floor(clr_fma(c, (clr_real)(1.44269504f), (clr_real)(0.5f)));
    const clr_real r = clr_fma(-n, (clr_real)(CLR_LN2_LOW), clr_fma(-n, (clr_real)(CLR_LN2_HIGH), c));
    clr_real p = (clr_real)(1.3863727e-3f);
    p = clr_fma(p, r, (clr_real)(8.367542e-3f));
    p = clr_fma(p, r, (clr_real)(4.166724e-2f));
    p = clr_fma(p, r, (clr_real)(1.6666533e-1f));
    p = clr_fma(p, r, (clr_real)(0.5f));
    const clr_real y = clr_fma(p, r * r, r) + (clr_real)(1.0f);
    const clr_int k = clr_to_int(n);
    const clr_int half_k = k >> 1;
    const clr_real scaled = y * clr_power_of_two(half_k) * clr_power_of_two(k - half_k);
    return x == x ? scaled : x;
}

// (log(1 + f) - f + f^2 / 2) / f^3 for 1 + f in [sqrt(1/2), sqrt(2)].
CLR_FN clr_real clr_log_polynomial(clr_real f) {
    clr_real p = (clr_real)(-7.634499e-2f);
    p = clr_fma(p, f, (clr_real)(1.2761578e-1f));
    p = clr_fma(p, f, (clr_real)(-1.3160183e-1f));
    p = clr_fma(p, f, (clr_real)(1.4201757e-1f));
    p = clr_fma(p, f, (clr_real)(-1.6623357e-1f));
    p = clr_fma(p, f, (clr_real)(2.0001227e-1f));
    p = clr_fma(p, f, (clr_real)(-2.500082e-1f));
    p = clr_fma(p, f, (clr_real)(3.333333e-1f));
    return p;
}

// The natural logarithm within 1.1 ulp, subnormals included; -inf at 0, NaN below, +inf at +inf; NaN stays.
CLR_FN clr_real clr_log(clr_real x) {
    const clr_real one = (clr_real)(1.0f), infinity = (clr_real)(INFINITY);
    const clr_mask subnormal = x < (clr_real)(1.17549435e-38f);
    const clr_uint bits = clr_bits(subnormal ? x * (clr_real)(16777216.0f) : x);
    const clr_real exponent = clr_to_real(clr_to_int(bits >> 23)) - (subnormal ? (clr_real)(150.0f) : (clr_real)(126.0f));
    const clr_real m = clr_from_bits((bits & (clr_uint)(0x007fffffu)) | (clr_uint)(0x3f000000u));
    const clr_mask low_half = m < (clr_real)(0.707106781f);
    const clr_real f = (low_half ? m + m : m) - one;
    const clr_real e = low_half ? exponent - one : exponent;
    const clr_real p = clr_log_polynomial(f);
    const clr_real f2 = f * f;
    const clr_real tail = clr_fma(e, (clr_real)(CLR_LN2_LOW), clr_fma(f2 * f, p, (clr_real)(-0.5f) * f2));
    const clr_real y = clr_fma(e, (clr_real)(CLR_LN2_HIGH), f + tail);
    const clr_real positive = x < infinity ? y : x;
    return x > (clr_real)(0.0f) ? positive : x == (clr_real)(0.0f) ? -infinity : (clr_real)(NAN);
}

// erfc(x) for x >= 0, relative error below 6e-7 down to 1e-37; 0 from 10.3 on; NaN stays.
// exp(-x^2) with the rounding of x^2 put back, times (1 + 2 x) exp(x^2) erfc(x) fitted in (x - 2) / (x + 2).
CLR_FN clr_real clr_erfc(clr_real x) {
    const clr_real two = (clr_real)(2.0f), one = (clr_real)(1.0f), high = (clr_real)(10.3f);
    const clr_real c = x > high ? high : x;
    const clr_real u = (c - two) / (c + two);
    clr_real p = (clr_real)(-3.9944454e-4f);
    p = clr_fma(p, u, (clr_real)(-1.2279949e-3f));
    p = clr_fma(p, u, (clr_real)(1.313307e-3f));
    p = clr_fma(p, u, (clr_real)(8.63009e-3f));
    p = clr_fma(p, u, (clr_real)(-8.060142e-3f));
    p = clr_fma(p, u, (clr_real)(-5.4203883e-2f));
    p = clr_fma(p, u, (clr_real)(1.6405542e-1f));
    p = clr_fma(p, u, (clr_real)(-1.6603146e-1f));
    p = clr_fma(p, u, (clr_real)(-9.276398e-2f));
    p = clr_fma(p, u, (clr_real)(1.2769784f));
    const clr_real square = c * c;
    const clr_real rest = clr_fma(c, c, -square);
    const clr_real gauss = clr_exp(-square);
    return clr_fma(-gauss, rest, gauss) * (p / clr_fma(two, c, one));
}

#if !defined(__OPENCL_C_VERSION__)
inline double clr_exp(double x) { return std::exp(x); }
inline double clr_log(double x) { return std::log(x); }
inline double clr_erfc(double x) { return std::erfc(x); }
#endif

CLR_NAMESPACE_END

#endif
