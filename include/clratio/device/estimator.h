// Ratio estimators and their error bars, from the moments of one value. Sources stand beside each; K is the number of
// batches, W their weight, M2 a sum of squares about the mean. Corrections are written as small differences from the ratio,
// so that float suffices for them.
#ifndef CLRATIO_DEVICE_ESTIMATOR_H
#define CLRATIO_DEVICE_ESTIMATOR_H

#include "clratio/device/ratio.h"

CLR_NAMESPACE_BEGIN

#define CLR_ESTIMATOR_RATIO 0u
#define CLR_ESTIMATOR_MEAN 1u
#define CLR_ESTIMATOR_MEAN_OF_RATIOS 2u
#define CLR_ESTIMATOR_BEALE 3u
#define CLR_ESTIMATOR_TIN 4u
#define CLR_ESTIMATOR_HARTLEY_ROSS 5u
#define CLR_ESTIMATOR_REGRESSION 6u
#define CLR_ESTIMATOR_JACKKNIFE 7u
#define CLR_ESTIMATOR_MICKEY 8u
#define CLR_ESTIMATOR_CROSSFIT_REGRESSION 9u

#define CLR_INTERVAL_DELTA 0u
#define CLR_INTERVAL_FIELLER 1u

// What an interval's two numbers mean.
#define CLR_KIND_BOUNDED 0u     // lower .. upper
#define CLR_KIND_EXCLUSIVE 1u   // everything but the open interval between them
#define CLR_KIND_WHOLE_LINE 2u  // everything: -inf .. +inf

#define CLR_WRITE_ESTIMATE 1u
#define CLR_WRITE_ERROR 2u
#define CLR_WRITE_FLAGS 4u
#define CLR_WRITE_BIAS 8u
#define CLR_WRITE_LOWER 16u
#define CLR_WRITE_UPPER 32u
#define CLR_WRITE_KIND 64u
#define CLR_WRITE_GAIN 128u
#define CLR_WRITE_NEEDED 256u
#define CLR_COUNT_FLAGS 512u  // of all values, without writing them
#define CLR_WRITE_INTERVAL (CLR_WRITE_LOWER | CLR_WRITE_UPPER | CLR_WRITE_KIND)

// What is asked of a state.
typedef struct {
    clr_u32 estimator, zero_policy, interval, outputs;
    float target, relative_target;  // of the standard error: the larger of target and relative_target |estimate|
    clr_u32 counted;                // flags that make a value count as flagged
    clr_u32 reliability;            // 1: weights are not sample counts; the records hold weight2
} clr_question;

typedef struct {
    clr_real value, error;  // the error's standard deviation; +inf where it is not known
    clr_real bias;          // estimated E[ratio] - truth
    clr_real lower, upper;
    clr_real gain;    // predicted variance of the ratio over that of the plain mean
    clr_real needed;  // batches still to come until the target is met, as far as these tell; +inf where they do not
    clr_uint kind, flags;
} clr_estimate;

CLR_FN bool clr_is_regression(clr_u32 estimator) {
    return estimator == CLR_ESTIMATOR_REGRESSION || estimator == CLR_ESTIMATOR_CROSSFIT_REGRESSION;
}

CLR_FN bool clr_uses_groups(clr_u32 estimator) {
    return estimator == CLR_ESTIMATOR_JACKKNIFE || estimator == CLR_ESTIMATOR_MICKEY ||
           estimator == CLR_ESTIMATOR_CROSSFIT_REGRESSION;
}

CLR_FN bool clr_uses_ratios(clr_u32 estimator) {
    return estimator == CLR_ESTIMATOR_MEAN_OF_RATIOS || estimator == CLR_ESTIMATOR_HARTLEY_ROSS;
}

// Those for whom clr_fold sums the residual of each group, so that nothing but means is merged.
CLR_FN bool clr_folds_residual(clr_u32 estimator) {
    return estimator == CLR_ESTIMATOR_JACKKNIFE || estimator == CLR_ESTIMATOR_MICKEY;
}

// How far batches vouch for their mean: Var(mean) = M2 scale, with sample counts 1 / ((K - 1) W). theory.md 4.
typedef struct {
    clr_uint batches;
    clr_real weight, scale;  // scale is 0 where there are fewer than two batches
    clr_mask few;
} clr_evidence;

CLR_FN clr_evidence clr_evidence_of(clr_uint batches, clr_two weight, clr_two weight2, clr_u32 reliability) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    clr_evidence n;
    n.batches = batches;
    n.weight = weight.hi;
    n.few = batches < (clr_uint)(2u);
    clr_real divisor = clr_to_real(batches - (clr_uint)(1u)) * weight.hi, numerator = one;
    if (reliability) {
        divisor = weight.hi * clr_two_subtract(clr_two_multiply(weight, weight), weight2).hi;
        numerator = weight2.hi;
    }
    n.few = n.few || !(divisor > zero);
    n.scale = n.few ? zero : numerator / (n.few ? one : divisor);
    return n;
}

CLR_FN clr_mask clr_never(void) { return (clr_real)(1.0f) < (clr_real)(0.0f); }
CLR_FN clr_mask clr_always(void) { return (clr_real)(0.0f) < (clr_real)(1.0f); }

CLR_FN clr_real clr_root(clr_real x) {
    const clr_real zero = (clr_real)(0.0f);
    return clr_sqrt(x > zero ? x : x * zero);
}

// M2 of the residual m - r t, and its sum of products with t.
typedef struct {
    clr_real mm, mt;
} clr_residual;

CLR_FN clr_residual clr_residual_of(clr_moments s, clr_two r) {
    const clr_two twice = clr_two_make(s.mt.hi + s.mt.hi, s.mt.lo + s.mt.lo), part = clr_two_multiply(r, s.tt);
    clr_residual d;
    d.mm = clr_two_nearest(clr_two_apart(s.mm, clr_two_multiply(r, clr_two_apart(twice, part))));
    d.mt = clr_two_nearest(clr_two_apart(s.mt, part));
    return d;
}

CLR_FN clr_real clr_slope(clr_quotient q) { return q.empty ? (clr_real)(1.0f) : clr_abs(q.control * q.inverse); }

// ---- estimators of one record

// Beale 1962: tau (m t + C / n) / (t^2 + V / n), as the ratio and a correction; bias O(1/N^2). 0 <= m <= t keeps it in
// [0, tau].
CLR_FN clr_real clr_beale(clr_quotient q, clr_moments s, clr_residual d, clr_evidence n) {
    return q.value + q.control * (d.mt * n.scale) / clr_fma(q.denominator, q.denominator, s.tt.hi * n.scale);
}

// Estimated bias of the ratio, to first order.
CLR_FN clr_real clr_ratio_bias(clr_quotient q, clr_residual d, clr_evidence n) {
    return -((q.control * q.inverse) * (d.mt * n.scale) * q.inverse);
}

// Hartley and Ross 1954: unbiased with batches of equal weight, where m = 0 whenever t = 0.
CLR_FN clr_real clr_hartley_ross(clr_record r, clr_real tau) {
    const clr_two product = clr_two_multiply(r.ratios.quotient, r.moments.t);
    const clr_two rest = clr_two_subtract(r.moments.m, product);
    const clr_real k = clr_to_real(r.batches);
    return clr_fma(tau, r.ratios.quotient.hi, rest.hi * (k / (k - (clr_real)(1.0f))));
}

// t - tau.
CLR_FN clr_real clr_control_error(clr_two t, clr_real tau) { return (t.hi - tau) + t.lo; }

CLR_FN clr_real clr_slope_of_regression(clr_real mt, clr_real tt) {
    const clr_mask flat = !(tt > (clr_real)(0.0f));
    return flat ? (clr_real)(0.0f) : mt / (flat ? (clr_real)(1.0f) : tt);
}

// M2 of m about its regression on t.
CLR_FN clr_real clr_regression_residual(clr_moments s) {
    const clr_mask flat = !(s.tt.hi > (clr_real)(0.0f));
    const clr_two divisor = clr_two_make(flat ? (clr_real)(1.0f) : s.tt.hi, flat ? (clr_real)(0.0f) : s.tt.lo);
    const clr_real rest = clr_two_nearest(clr_two_apart(s.mm, clr_two_multiply(clr_two_divide(s.mt, divisor), s.mt)));
    const clr_real zero = (clr_real)(0.0f);
    return flat ? s.mm.hi : (rest > zero ? rest : rest * zero);
}

// Eq. (5), tau mean(m / t), with the zero policy for each batch; the plain mean where tau == 0.
CLR_FN clr_real clr_mean_of_ratios(clr_record r, clr_real tau, clr_u32 zero_policy) {
    const clr_real stand_in =
        zero_policy == CLR_ZERO_ONE ? tau * r.ratios.zero_share.hi : clr_zero_value(zero_policy, tau, r.ratios.zero_m.hi);
    return tau == (clr_real)(0.0f) ? r.moments.m.hi : clr_fma(tau, r.ratios.quotient.hi, stand_in);
}

// ---- estimators over groups of batches, group after group

// Sums over the groups; p is a group's share of the weight, e = u / t_rest with the residual u of its mean and the mean
// t_rest of all other groups, so that the ratio without the group is the ratio + p e / (1 - p).
typedef struct {
    clr_real shift;          // sum of p e
    clr_real a, ae, aee;     // sums of a, a e, a e^2 with a = p / (1 - p)
    clr_real mickey, cross;  // sums of p (r_rest - r)(t - tau) and of p beta_rest (t - tau)
    clr_residual residual;   // of all batches, without their merged moments
    clr_uint groups;         // that hold any weight
    clr_mask broken;         // a mean without one group was 0
} clr_folds;

CLR_FN clr_folds clr_folds_begin(void) {
    const clr_real zero = (clr_real)(0.0f);
    clr_folds f;
    f.shift = f.a = f.ae = f.aee = f.mickey = f.cross = f.residual.mm = f.residual.mt = zero;
    f.groups = (clr_uint)(0u);
    f.broken = clr_never();
    return f;
}

// M2 of all batches but the group's: Chan's merge backwards. `apart` is p / (1 - p) W times the product of the distances.
CLR_FN clr_real clr_without(clr_two all, clr_two group, clr_real apart) {
    return clr_two_nearest(clr_two_apart(clr_two_apart(all, group), clr_two_make(apart, (clr_real)(0.0f))));
}

// A group's part of the weight.
typedef struct {
    clr_real p, a;  // of all, and over that of the other groups
    clr_real all;   // the weight of all
    clr_mask none;  // it has none
} clr_part;

CLR_FN clr_part clr_part_of(clr_two group, clr_two all) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    const clr_two rest = clr_two_subtract(all, group);
    const clr_mask alone = !(rest.hi > zero);
    clr_part w;
    w.none = !(group.hi > zero);
    w.p = w.none ? zero : group.hi / (w.none ? one : all.hi);
    w.a = alone ? zero : group.hi / (alone ? one : rest.hi);
    w.all = all.hi;
    return w;
}

// The difference of two means, to the float's precision.
CLR_FN clr_real clr_distance(clr_two a, clr_two b) { return (a.hi - b.hi) + (a.lo - b.lo); }

CLR_FN clr_folds clr_fold_regression(clr_folds f, clr_moments all, clr_moments group, clr_part w, clr_real tau) {
    const clr_real far = clr_distance(group.t, all.t), apart = w.a * w.all * far;
    const clr_real tt = clr_without(all.tt, group.tt, apart * far);
    const clr_real mt = clr_without(all.mt, group.mt, apart * clr_distance(group.m, all.m));
    f.cross = clr_fma(w.p * clr_slope_of_regression(mt, tt), clr_control_error(group.t, tau), f.cross);
    return f;
}

CLR_FN clr_folds clr_fold_ratio(clr_folds f, clr_moments all, clr_quotient q, clr_moments group, clr_part w, clr_real tau) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    const clr_two dm = clr_two_apart(group.m, all.m), dt = clr_two_apart(group.t, all.t);
    const clr_real u = clr_two_nearest(clr_two_apart(dm, clr_two_multiply(q.quotient, dt))), far = clr_two_nearest(dt);
    const clr_residual within = clr_residual_of(group, q.quotient);
    f.residual.mm += clr_fma(w.p * w.all * u, u, within.mm);
    f.residual.mt += clr_fma(w.p * w.all * u, far, within.mt);
    const clr_real without = (q.denominator + all.t.lo) - w.a * far;
    const clr_mask broken = !w.none && without == zero;
    const clr_real e = -(u / (without == zero ? one : without));
    const clr_real kept = broken || w.none ? zero : e;
    f.broken = f.broken || broken;
    f.shift = clr_fma(w.p, kept, f.shift);
    f.a += w.a;
    f.ae = clr_fma(w.a, kept, f.ae);
    f.aee = clr_fma(w.a * kept, kept, f.aee);
    f.mickey = clr_fma(w.p * (w.a * kept), clr_control_error(group.t, tau), f.mickey);
    return f;
}

CLR_FN clr_folds clr_fold(clr_folds f, clr_moments all, clr_quotient q, clr_moments group, clr_part w, clr_real tau,
                          clr_u32 estimator) {
    f = estimator == CLR_ESTIMATOR_CROSSFIT_REGRESSION ? clr_fold_regression(f, all, group, w, tau)
                                                       : clr_fold_ratio(f, all, q, group, w, tau);
    f.groups += w.none ? (clr_uint)(0u) : (clr_uint)(1u);
    return f;
}

// Quenouille 1956 and Durbin 1959 with two groups; the delete-a-group jackknife of unequal groups of Busing, Meijer and van
// der Leeden 1999.
CLR_FN clr_real clr_jackknife(clr_quotient q, clr_folds f) { return clr_fma(-q.control, f.shift, q.value); }

CLR_FN clr_real clr_jackknife_error(clr_quotient q, clr_folds f) {
    const clr_real two = (clr_real)(2.0f);
    const clr_real spread = clr_fma(f.shift, clr_fma(f.shift, f.a, -(two * f.ae)), f.aee);
    const clr_mask none = f.groups == (clr_uint)(0u);
    return clr_abs(q.control) * clr_root(spread / clr_to_real(none ? (clr_uint)(1u) : f.groups));
}

// Mickey 1959: sum of p (m - r_rest (t - tau)), unbiased.
CLR_FN clr_real clr_mickey(clr_quotient q, clr_folds f) { return q.value - f.mickey; }

// ---- confidence

typedef struct {
    clr_real lower, upper;
    clr_uint kind;
} clr_interval;

CLR_FN clr_interval clr_interval_make(clr_real a, clr_real b, clr_mask exclusive, clr_mask whole) {
    const clr_real infinite = (clr_real)(INFINITY);
    clr_interval c;
    c.lower = whole ? -infinite : (a < b ? a : b);
    c.upper = whole ? infinite : (a < b ? b : a);
    c.kind = whole ? (clr_uint)(CLR_KIND_WHOLE_LINE)
                   : (exclusive ? (clr_uint)(CLR_KIND_EXCLUSIVE) : (clr_uint)(CLR_KIND_BOUNDED));
    return c;
}

CLR_FN clr_interval clr_delta_interval(clr_real value, clr_real error, clr_real quantile) {
    const clr_real width = quantile * error;
    return clr_interval_make(value - width, value + width, clr_never(), !clr_is_finite(width));
}

// Fieller 1940, in units of the denominator: (r - g beta -+ sqrt(q^2 V_d - g q^2 V_reg)) / (1 - g), g = q^2 V_t / t^2.
CLR_FN clr_interval clr_fieller_interval(clr_quotient q, clr_moments s, clr_residual d, clr_evidence n, clr_real quantile) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    const clr_real factor = (quantile * q.inverse) * (quantile * q.inverse) * n.scale;
    const clr_real g = factor * s.tt.hi;
    const clr_real square = clr_fma(-g, factor * clr_regression_residual(s), factor * (d.mm > zero ? d.mm : zero));
    const clr_mask open = !(g < one), whole = q.empty || n.few || (open && !(square > zero));
    const clr_real root = clr_root(square), divisor = g == one ? (clr_real)(0x1p-24f) : one - g;
    const clr_real middle = clr_fma(-factor, s.mt.hi, q.quotient.hi);
    return clr_interval_make(q.control * ((middle - root) / divisor), q.control * ((middle + root) / divisor), open, whole);
}

// ---- the read-out

CLR_FN clr_real clr_value_of(clr_record r, clr_quotient q, clr_residual d, clr_evidence n, clr_folds f, clr_real tau,
                             clr_question ask) {
    if (ask.estimator == CLR_ESTIMATOR_MEAN) return r.moments.m.hi;
    if (ask.estimator == CLR_ESTIMATOR_MEAN_OF_RATIOS) return clr_mean_of_ratios(r, tau, ask.zero_policy);
    if (ask.estimator == CLR_ESTIMATOR_BEALE) return clr_beale(q, r.moments, d, n);
    if (ask.estimator == CLR_ESTIMATOR_TIN) return q.value - clr_ratio_bias(q, d, n);
    if (ask.estimator == CLR_ESTIMATOR_HARTLEY_ROSS) return clr_hartley_ross(r, tau);
    if (ask.estimator == CLR_ESTIMATOR_REGRESSION) {
        const clr_real beta = clr_slope_of_regression(r.moments.mt.hi, r.moments.tt.hi);
        return clr_fma(-beta, clr_control_error(r.moments.t, tau), r.moments.m.hi);
    }
    if (ask.estimator == CLR_ESTIMATOR_JACKKNIFE) return clr_jackknife(q, f);
    if (ask.estimator == CLR_ESTIMATOR_MICKEY) return clr_mickey(q, f);
    if (ask.estimator == CLR_ESTIMATOR_CROSSFIT_REGRESSION) return r.moments.m.hi - f.cross;
    return q.value;
}

// Where the estimator needs more batches or groups than there are.
CLR_FN clr_mask clr_falls_back(clr_evidence n, clr_folds f, clr_u32 estimator) {
    if (estimator == CLR_ESTIMATOR_RATIO || estimator == CLR_ESTIMATOR_MEAN || estimator == CLR_ESTIMATOR_MEAN_OF_RATIOS)
        return clr_never();
    if (clr_uses_groups(estimator)) return f.groups < (clr_uint)(2u) || f.broken;
    return n.few;
}

// The standard error of finite data; the delta method's unless the estimator has one of its own.
CLR_FN clr_real clr_error_of(clr_record r, clr_quotient q, clr_residual d, clr_evidence n, clr_folds f, clr_mask fallen,
                             clr_u32 estimator) {
    if (estimator == CLR_ESTIMATOR_MEAN || clr_is_regression(estimator)) {
        const clr_real mean = clr_root(r.moments.mm.hi * n.scale);
        if (estimator == CLR_ESTIMATOR_MEAN) return mean;
        const clr_real k = clr_to_real(n.batches), one = (clr_real)(1.0f), two = (clr_real)(2.0f);
        const clr_mask few = n.batches < (clr_uint)(3u);
        const clr_real loss = few ? (clr_real)(INFINITY) : (k - one) / (few ? one : k - two);
        return fallen ? mean : clr_root(clr_regression_residual(r.moments) * n.scale * loss);
    }
    const clr_real delta = clr_slope(q) * clr_root(d.mm * n.scale);
    if (estimator == CLR_ESTIMATOR_JACKKNIFE) return q.empty || fallen ? delta : clr_jackknife_error(q, f);
    return delta;
}

CLR_FN clr_real clr_gain_of(clr_moments s, clr_residual d) {
    const clr_mask flat = !(s.mm.hi > (clr_real)(0.0f));
    return flat ? (clr_real)(1.0f) : clr_abs(d.mm) / (flat ? (clr_real)(1.0f) : s.mm.hi);
}

CLR_FN clr_real clr_needed_of(clr_real value, clr_real error, clr_evidence n, clr_question ask) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    const clr_real relative = (clr_real)(ask.relative_target) * clr_abs(value), fixed = (clr_real)(ask.target);
    const clr_real target = relative > fixed ? relative : fixed;
    const clr_real excess = error / target;
    const clr_real more = clr_to_real(n.batches) * clr_fma(excess, excess, -one);
    return error <= target ? zero : (more < one ? one : more);
}

// Any of the estimators, with all flags. `added`: batches that were offered to the state; quantile: of the interval. Only
// what ask.outputs names is computed, save the value; without CLR_WRITE_ERROR the error only says whether it is infinite.
CLR_FN clr_estimate clr_read_out(clr_record r, clr_quotient q, clr_residual d, clr_evidence n, clr_folds f, clr_u32 added,
                                 clr_real tau, clr_real quantile, clr_question ask) {
    const clr_real zero = (clr_real)(0.0f), infinite = (clr_real)(INFINITY);
    const bool is_mean = ask.estimator == CLR_ESTIMATOR_MEAN, averages = ask.estimator == CLR_ESTIMATOR_MEAN_OF_RATIOS;
    const bool divides = !is_mean && !averages && !clr_is_regression(ask.estimator);
    const clr_mask never = clr_never(), no_data = r.batches == (clr_uint)(0u);
    // Where eq. (10) gives the value by a rule of its own, so it does for its relatives.
    const clr_mask ruled = divides ? q.empty || tau == zero : never;
    const clr_mask fallen = clr_falls_back(n, f, ask.estimator) && !ruled;
    const clr_real instead = clr_is_regression(ask.estimator) ? r.moments.m.hi : q.value;
    clr_estimate e;
    e.value = ruled || fallen ? instead : clr_value_of(r, q, d, n, f, tau, ask);
    e.value = no_data ? zero : e.value;

    const clr_mask replaced = divides && ask.zero_policy != CLR_ZERO_MC_MEAN ? q.empty : never;
    const clr_mask too_few = clr_is_regression(ask.estimator) ? n.batches == (clr_uint)(2u) && !fallen : never;
    const clr_mask unknown = averages ? clr_always() : n.few || replaced || too_few;
    e.error = unknown ? infinite : zero;
    if (ask.outputs & (CLR_WRITE_ERROR | CLR_WRITE_INTERVAL | CLR_WRITE_NEEDED)) {
        const clr_real error = clr_error_of(r, q, d, n, f, fallen, ask.estimator);
        e.error = unknown ? infinite : error;
    }
    e.bias = e.lower = e.upper = e.gain = e.needed = zero;
    e.kind = (clr_uint)(0u);
    if (ask.outputs & CLR_WRITE_BIAS) e.bias = q.empty || n.few ? infinite : clr_ratio_bias(q, d, n);
    if (ask.outputs & CLR_WRITE_GAIN) e.gain = clr_gain_of(r.moments, d);
    if (ask.outputs & CLR_WRITE_NEEDED) e.needed = clr_needed_of(e.value, e.error, n, ask);
    if (ask.outputs & CLR_WRITE_INTERVAL) {
        const clr_interval c = ask.interval == CLR_INTERVAL_FIELLER ? clr_fieller_interval(q, r.moments, d, n, quantile)
                                                                    : clr_delta_interval(e.value, e.error, quantile);
        e.lower = c.lower;
        e.upper = c.upper;
        e.kind = c.kind;
    }

    e.flags = (clr_uint)(0u);
    if (!(ask.outputs & (CLR_WRITE_FLAGS | CLR_COUNT_FLAGS))) return e;
    const clr_uint rules = divides    ? clr_quotient_flags(q, tau)
                           : averages ? clr_flag_if(tau == zero, CLR_FLAG_ZERO_TAU)
                                      : (clr_uint)(0u);
    const clr_mask some_empty = clr_uses_ratios(ask.estimator) ? r.ratios.zero_share.hi != zero && tau != zero : never;
    e.flags =
        (no_data ? (clr_uint)(0u)
                 : rules | clr_flag_if(some_empty, CLR_FLAG_ZERO_DENOMINATOR) | clr_flag_if(fallen, CLR_FLAG_FELL_BACK)) |
        clr_flag_if(no_data, CLR_FLAG_NO_DATA) | clr_flag_if(r.batches < (clr_uint)(added), CLR_FLAG_SKIPPED) |
        clr_flag_if(e.error == infinite, CLR_FLAG_NO_ERROR_BAR) | clr_flag_unless_finite(e.value);
    if (ask.outputs & CLR_WRITE_INTERVAL) e.flags |= clr_flag_if(e.error == zero && !no_data, CLR_FLAG_NO_SPREAD);
    return e;
}

CLR_NAMESPACE_END

#endif
