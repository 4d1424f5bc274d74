// Two-float arithmetic: a value is hi + lo, |lo| <= ulp(hi)/2, about 48 bits. Needs no fp64.
// Error-free transformations of Knuth, Dekker and Ogita-Rump-Oishi; every fma is written out.
// Infinite or NaN parts make the result NaN. Products need |x y| > 2^-102 for an exact error term.
#ifndef CLRATIO_DEVICE_TWOFLOAT_H
#define CLRATIO_DEVICE_TWOFLOAT_H

#include "clratio/device/portable.h"

CLR_NAMESPACE_BEGIN

typedef struct {
    clr_real hi, lo;
} clr_two;

CLR_FN clr_two clr_two_make(clr_real hi, clr_real lo) {
    clr_two r;
    r.hi = hi;
    r.lo = lo;
    return r;
}

// a + b exactly, where |a| >= |b| or a == 0.
CLR_FN clr_two clr_two_quick_sum(clr_real a, clr_real b) {
    const clr_real s = a + b;
    return clr_two_make(s, b - (s - a));
}

// a + b exactly.
CLR_FN clr_two clr_two_sum(clr_real a, clr_real b) {
    const clr_real s = a + b;
    const clr_real v = s - a;
    return clr_two_make(s, (a - (s - v)) + (b - v));
}

// a - b exactly.
CLR_FN clr_two clr_two_difference(clr_real a, clr_real b) {
    const clr_real s = a - b;
    const clr_real v = s - a;
    return clr_two_make(s, (a - (s - v)) - (b + v));
}

// a * b exactly.
CLR_FN clr_two clr_two_product(clr_real a, clr_real b) {
    const clr_real p = a * b;
    return clr_two_make(p, clr_fma(a, b, -p));
}

// x + y, rounding error below 2^-46 (|x| + |y|).
CLR_FN clr_two clr_two_add(clr_two x, clr_two y) {
    const clr_two s = clr_two_sum(x.hi, y.hi);
    return clr_two_quick_sum(s.hi, s.lo + (x.lo + y.lo));
}

// x - y, likewise.
CLR_FN clr_two clr_two_subtract(clr_two x, clr_two y) {
    const clr_two s = clr_two_difference(x.hi, y.hi);
    return clr_two_quick_sum(s.hi, s.lo + (x.lo - y.lo));
}

// Loose pairs: hi need not be the nearest float of the sum, and lo may be many of its ulps. They are what a long sum can
// afford.

// x + y as a loose pair, where x may be one: rounding error below 2^-24 of the new lo.
CLR_FN clr_two clr_two_gather(clr_two x, clr_two y) {
    const clr_two s = clr_two_sum(x.hi, y.hi);
    return clr_two_make(s.hi, x.lo + (s.lo + y.lo));
}

// A loose pair made tight again.
CLR_FN clr_two clr_two_settle(clr_two x) { return clr_two_quick_sum(x.hi, x.lo); }

// a - y as a loose pair, for a plain a: rounding error below 2^-24 of the new lo.
CLR_FN clr_two clr_two_distance(clr_real a, clr_two y) {
    const clr_two s = clr_two_difference(a, y.hi);
    return clr_two_make(s.hi, s.lo - y.lo);
}

// x - y as a loose pair, where both may be: rounding error below 2^-24 of the new lo.
CLR_FN clr_two clr_two_apart(clr_two x, clr_two y) {
    const clr_two s = clr_two_difference(x.hi, y.hi);
    return clr_two_make(s.hi, s.lo + (x.lo - y.lo));
}

// x - y in float, where both may be loose: where they are close, the difference of their hi parts is exact.
CLR_FN clr_real clr_two_gap(clr_two x, clr_two y) { return (x.hi - y.hi) + (x.lo - y.lo); }

// The nearest float of a loose pair.
CLR_FN clr_real clr_two_nearest(clr_two x) { return x.hi + x.lo; }

// x * y as a loose pair; x and y may be loose: rounding error below 2^-24 of the new lo.
CLR_FN clr_two clr_two_multiply(clr_two x, clr_two y) {
    const clr_two p = clr_two_product(x.hi, y.hi);
    return clr_two_make(p.hi, clr_fma(x.lo, y.lo, clr_fma(x.hi, y.lo, clr_fma(x.lo, y.hi, p.lo))));
}

// The same for a tight y: x.lo y.lo is then below what rounding lo costs.
CLR_FN clr_two clr_two_times(clr_two x, clr_two y) {
    const clr_two p = clr_two_product(x.hi, y.hi);
    return clr_two_make(p.hi, clr_fma(x.lo, y.hi, clr_fma(x.hi, y.lo, p.lo)));
}

// The same for a plain y.
CLR_FN clr_two clr_two_scale(clr_two x, clr_real y) {
    const clr_two p = clr_two_product(x.hi, y);
    return clr_two_make(p.hi, clr_fma(x.lo, y, p.lo));
}

// a * b, rounded, where its sum with something must not become one fma: compilers that contract leave an fma alone.
CLR_FN clr_real clr_rounded_product(clr_real a, clr_real b) { return clr_fma(a, b, (clr_real)(-0.0f)); }

// x + a b as a loose pair, of loose pairs, for sums whose parts seldom have opposite signs: 5 roundings, each below 2^-24 of
// the parts of the new lo. The first fma may round an exact product, not a float: where a.hi b.hi takes away more than half
// of x.hi, 2^-24 of x.hi is lost.
CLR_FN clr_two clr_two_gather_product(clr_two x, clr_two a, clr_two b) {
    const clr_real s = clr_fma(a.hi, b.hi, x.hi), v = s - x.hi;
    const clr_real rest = clr_fma(a.lo, b.hi, clr_fma(a.hi, b.hi, -v));
    return clr_two_make(s, (x.lo + (x.hi - (s - v))) + clr_fma(clr_two_nearest(a), b.lo, rest));
}

// x + a b as a loose pair for a tight b, of any signs: 5 such roundings. What rounding a.hi b.hi loses and what its sum with
// x.hi does are one fma together: two operations less than the sum of x and a product.
CLR_FN clr_two clr_two_gather_times(clr_two x, clr_two a, clr_two b) {
    const clr_real s = x.hi + clr_rounded_product(a.hi, b.hi), v = s - x.hi;
    const clr_real rest = clr_fma(a.lo, b.hi, clr_fma(a.hi, b.hi, -v));
    return clr_two_make(s, (x.lo + (x.hi - (s - v))) + clr_fma(a.hi, b.lo, rest));
}

// x^2, tight.
CLR_FN clr_two clr_two_square(clr_two x) { return clr_two_settle(clr_two_multiply(x, x)); }

// x / y, relative error below 2^-43; y.hi != 0.
CLR_FN clr_two clr_two_divide(clr_two x, clr_two y) {
    const clr_real q = x.hi / y.hi;
    const clr_real remainder = clr_fma(-q, y.hi, x.hi) + clr_fma(-q, y.lo, x.lo);
    return clr_two_quick_sum(q, remainder / y.hi);
}

CLR_NAMESPACE_END

#endif
