// Weighted means and second moments of (m, t), batch by batch, all in two-float (Welford and Chan in difference form).
#ifndef CLRATIO_DEVICE_MOMENTS_H
#define CLRATIO_DEVICE_MOMENTS_H

#include "clratio/device/twofloat.h"

CLR_NAMESPACE_BEGIN

typedef struct {
    clr_two m, t;        // means
    clr_two mm, tt, mt;  // sums of w (m - mean)^2, w (t - mean)^2, w (m - mean)(t - mean)
} clr_moments;

// Finished ratios, for estimators that average them: means over all batches of m/t where t != 0, of m where t == 0,
// and the share of the weight where t == 0.
typedef struct {
    clr_two quotient, zero_m, zero_share;
} clr_ratios;

// How a batch of weight w enters a state of weight W.
typedef struct {
    clr_two share;    // w / (W + w)
    clr_real spread;  // W w / (W + w): mm, tt and mt share its rounding, which is a weight's, below 2^-24 of it
} clr_entry;

CLR_FN clr_entry clr_entry_make(clr_two weight, clr_two added, clr_two sum) {
    clr_entry e;
    const clr_mask none = sum.hi == (clr_real)(0.0f);
    const clr_two divisor = clr_two_make(none ? (clr_real)(1.0f) : sum.hi, sum.lo);
    e.share = clr_two_divide(added, divisor);
    e.spread = clr_two_nearest(clr_two_multiply(weight, e.share));
    return e;
}

// Sums stay loose pairs over this many batches of a state, and are settled after, for 3 operations more.
#define CLR_BATCHES_BETWEEN_SETTLING 8u

// Whether batch number `index`, counted from 0 over the life of the state, is one that settles.
CLR_FN bool clr_settles(clr_u32 index) { return (index + 1u) % CLR_BATCHES_BETWEEN_SETTLING == 0u; }

CLR_FN clr_moments clr_moments_none(void) {
    const clr_real zero = (clr_real)(0.0f);
    clr_moments s;
    s.m = s.t = s.mm = s.tt = s.mt = clr_two_make(zero, zero);
    return s;
}

CLR_FN clr_moments clr_moments_settle(clr_moments s) {
    s.m = clr_two_settle(s.m);
    s.t = clr_two_settle(s.t);
    s.mm = clr_two_settle(s.mm);
    s.tt = clr_two_settle(s.tt);
    s.mt = clr_two_settle(s.mt);
    return s;
}

// Moves the means by dm, dt times their share, and adds the second moments that two parts gain by standing that far apart.
// Only mt can take away from its sum and lose by it. Batches that do add 4 |r um dt| or more to the M2 of the residual
// m - r t, so that all such losses together are below 2^-24 of it.
CLR_FN clr_moments clr_moments_move(clr_moments s, clr_two dm, clr_two dt, clr_entry e) {
    const clr_two um = clr_two_scale(dm, e.spread);
    const clr_two ut = clr_two_scale(dt, e.spread);
    s.mm = clr_two_gather_product(s.mm, um, dm);
    s.tt = clr_two_gather_product(s.tt, ut, dt);
    s.mt = clr_two_gather_product(s.mt, um, dt);
    s.m = clr_two_gather_times(s.m, dm, e.share);
    s.t = clr_two_gather_times(s.t, dt, e.share);
    return s;
}

// Batch number `index` of the state.
CLR_FN clr_moments clr_moments_add(clr_moments s, clr_real m, clr_real t, clr_entry e, clr_u32 index) {
    s = clr_moments_move(s, clr_two_distance(m, s.m), clr_two_distance(t, s.t), e);
    if (clr_settles(index)) s = clr_moments_settle(s);
    return s;
}

// Chan, Golub, LeVeque 1979: b's batches as if they had been added after a's.
CLR_FN clr_moments clr_moments_merge(clr_moments a, clr_moments b, clr_entry e) {
    a.mm = clr_two_gather(a.mm, b.mm);
    a.tt = clr_two_gather(a.tt, b.tt);
    a.mt = clr_two_gather(a.mt, b.mt);
    return clr_moments_settle(clr_moments_move(a, clr_two_apart(b.m, a.m), clr_two_apart(b.t, a.t), e));
}

CLR_FN clr_two clr_two_advance(clr_two mean, clr_two to, clr_two share) {
    return clr_two_add(mean, clr_two_multiply(clr_two_subtract(to, mean), share));
}

CLR_FN clr_ratios clr_ratios_none(void) {
    const clr_real zero = (clr_real)(0.0f);
    clr_ratios s;
    s.quotient = s.zero_m = s.zero_share = clr_two_make(zero, zero);
    return s;
}

CLR_FN clr_ratios clr_ratios_merge(clr_ratios a, clr_ratios b, clr_entry e) {
    a.quotient = clr_two_advance(a.quotient, b.quotient, e.share);
    a.zero_m = clr_two_advance(a.zero_m, b.zero_m, e.share);
    a.zero_share = clr_two_advance(a.zero_share, b.zero_share, e.share);
    return a;
}

CLR_FN clr_ratios clr_ratios_add(clr_ratios s, clr_real m, clr_real t, clr_entry e) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    const clr_mask empty = t == zero;
    const clr_two quotient = clr_two_divide(clr_two_make(m, zero), clr_two_make(empty ? one : t, zero));
    clr_ratios b;
    b.quotient = clr_two_make(empty ? zero : quotient.hi, empty ? zero : quotient.lo);
    b.zero_m = clr_two_make(empty ? m : zero, zero);
    b.zero_share = clr_two_make(empty ? one : zero, zero);
    return clr_ratios_merge(s, b, e);
}

// Everything a state knows of its values. weight2 is the sum of squared weights, where reliability weights ask for it.
typedef struct {
    clr_moments moments;
    clr_ratios ratios;
    clr_two weight, weight2;
    clr_uint batches;
} clr_record;

// The same for all that a state knows.
CLR_FN clr_record clr_record_merge(clr_record a, clr_record b, bool with_ratios) {
    const clr_two sum = clr_two_add(a.weight, b.weight);
    const clr_entry e = clr_entry_make(a.weight, b.weight, sum);
    a.moments = clr_moments_merge(a.moments, b.moments, e);
    if (with_ratios) a.ratios = clr_ratios_merge(a.ratios, b.ratios, e);
    a.weight = sum;
    a.weight2 = clr_two_add(a.weight2, b.weight2);
    a.batches += b.batches;
    return a;
}

CLR_NAMESPACE_END

#endif
