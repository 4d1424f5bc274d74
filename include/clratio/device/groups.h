// What the groups of a value's batches say together, and what estimators take from one group after the other. Three passes
// over the groups: clr_pool_means and clr_pool_within join them, clr_fold measures them against the joint means and the
// ratio, and clr_fold_line against the regression line. Only what cancels is two-float.
#ifndef CLRATIO_DEVICE_GROUPS_H
#define CLRATIO_DEVICE_GROUPS_H

#include "clratio/device/spread.h"

CLR_NAMESPACE_BEGIN

// A group's part of the weight.
typedef struct {
    clr_two p;               // of all
    clr_real a;              // over that of the other groups, p / (1 - p)
    clr_real weight, apart;  // its own, and a times that of all
} clr_part;

// What all parts are taken of.
typedef struct {
    clr_two weight, inverse;
    clr_real a;       // the sum of the parts' a
    clr_uint groups;  // that hold any weight
} clr_whole;

CLR_FN clr_whole clr_whole_of(clr_two weight) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    const clr_mask none = !(weight.hi > zero);
    clr_whole all;
    all.weight = weight;
    all.inverse = clr_two_divide(clr_two_make(one, zero), clr_two_make(none ? one : weight.hi, none ? zero : weight.lo));
    all.a = zero;
    all.groups = (clr_uint)(0u);
    return all;
}

CLR_FN clr_part clr_part_of(clr_two group, clr_whole all) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    const clr_two rest = clr_two_subtract(all.weight, group);
    const clr_mask alone = !(rest.hi > zero);
    clr_part w;
    w.p = clr_two_settle(clr_two_times(group, all.inverse));
    w.a = alone ? zero : group.hi / (alone ? one : rest.hi);
    w.weight = group.hi;
    w.apart = w.a * all.weight.hi;
    return w;
}

CLR_FN clr_whole clr_count_part(clr_whole all, clr_part w) {
    all.a += w.a;
    all.groups += w.weight > (clr_real)(0.0f) ? (clr_uint)(1u) : (clr_uint)(0u);
    return all;
}

// ---- the first pass

// Loose pairs.
CLR_FN clr_moments clr_pool_means(clr_moments all, clr_moments group, clr_two p) {
    all.m = clr_two_gather_times(all.m, group.m, p);
    all.t = clr_two_gather_times(all.t, group.t, p);
    return all;
}

// x - y in float, for a plain y.
CLR_FN clr_real clr_two_beyond(clr_two x, clr_real y) { return (x.hi - y) + x.lo; }

// For estimators over groups, which promise no range: the joint means as one group's own and the others' distances from it.
// They are within (groups + 2) 2^-24 of the mean distance.
CLR_FN clr_moments clr_pool_begin(clr_moments near) {
    clr_moments all = clr_moments_none();
    all.m.hi = near.m.hi;
    all.t.hi = near.t.hi;
    return all;
}

// a's means where it has any weight, else those of the group that comes next.
CLR_FN clr_moments clr_first_means(clr_record a, clr_record next) {
    const clr_mask none = !(a.weight.hi > (clr_real)(0.0f));
    a.moments.m.hi = none ? next.moments.m.hi : a.moments.m.hi;
    a.moments.t.hi = none ? next.moments.t.hi : a.moments.t.hi;
    return a.moments;
}

CLR_FN clr_moments clr_pool_distances(clr_moments all, clr_moments group, clr_two p) {
    all.m.lo = clr_fma(p.hi, clr_two_beyond(group.m, all.m.hi), all.m.lo);
    all.t.lo = clr_fma(p.hi, clr_two_beyond(group.t, all.t.hi), all.t.lo);
    return all;
}

// The second moments within groups, likewise.
CLR_FN clr_moments clr_pool_within(clr_moments all, clr_moments group) {
    all.mm = clr_two_gather(all.mm, group.mm);
    all.tt = clr_two_gather(all.tt, group.tt);
    all.mt = clr_two_gather(all.mt, group.mt);
    return all;
}

CLR_FN clr_ratios clr_pool_ratios(clr_ratios all, clr_ratios group, clr_two p) {
    all.quotient = clr_two_add(all.quotient, clr_two_multiply(group.quotient, p));
    all.zero_m = clr_two_add(all.zero_m, clr_two_multiply(group.zero_m, p));
    all.zero_share = clr_two_add(all.zero_share, clr_two_multiply(group.zero_share, p));
    return all;
}

// ---- the second and third

// Sums over the groups. u is the residual m - r t of a group's mean about the joint one, and e = u / t_rest with the mean
// t_rest of all other groups, so that the ratio without the group is the ratio - a e.
typedef struct {
    clr_two offset;          // m - r t of the joint means: 0 but for the impulse of eq. (10) and empty denominators
    clr_real control_error;  // joint t - tau
    clr_spread between;      // of the groups' means
    clr_real shift;          // sum of p e; infinite or NaN where some t_rest is 0
    clr_real ae, aee;        // sums of a e, a e^2
    clr_real mickey;         // sum of p (r - r_rest)(t - tau)
} clr_folds;

CLR_FN clr_folds clr_folds_begin(clr_moments all, clr_quotient q, clr_real tau) {
    const clr_real zero = (clr_real)(0.0f);
    clr_folds f;
    f.offset = clr_two_apart(all.m, clr_two_multiply(q.quotient, all.t));
    f.control_error = clr_two_gap(all.t, clr_two_make(tau, zero));
    f.between = clr_spread_none();
    f.shift = f.ae = f.aee = f.mickey = zero;
    return f;
}

// m - r t - offset to the float's precision: what cancels is rounded once, in the first fma.
CLR_FN clr_real clr_mean_residual(clr_moments group, clr_two r, clr_two offset) {
    const clr_real rest = clr_fma(-r.lo, group.t.hi, clr_fma(-r.hi, group.t.lo, group.m.lo));
    return (clr_fma(-r.hi, group.t.hi, group.m.hi) - offset.hi) + (rest - offset.lo);
}

// What the other groups have of a sum counts as nothing below this part of it: rounding leaves as much where they have none.
#define CLR_LEAST_REST 0x1p-16f

CLR_FN clr_folds clr_fold(clr_folds f, clr_moments all, clr_quotient q, clr_moments group, clr_part w) {
    const clr_real dm = clr_two_gap(group.m, all.m), dt = clr_two_gap(group.t, all.t);
    f.between.mm = clr_fma(w.weight * dm, dm, f.between.mm);
    f.between.mt = clr_fma(w.weight * dm, dt, f.between.mt);
    f.between.tt = clr_fma(w.weight * dt, dt, f.between.tt);

    const clr_real u = clr_mean_residual(group, q.quotient, f.offset), heavy = w.weight * u;
    f.between.ratio.mm = clr_fma(heavy, u, f.between.ratio.mm);
    f.between.ratio.mt = clr_fma(heavy, dt, f.between.ratio.mt);

    const clr_real t_rest = clr_fma(-w.a, dt, q.denominator);
    const clr_mask some = clr_abs(t_rest) > clr_abs(q.denominator) * (clr_real)(CLR_LEAST_REST);
    const clr_real e = u / (some ? t_rest : (clr_real)(0.0f)), ae = w.a * e;
    f.shift = clr_fma(w.p.hi, e, f.shift);
    f.ae += ae;
    f.aee = clr_fma(ae, e, f.aee);
    f.mickey = clr_fma(w.p.hi * ae, dt + f.control_error, f.mickey);
    return f;
}

// Of a group's mean from the line through the joint one. Means are seldom twice each other: then the first two are exact.
CLR_FN clr_real clr_line_distance(clr_moments group, clr_moments all, clr_real slope) {
    const clr_real dm = group.m.hi - all.m.hi, dt = group.t.hi - all.t.hi;
    return clr_fma(-slope, dt, dm) + clr_fma(-slope, group.t.lo - all.t.lo, group.m.lo - all.m.lo);
}

// `within`: the pooled moments; `slope`: of the regression over all batches.
CLR_FN clr_folds clr_fold_line(clr_folds f, clr_moments within, clr_real slope, clr_moments group, clr_part w) {
    const clr_real off = clr_line_distance(group, within, slope);
    f.between.line = clr_fma(w.weight * off, off, f.between.line);
    return f;
}

// ---- the cross-fitted correction: each group's distance from tau by the slope of all groups but that one

typedef struct {
    clr_real tt, mt;            // of all batches
    clr_real spare_m, least_t;  // mm of all batches less the least that may be left of it, and that of tt
    clr_real control_error;     // of clr_folds
    clr_real sum;               // of p beta_rest (t - tau)
    clr_real margin;            // the least of all groups
    clr_mask untold;            // some beta_rest is 0: the others' t does not vary, though all t do
} clr_cross;

// Where sums over all cancel to less than this part of them, a slope is in doubt.
#define CLR_CERTAIN_REST 0x1p-7f

CLR_FN clr_cross clr_cross_begin(clr_folds f, clr_spread all) {
    clr_cross c;
    c.tt = all.tt;
    c.mt = all.mt;
    c.spare_m = clr_fma(all.mm, -(clr_real)(CLR_CERTAIN_REST), all.mm);
    c.least_t = all.tt * (clr_real)(CLR_CERTAIN_REST);
    c.control_error = f.control_error;
    c.sum = (clr_real)(0.0f);
    c.margin = (clr_real)(CLR_REAL_MAX);
    c.untold = c.sum > c.sum;
    return c;
}

// What a group's part leaves of the sums over all. Unless a margin is negative, the slope without a group of up to half of
// the weight is good to (groups + 2) 2^-14 of the root of mm over tt.
typedef struct {
    clr_real slope;
    clr_real margin_m, margin_t;  // by which mm and tt are more than the least
} clr_others;

CLR_FN clr_others clr_others_than(clr_cross c, clr_moments within, clr_moments group, clr_part w) {
    const clr_real dm = clr_two_gap(group.m, within.m), dt = clr_two_gap(group.t, within.t);
    const clr_real heavy_m = w.apart * dm, heavy_t = w.apart * dt;
    const clr_real tt = clr_fma(-heavy_t, dt, c.tt - clr_two_nearest(group.tt));
    const clr_real mt = clr_fma(-heavy_t, dm, c.mt - clr_two_nearest(group.mt));
    clr_others o;
    o.slope = clr_slope_of_regression(mt, tt);
    o.margin_m = clr_fma(-heavy_m, dm, c.spare_m - clr_two_nearest(group.mm));
    o.margin_t = tt - c.least_t;
    return o;
}

CLR_FN clr_cross clr_cross_add(clr_cross c, clr_moments within, clr_others o, clr_moments group, clr_part w) {
    c.sum = clr_fma(w.p.hi * o.slope, clr_two_gap(group.t, within.t) + c.control_error, c.sum);
    c.margin = o.margin_m < c.margin ? o.margin_m : c.margin;
    c.margin = o.margin_t < c.margin ? o.margin_t : c.margin;
    return c;
}

// The other groups one by one, in two passes, without a difference that cancels.
typedef struct {
    clr_real weight, near_m, near_t;  // near: the means of the first
    clr_real m, t;                    // the sums, then the means, of distances from there
    clr_real tt, mt;
} clr_rest;

CLR_FN clr_rest clr_rest_none(void) {
    clr_rest r;
    r.weight = r.near_m = r.near_t = r.m = r.t = r.tt = r.mt = (clr_real)(0.0f);
    return r;
}

CLR_FN clr_rest clr_rest_weigh(clr_rest r, clr_moments group, clr_real weight) {
    const clr_mask none = !(r.weight > (clr_real)(0.0f));
    r.near_m = none ? group.m.hi : r.near_m;
    r.near_t = none ? group.t.hi : r.near_t;
    r.m = clr_fma(weight, clr_two_beyond(group.m, r.near_m), r.m);
    r.t = clr_fma(weight, clr_two_beyond(group.t, r.near_t), r.t);
    r.weight += weight;
    return r;
}

CLR_FN clr_rest clr_rest_center(clr_rest r) {
    const clr_real zero = (clr_real)(0.0f);
    const clr_mask none = !(r.weight > zero);
    const clr_real divisor = none ? (clr_real)(1.0f) : r.weight;
    r.m = none ? zero : r.m / divisor;
    r.t = none ? zero : r.t / divisor;
    return r;
}

CLR_FN clr_rest clr_rest_scatter(clr_rest r, clr_moments group, clr_real weight) {
    const clr_real dm = clr_two_beyond(group.m, r.near_m) - r.m, dt = clr_two_beyond(group.t, r.near_t) - r.t;
    const clr_real heavy = weight * dt;
    r.tt = clr_fma(heavy, dt, r.tt + clr_two_nearest(group.tt));
    r.mt = clr_fma(heavy, dm, r.mt + clr_two_nearest(group.mt));
    return r;
}

CLR_FN clr_mask clr_slope_in_doubt(clr_others o) {
    const clr_real zero = (clr_real)(0.0f);
    return o.margin_m < zero || o.margin_t < zero;
}

// The slope is the rest's where it was in doubt.
CLR_FN clr_others clr_settle_doubt(clr_others o, clr_rest r) {
    o.slope = clr_slope_in_doubt(o) ? clr_slope_of_regression(r.mt, r.tt) : o.slope;
    return o;
}

CLR_FN clr_mask clr_is_untold(clr_others o, clr_rest r) {
    const clr_real zero = (clr_real)(0.0f);
    return o.margin_t < zero && r.tt <= zero;
}

// M2 about the line, after the third pass.
CLR_FN clr_real clr_line_of_groups(clr_moments within, clr_real slope, clr_folds f) {
    return clr_line_residual(within, slope) + f.between.line;
}

// Of all batches, but for the line, which needs the third pass.
CLR_FN clr_spread clr_spread_of_groups(clr_moments within, clr_two ratio, clr_folds f) {
    clr_spread d;
    const clr_residual inner = clr_residual_of(within, ratio);
    d.mm = within.mm.hi + f.between.mm;
    d.tt = within.tt.hi + f.between.tt;
    d.mt = within.mt.hi + f.between.mt;
    d.ratio.mm = inner.mm + f.between.ratio.mm;
    d.ratio.mt = inner.mt + f.between.ratio.mt;
    d.ratio = clr_without_noise(d.ratio, d.mm, d.tt, ratio.hi);
    d.line = (clr_real)(0.0f);
    return d;
}

CLR_NAMESPACE_END

#endif
