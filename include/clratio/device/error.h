// Samples of the error of an estimator, eq. (14), from four-word blocks: sample i of a float stream is made of its words 2 i
// (z1) and 2 i + 1 (z2), sample i of a double stream of its words 4 i, 4 i + 1 (z1) and 4 i + 2, 4 i + 3 (z2).
#ifndef CLRATIO_DEVICE_ERROR_H
#define CLRATIO_DEVICE_ERROR_H

#include "clratio/device/canonical.h"
#include "clratio/device/quantile.h"

CLR_NAMESPACE_BEGIN

// X = (a z2 + b z1) / (1 + s z2) with z = n / d for both, multiplied out: one division. Infinite where the denominator is 0.
CLR_FN clr_real clr_error_sample(clr_canonical law, clr_uint word1, clr_uint word2) {
    const clr_fraction z1 = clr_normal_fraction(word1), z2 = clr_normal_fraction(word2);
    const clr_real residual = clr_fma((clr_real)(law.a), z2.n * z1.d, (clr_real)(law.b) * (z1.n * z2.d));
    return residual / (z1.d * clr_fma((clr_real)(law.s), z2.n, z2.d));
}

#if CLR_FP64
CLR_FN clr_double clr_error_sample_double(clr_canonical_double law, clr_uint low1, clr_uint high1, clr_uint low2,
                                          clr_uint high2) {
    const clr_fraction_double z1 = clr_normal_fraction_double(low1, high1), z2 = clr_normal_fraction_double(low2, high2);
    const clr_double residual = clr_fma((clr_double)(law.a), z2.n * z1.d, (clr_double)(law.b) * (z1.n * z2.d));
    return residual / (z1.d * clr_fma((clr_double)(law.s), z2.n, z2.d));
}
#endif

CLR_NAMESPACE_END

#endif
