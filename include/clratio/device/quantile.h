// From hashed words to uniform and standard normal numbers. All maps are open (0, 1, -inf and +inf never come out) and
// symmetric: the complement ~h of a word gives 1 - u and -z, exactly.
#ifndef CLRATIO_DEVICE_QUANTILE_H
#define CLRATIO_DEVICE_QUANTILE_H

#include "clratio/device/portable.h"

CLR_NAMESPACE_BEGIN

// (2 (h >> 9) + 1) 2^-24, exact: the midpoints of 2^23 cells, from 2^-24 to 1 - 2^-24.
CLR_FN clr_real clr_uniform(clr_uint h) {
    const clr_uint odd = ((h >> 9) << 1) | (clr_uint)(1u);
    return clr_to_real(clr_to_int(odd)) * (clr_real)(0x1p-24f);
}

// A standard normal quantile z = n / d, not yet divided, so that a formula of several normals needs one division.
typedef struct {
    clr_real n, d;
} clr_fraction;

// -log of u 2^-64, for 2^-64 <= u <= 2^64; absolute error below 2.5e-7 + 2^-23 of the result. The bits of u, read as an
// integer, are 2^23 (exponent + mantissa - 1): a piecewise linear log2. What is left of the log, log(2) (m - 1) - log m for
// a mantissa m in [1, 2), is small: a minimax polynomial of degree 7 in m - 3/2, 1.9e-7 from the truth. Measured on PoCL
// with AVX-512: 1.04 times the error samples of one that splits off the exponent.
CLR_FN clr_real clr_minus_log_scaled(clr_real u) {
    const clr_uint bits = clr_bits(u);
    const clr_real linear = clr_to_real(clr_to_int((clr_uint)((127u + 64u) << 23) - bits));
    const clr_real g = clr_from_bits((bits & (clr_uint)(0x007fffffu)) | (clr_uint)(0x3f800000u)) - (clr_real)(1.5f);
    clr_real rest = (clr_real)(-0x1.578afap-7f);
    rest = clr_fma(rest, g, (clr_real)(0x1.1d506cp-6f));
    rest = clr_fma(rest, g, (clr_real)(-0x1.a7b9fep-6f));
    rest = clr_fma(rest, g, (clr_real)(0x1.90d388p-5f));
    rest = clr_fma(rest, g, (clr_real)(-0x1.94b470p-4f));
    rest = clr_fma(rest, g, (clr_real)(0x1.c72898p-3f));
    rest = clr_fma(rest, g, (clr_real)(0x1.b1df26p-6f));
    rest = clr_fma(rest, g, (clr_real)(-0x1.e270dap-5f));
    return clr_fma(linear, (clr_real)(0.69314718f * 0x1p-23f), rest);
}

// The standard normal quantile at the midpoint (h + 1/2) 2^-32: with the tail probability p = k 2^-33 <= 1/2, k = 2 j + 1,
// x = 1 - 2 p (each rounded once) and w = -log(4 p (1 - p)), |z| = x N(w) / D(w). Odd; |z| from 2.9e-10 to 6.338.
// At most 8 ulp and 6e-7 relative after the division. The coefficients are a minimax fit in w, N's scaled by 2^-32.
CLR_FN clr_fraction clr_normal_fraction(clr_uint h) {
    const clr_uint upper_half = (clr_uint)(0u) - (h >> 31);
    const clr_uint twice_j = (h ^ upper_half) << 1;
    const clr_real p = clr_to_real(twice_j | (clr_uint)(1u));
    const clr_real x = clr_to_real(~twice_j);  // 2^32 - k
    const clr_real w = clr_minus_log_scaled(p * ((clr_real)(0x1p33f) - p));
    clr_real n = (clr_real)(0x1.9a375cp-55f);
    n = clr_fma(n, w, (clr_real)(0x1.f15ec8p-47f));
    n = clr_fma(n, w, (clr_real)(0x1.2a3ef2p-42f));
    n = clr_fma(n, w, (clr_real)(0x1.9a4af0p-39f));
    n = clr_fma(n, w, (clr_real)(0x1.74b766p-36f));
    n = clr_fma(n, w, (clr_real)(0x1.ca2b34p-34f));
    n = clr_fma(n, w, (clr_real)(0x1.40d932p-32f));
    clr_real d = (clr_real)(0x1.f56f24p-19f);
    d = clr_fma(d, w, (clr_real)(0x1.046adcp-12f));
    d = clr_fma(d, w, (clr_real)(0x1.2eeb74p-9f));
    d = clr_fma(d, w, (clr_real)(0x1.1bda8ap-5f));
    d = clr_fma(d, w, (clr_real)(0x1.85ee80p-4f));
    clr_fraction z;
    z.n = clr_from_bits(clr_bits(x * n) ^ (~h & (clr_uint)(0x80000000u)));
    z.d = clr_fma(d, w, (clr_real)(1.0f));
    return z;
}

CLR_FN clr_real clr_normal(clr_uint h) {
    const clr_fraction z = clr_normal_fraction(h);
    return z.n / z.d;
}

#if CLR_FP64

// (2 (h >> 12) + 1) 2^-53, exact, h = high word * 2^32 + low word: from 2^-53 to 1 - 2^-53.
CLR_FN clr_double clr_uniform_double(clr_uint low, clr_uint high) {
    const clr_wide h = clr_to_wide(high) << 32 | clr_to_wide(low);
    return clr_to_double((h >> 12) << 1 | (clr_wide)(1u)) * (clr_double)(0x1p-53);
}

typedef struct {
    clr_double n, d;
} clr_fraction_double;

// -log p for normal 0 < p <= 1, within 1e-15 relative for p <= 1/2: p = m 2^-e, sqrt(1/2) < m <= sqrt(2), and
// log m = 2 atanh s = 2 s (1 + s^2 / 3 + s^4 / 5 + ...), s = (m - 1) / (m + 1), |s| < 0.172.
CLR_FN clr_double clr_minus_log_double(clr_double p) {
    const clr_wide bits = clr_double_bits(p);
    const clr_wide e = ((clr_wide)(0x3ff6a09e667f3bcdUL) - bits) >> 52;
    const clr_double m = clr_double_from_bits(bits + (e << 52));
    const clr_double s = (m - (clr_double)(1.0)) / (m + (clr_double)(1.0));
    const clr_double z = s * s;
    clr_double q = (clr_double)(1.0 / 23.0);
    q = clr_fma(q, z, (clr_double)(1.0 / 21.0));
    q = clr_fma(q, z, (clr_double)(1.0 / 19.0));
    q = clr_fma(q, z, (clr_double)(1.0 / 17.0));
    q = clr_fma(q, z, (clr_double)(1.0 / 15.0));
    q = clr_fma(q, z, (clr_double)(1.0 / 13.0));
    q = clr_fma(q, z, (clr_double)(1.0 / 11.0));
    q = clr_fma(q, z, (clr_double)(1.0 / 9.0));
    q = clr_fma(q, z, (clr_double)(1.0 / 7.0));
    q = clr_fma(q, z, (clr_double)(1.0 / 5.0));
    q = clr_fma(q, z, (clr_double)(1.0 / 3.0));
    const clr_double log_m = (clr_double)(2.0) * clr_fma(s * z, q, s);
    return clr_fma(clr_to_double(e), (clr_double)(0.69314718055994531), -log_m);
}

#define CLR_HORNER_7(r, c7, c6, c5, c4, c3, c2, c1, c0)                                                                     \
    clr_fma(clr_fma(clr_fma(clr_fma(clr_fma(clr_fma(clr_fma((clr_double)(c7), r, (clr_double)(c6)), r, (clr_double)(c5)),   \
                                            r, (clr_double)(c4)),                                                           \
                                    r, (clr_double)(c3)),                                                                   \
                            r, (clr_double)(c2)),                                                                           \
                    r, (clr_double)(c1)),                                                                                   \
            r, (clr_double)(c0))

// |z|, not yet divided, for a tail probability 0 < p <= 1/2 and q = 1/2 - p, each given so that neither loses digits; within
// 2e-15 relative, p down to 1e-300. sqrt(1/2) |z| is erfcinv(2 p), and erfinv(2 q). Source: Wichura, Algorithm AS 241,
// PPND16 (Applied Statistics 37, 1988): q A / B for q <= 0.425, else C / D or E / F in r = sqrt(-log p).
CLR_FN clr_fraction_double clr_normal_magnitude_double(clr_double p, clr_double q) {
    const clr_double centre = (clr_double)(0.180625) - q * q;
    const clr_double r = clr_sqrt(clr_minus_log_double(p));
    const clr_double tail = r - (clr_double)(1.6), far = r - (clr_double)(5.0);
    const clr_double a = CLR_HORNER_7(centre, 2.5090809287301226727e3, 3.3430575583588128105e4, 6.7265770927008700853e4,
                                      4.5921953931549871457e4, 1.3731693765509461125e4, 1.9715909503065514427e3,
                                      1.3314166789178437745e2, 3.3871328727963666080);
    const clr_double b = CLR_HORNER_7(centre, 5.2264952788528545610e3, 2.8729085735721942674e4, 3.9307895800092710610e4,
                                      2.1213794301586595867e4, 5.3941960214247511077e3, 6.8718700749205790830e2,
                                      4.2313330701600911252e1, 1.0);
    const clr_double c = CLR_HORNER_7(tail, 7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1,
                                      1.27045825245236838258, 3.64784832476320460504, 5.76949722146069140550,
                                      4.63033784615654529590, 1.42343711074968357734);
    const clr_double d = CLR_HORNER_7(tail, 1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2,
                                      1.48103976427480074590e-1, 6.89767334985100004550e-1, 1.67638483018380384940,
                                      2.05319162663775882187, 1.0);
    const clr_double e = CLR_HORNER_7(far, 2.01033439929228813265e-7, 2.71155556874348757815e-5, 1.24266094738807843860e-3,
                                      2.65321895265761230930e-2, 2.96560571828504891230e-1, 1.78482653991729133580,
                                      5.46378491116411436990, 6.65790464350110377720);
    const clr_double f = CLR_HORNER_7(far, 2.04426310338993978564e-15, 1.42151175831644588870e-7, 1.84631831751005468180e-5,
                                      7.86869131145613259100e-4, 1.48753612908506148525e-2, 1.36929880922735805310e-1,
                                      5.99832206555887937690e-1, 1.0);
    const clr_double_mask is_centre = q <= (clr_double)(0.425), is_tail = r <= (clr_double)(5.0);
    clr_fraction_double z;
    z.n = is_centre ? q * a : (is_tail ? c : e);
    z.d = is_centre ? b : (is_tail ? d : f);
    return z;
}

// The quantile at (h + 1/2) 2^-64 of two words: p = (2 j + 1) 2^-65 <= 1/2; |z| from 6.8e-20 to 9.155.
CLR_FN clr_fraction_double clr_normal_fraction_double(clr_uint low, clr_uint high) {
    const clr_wide h = clr_to_wide(high) << 32 | clr_to_wide(low);
    const clr_wide upper_half = (clr_wide)(0u) - (h >> 63);
    const clr_wide k = (h ^ upper_half) << 1 | (clr_wide)(1u);
    const clr_double p = clr_to_double(k) * (clr_double)(0x1p-65);
    clr_fraction_double z = clr_normal_magnitude_double(p, clr_to_double((clr_wide)(0u) - k) * (clr_double)(0x1p-65));
    z.n = clr_double_from_bits(clr_double_bits(z.n) ^ (~h & (clr_wide)(0x8000000000000000UL)));
    return z;
}

CLR_FN clr_double clr_normal_double(clr_uint low, clr_uint high) {
    const clr_fraction_double z = clr_normal_fraction_double(low, high);
    return z.n / z.d;
}

#endif

CLR_NAMESPACE_END

#endif
