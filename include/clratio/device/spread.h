// How a value's batches scatter: about their means, about the ratio, and about the regression line. M2 is a sum of squares
// about the mean. Estimators and error bars take it in float; what could cancel was subtracted in two-float before.
#ifndef CLRATIO_DEVICE_SPREAD_H
#define CLRATIO_DEVICE_SPREAD_H

#include "clratio/device/moments.h"
#include "clratio/device/ratio.h"

CLR_NAMESPACE_BEGIN

// M2 of the residual m - r t, and its sum of products with t.
typedef struct {
    clr_real mm, mt;
} clr_residual;

typedef struct {
    clr_real mm, tt, mt;
    clr_residual ratio;
    clr_real line;  // M2 of m about its regression on t
} clr_spread;

CLR_FN clr_spread clr_spread_none(void) {
    clr_spread d;
    d.mm = d.tt = d.mt = d.ratio.mm = d.ratio.mt = d.line = (clr_real)(0.0f);
    return d;
}

CLR_FN clr_residual clr_residual_of(clr_moments s, clr_two r) {
    const clr_two twice = clr_two_make(s.mt.hi + s.mt.hi, s.mt.lo + s.mt.lo), part = clr_two_multiply(r, s.tt);
    clr_residual d;
    d.mm = clr_two_gap(s.mm, clr_two_multiply(r, clr_two_apart(twice, part)));
    d.mt = clr_two_gap(s.mt, part);
    return d;
}

// Of m on t; 0 where t does not vary, NaN where either sum is out of range.
CLR_FN clr_real clr_slope_of_regression(clr_real mt, clr_real tt) {
    const clr_real zero = (clr_real)(0.0f);
    return tt <= zero ? zero : mt / tt;
}

// Of second moments about the ratio what is less than this part of m's and r t's own is rounding, and counts as 0.
#define CLR_LEAST_RESIDUAL 0x1p-40f

CLR_FN clr_residual clr_without_noise(clr_residual d, clr_real mm, clr_real tt, clr_real r) {
    const clr_real part = clr_fma(r, r * tt, mm) * (clr_real)(CLR_LEAST_RESIDUAL);
    d.mm = d.mm <= part ? (clr_real)(0.0f) : d.mm;
    return d;
}

// M2 about the line of this slope. It is least for the regression's own: a slope rounded to float costs 2^-48 of mm.
CLR_FN clr_real clr_line_residual(clr_moments s, clr_real slope) {
    const clr_real zero = (clr_real)(0.0f), rest = clr_residual_of(s, clr_two_make(slope, zero)).mm;
    return rest > zero ? rest : rest * zero;
}

CLR_FN clr_spread clr_spread_of(clr_moments s, clr_two ratio) {
    clr_spread d;
    d.mm = s.mm.hi;
    d.tt = s.tt.hi;
    d.mt = s.mt.hi;
    d.ratio = clr_without_noise(clr_residual_of(s, ratio), d.mm, d.tt, ratio.hi);
    d.line = clr_line_residual(s, clr_slope_of_regression(d.mt, d.tt));
    return d;
}

CLR_NAMESPACE_END

#endif
