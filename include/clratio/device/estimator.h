// Ratio estimators and their error bars, from the moments of one value. Sources stand beside each; K is the number of
// batches, W their weight, M2 a sum of squares about the mean. Corrections are written as small differences from the ratio,
// so that float suffices for them.
#ifndef CLRATIO_DEVICE_ESTIMATOR_H
#define CLRATIO_DEVICE_ESTIMATOR_H

#include "clratio/device/groups.h"

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

// How far batches vouch for their mean: Var(mean) = M2 scale, with sample counts 1 / ((K - 1) W). theory.md 4.
typedef struct {
    clr_uint batches;
    clr_real weight, scale;  // scale is 0 where there are fewer than two batches
    clr_mask few;
} clr_evidence;

#define CLR_OUTWEIGHED 0x1p-40f

CLR_FN clr_evidence clr_evidence_of(clr_uint batches, clr_two weight, clr_two weight2, clr_u32 reliability) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    clr_evidence n;
    n.batches = batches;
    n.weight = weight.hi;
    n.few = batches < (clr_uint)(2u);
    clr_real divisor = clr_to_real(batches - (clr_uint)(1u)) * weight.hi, numerator = one;
    if (reliability) {
        // W2 / (W (W^2 - W2)) without third powers, which would leave the range of float long before the weights do.
        const clr_mask none = !(weight.hi > zero);
        const clr_two mean = clr_two_divide(weight2, clr_two_make(none ? one : weight.hi, none ? zero : weight.lo));
        const clr_real others = clr_two_subtract(weight, mean).hi;
        divisor = weight.hi * others;
        numerator = mean.hi;
        // One batch outweighs the others so far that of their weight nothing but rounding is left.
        n.few = n.few || !(others > weight.hi * (clr_real)(CLR_OUTWEIGHED));
    }
    n.few = n.few || !(divisor > zero);
    n.scale = n.few ? zero : numerator / (n.few ? one : divisor);
    return n;
}

CLR_FN clr_mask clr_never(void) { return (clr_real)(1.0f) < (clr_real)(0.0f); }
CLR_FN clr_mask clr_always(void) { return (clr_real)(0.0f) < (clr_real)(1.0f); }

CLR_FN clr_real clr_root(clr_real x) {
    const clr_real zero = (clr_real)(0.0f);
    return clr_sqrt(x > zero ? x : clr_abs(x) * zero);
}

CLR_FN clr_real clr_delta_factor(clr_quotient q) { return q.empty ? (clr_real)(1.0f) : clr_abs(q.control * q.inverse); }

// ---- estimators of one record

// Beale 1962: tau (m t + C / n) / (t^2 + V / n), as the ratio and a correction; bias O(1/N^2). 0 <= m <= t keeps it in
// [0, tau].
CLR_FN clr_real clr_beale(clr_quotient q, clr_spread s, clr_evidence n) {
    return q.value + q.control * (s.ratio.mt * n.scale) / clr_fma(q.denominator, q.denominator, s.tt * n.scale);
}

// Estimated bias of the ratio, to first order.
CLR_FN clr_real clr_ratio_bias(clr_quotient q, clr_spread s, clr_evidence n) {
    return -((q.control * q.inverse) * (s.ratio.mt * n.scale) * q.inverse);
}

// Hartley and Ross 1954: unbiased with batches of equal weight, where m = 0 whenever t = 0.
CLR_FN clr_real clr_hartley_ross(clr_record r, clr_real tau) {
    const clr_two product = clr_two_multiply(r.ratios.quotient, r.moments.t);
    const clr_two rest = clr_two_subtract(r.moments.m, product);
    const clr_real k = clr_to_real(r.batches);
    return clr_fma(tau, r.ratios.quotient.hi, rest.hi * (k / (k - (clr_real)(1.0f))));
}

// Of the residual m - r t with r the mean of m / t, which is how Hartley and Ross's estimate varies: the spread about the
// ratio, moved to r.
CLR_FN clr_real clr_hartley_ross_error(clr_record r, clr_quotient q, clr_spread s, clr_evidence n) {
    const clr_real off = clr_two_gap(r.ratios.quotient, q.quotient);
    return clr_root(clr_fma(off, clr_fma(off, s.tt, (clr_real)(-2.0f) * s.ratio.mt), s.ratio.mm) * n.scale);
}

// Eq. (5), tau mean(m / t), with the zero policy for each batch; the plain mean where tau == 0.
CLR_FN clr_real clr_mean_of_ratios(clr_record r, clr_real tau, clr_u32 zero_policy) {
    const clr_real stand_in =
        zero_policy == CLR_ZERO_ONE ? tau * r.ratios.zero_share.hi : clr_zero_value(zero_policy, tau, r.ratios.zero_m.hi);
    return tau == (clr_real)(0.0f) ? r.moments.m.hi : clr_fma(tau, r.ratios.quotient.hi, stand_in);
}

// ---- estimators over groups of batches, group after group

// Quenouille 1956 and Durbin 1959 with two groups; the delete-a-group jackknife of unequal groups of Busing, Meijer and van
// der Leeden 1999.
CLR_FN clr_real clr_jackknife(clr_quotient q, clr_folds f) { return clr_fma(q.control, f.shift, q.value); }

CLR_FN clr_real clr_jackknife_error(clr_quotient q, clr_folds f, clr_whole all) {
    const clr_real two = (clr_real)(2.0f);
    const clr_real spread = clr_fma(f.shift, clr_fma(f.shift, all.a, -(two * f.ae)), f.aee);
    const clr_mask none = all.groups == (clr_uint)(0u);
    return clr_abs(q.control) * clr_root(spread / clr_to_real(none ? (clr_uint)(1u) : all.groups));
}

// Mickey 1959: sum of p (m - r_rest (t - tau)), unbiased.
CLR_FN clr_real clr_mickey(clr_quotient q, clr_folds f) { return q.value + f.mickey; }

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
CLR_FN clr_interval clr_fieller_interval(clr_quotient q, clr_spread s, clr_evidence n, clr_real quantile) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    const clr_real unit = clr_abs(quantile * q.inverse), factor = unit * unit * n.scale;
    const clr_real g = factor * s.tt;
    const clr_real square = clr_fma(-g, s.line, s.ratio.mm > zero ? s.ratio.mm : zero) * n.scale;
    const clr_mask open = !(g < one), whole = q.empty || n.few || (open && !(square > zero));
    const clr_real root = unit * clr_root(square), divisor = g == one ? (clr_real)(0x1p-24f) : one - g;
    const clr_real middle = clr_fma(-factor, s.mt, q.quotient.hi);
    return clr_interval_make(q.control * ((middle - root) / divisor), q.control * ((middle + root) / divisor), open, whole);
}

// ---- the read-out

// What all batches of a value say together.
typedef struct {
    clr_record all;  // with the pooled moments, where there are groups
    clr_whole whole;
    clr_quotient q;
    clr_folds folds;
    clr_cross cross;
    clr_spread spread;
    clr_evidence n;
} clr_joint;

// Whether the scatter within groups is asked for. The jackknife's own error needs the groups' means alone.
CLR_FN bool clr_asks_within(clr_question ask) {
    return ask.estimator != CLR_ESTIMATOR_JACKKNIFE ||
           (ask.outputs & (CLR_WRITE_BIAS | CLR_WRITE_INTERVAL | CLR_WRITE_GAIN)) != 0;
}

// Whether any second moment is.
CLR_FN bool clr_asks_scatter(clr_question ask) {
    const bool corrects = ask.estimator == CLR_ESTIMATOR_BEALE || ask.estimator == CLR_ESTIMATOR_TIN;
    const clr_u32 outputs = CLR_WRITE_ERROR | CLR_WRITE_BIAS | CLR_WRITE_INTERVAL | CLR_WRITE_GAIN | CLR_WRITE_NEEDED;
    return clr_asks_within(ask) && (corrects || clr_is_regression(ask.estimator) || (ask.outputs & outputs) != 0);
}

// But for the sums over groups, the spread and the evidence.
CLR_FN clr_joint clr_joint_means(clr_record all, clr_whole whole, clr_real tau, clr_u32 zero_policy) {
    clr_joint j;
    all.moments = clr_moments_settle(all.moments);
    j.all = all;
    j.whole = whole;
    j.q = clr_divide_means(all.moments.m, all.moments.t, tau, zero_policy);
    j.folds = clr_folds_begin(all.moments, j.q, tau);
    j.cross = clr_cross_begin(j.folds, clr_spread_none());
    return j;
}

// Of batches that are not in groups.
CLR_FN clr_joint clr_joint_of(clr_record all, clr_evidence n, clr_real tau, clr_u32 zero_policy) {
    clr_joint j = clr_joint_means(all, clr_whole_of(all.weight), tau, zero_policy);
    j.spread = clr_spread_of(j.all.moments, j.q.quotient);
    j.n = n;
    return j;
}

// Whether the scatter about the regression line is asked for.
CLR_FN bool clr_asks_line(clr_question ask) {
    return clr_is_regression(ask.estimator) || (ask.outputs & CLR_WRITE_INTERVAL);
}

CLR_FN clr_real clr_value_of(clr_joint j, clr_real tau, clr_question ask) {
    const clr_moments means = j.all.moments;
    if (ask.estimator == CLR_ESTIMATOR_MEAN) return means.m.hi;
    if (ask.estimator == CLR_ESTIMATOR_MEAN_OF_RATIOS) return clr_mean_of_ratios(j.all, tau, ask.zero_policy);
    if (ask.estimator == CLR_ESTIMATOR_BEALE) return clr_beale(j.q, j.spread, j.n);
    if (ask.estimator == CLR_ESTIMATOR_TIN) return j.q.value - clr_ratio_bias(j.q, j.spread, j.n);
    if (ask.estimator == CLR_ESTIMATOR_HARTLEY_ROSS) return clr_hartley_ross(j.all, tau);
    if (ask.estimator == CLR_ESTIMATOR_REGRESSION)
        return clr_fma(-clr_slope_of_regression(j.spread.mt, j.spread.tt), j.folds.control_error, means.m.hi);
    if (ask.estimator == CLR_ESTIMATOR_JACKKNIFE) return clr_jackknife(j.q, j.folds);
    if (ask.estimator == CLR_ESTIMATOR_MICKEY) return clr_mickey(j.q, j.folds);
    if (ask.estimator == CLR_ESTIMATOR_CROSSFIT_REGRESSION) return means.m.hi - j.cross.sum;
    return j.q.value;
}

// What an estimator takes from the groups. It is infinite or NaN where the others of some group do not tell.
CLR_FN clr_real clr_sum_over_groups(clr_joint j, clr_u32 estimator) {
    if (estimator == CLR_ESTIMATOR_JACKKNIFE) return j.folds.shift;
    return estimator == CLR_ESTIMATOR_MICKEY ? j.folds.mickey : j.cross.sum;
}

// Where the estimator needs more batches or groups than there are.
CLR_FN clr_mask clr_falls_back(clr_joint j, clr_u32 estimator) {
    if (estimator == CLR_ESTIMATOR_RATIO || estimator == CLR_ESTIMATOR_MEAN || estimator == CLR_ESTIMATOR_MEAN_OF_RATIOS)
        return clr_never();
    if (clr_uses_groups(estimator))
        return j.whole.groups < (clr_uint)(2u) || !clr_is_finite(clr_sum_over_groups(j, estimator));
    return j.n.few;
}

// Where the jackknife has no error of its own.
CLR_FN clr_mask clr_has_delta_error(clr_joint j, clr_real tau) {
    return j.q.empty || tau == (clr_real)(0.0f) || clr_falls_back(j, CLR_ESTIMATOR_JACKKNIFE);
}

// What the quantile of Student's t counts: batches, or the groups that the jackknife's own error is made of.
CLR_FN clr_uint clr_trials(clr_joint j, clr_real tau, clr_question ask) {
    if (ask.estimator != CLR_ESTIMATOR_JACKKNIFE || ask.interval != CLR_INTERVAL_DELTA) return j.all.batches;
    return clr_has_delta_error(j, tau) ? j.all.batches : j.whole.groups;
}

CLR_FN clr_real clr_delta_error(clr_quotient q, clr_spread s, clr_evidence n) {
    return clr_delta_factor(q) * clr_root(s.ratio.mm * n.scale);
}

// The standard error of finite data; the delta method's unless the estimator has one of its own.
CLR_FN clr_real clr_error_of(clr_joint j, clr_mask fallen, clr_real tau, clr_u32 estimator) {
    const clr_quotient q = j.q;
    const clr_spread s = j.spread;
    const clr_evidence n = j.n;
    if (estimator == CLR_ESTIMATOR_MEAN || clr_is_regression(estimator)) {
        const clr_real mean = clr_root(s.mm * n.scale);
        if (estimator == CLR_ESTIMATOR_MEAN) return mean;
        const clr_real k = clr_to_real(n.batches), one = (clr_real)(1.0f), two = (clr_real)(2.0f);
        const clr_mask few = n.batches < (clr_uint)(3u);
        const clr_real loss = few ? (clr_real)(INFINITY) : (k - one) / (few ? one : k - two);
        return fallen ? mean : clr_root(s.line * n.scale * loss);
    }
    if (estimator == CLR_ESTIMATOR_HARTLEY_ROSS) {
        const clr_mask ruled = q.empty || tau == (clr_real)(0.0f);
        return ruled ? clr_delta_error(q, s, n) : clr_hartley_ross_error(j.all, q, s, n);
    }
    if (estimator != CLR_ESTIMATOR_JACKKNIFE) return clr_delta_error(q, s, n);
    const clr_mask by_delta = clr_has_delta_error(j, tau);
    const clr_real error = clr_jackknife_error(q, j.folds, j.whole);
    if (!clr_any(by_delta)) return error;
    return by_delta ? clr_delta_error(q, s, n) : error;
}

// 1 where neither the ratio nor the mean varies.
CLR_FN clr_real clr_gain_of(clr_spread s) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f), residual = clr_abs(s.ratio.mm);
    const clr_mask flat = s.mm <= zero;
    return flat ? (residual > zero ? (clr_real)(INFINITY) : one) : residual / (flat ? one : s.mm);
}

CLR_FN clr_real clr_needed_of(clr_real value, clr_real error, clr_evidence n, clr_question ask) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    const clr_real relative = (clr_real)(ask.relative_target) * clr_abs(value), fixed = (clr_real)(ask.target);
    const clr_real target = relative > fixed ? relative : fixed;
    const clr_real excess = error / target;
    const clr_real more = clr_to_real(n.batches) * clr_fma(excess, excess, -one);
    const clr_mask known = clr_is_finite(error) && clr_is_finite(value);
    return known ? (error <= target ? zero : (more < one ? one : more)) : (clr_real)(INFINITY);
}

// Any of the estimators, with all flags. `added`: batches that were offered to the state; quantile: of the interval. Only
// what ask.outputs names is computed, save the value; without CLR_WRITE_ERROR the error only says whether it is infinite.
CLR_FN clr_estimate clr_read_out(clr_joint j, clr_u32 added, clr_real tau, clr_real quantile, clr_question ask) {
    const clr_record r = j.all;
    const clr_quotient q = j.q;
    const clr_evidence n = j.n;
    const clr_real zero = (clr_real)(0.0f), infinite = (clr_real)(INFINITY);
    const bool is_mean = ask.estimator == CLR_ESTIMATOR_MEAN, averages = ask.estimator == CLR_ESTIMATOR_MEAN_OF_RATIOS;
    const bool divides = !is_mean && !averages && !clr_is_regression(ask.estimator);
    const clr_mask never = clr_never(), no_data = r.batches == (clr_uint)(0u);
    // Where eq. (10) gives the value by a rule of its own, so it does for its relatives.
    const clr_mask ruled = divides ? q.empty || tau == zero : never;
    const clr_mask fallen = clr_falls_back(j, ask.estimator) && !ruled;
    const clr_real instead = clr_is_regression(ask.estimator) ? r.moments.m.hi : q.value;
    clr_estimate e;
    e.value = ruled || fallen ? instead : clr_value_of(j, tau, ask);
    e.value = no_data ? zero : e.value;

    const clr_mask replaced = divides && ask.zero_policy != CLR_ZERO_MC_MEAN ? q.empty : never;
    const clr_mask too_few = clr_is_regression(ask.estimator) ? n.batches == (clr_uint)(2u) && !fallen : never;
    const clr_mask unknown = averages ? clr_always() : n.few || replaced || too_few;
    e.error = unknown ? infinite : zero;
    if (ask.outputs & (CLR_WRITE_ERROR | CLR_WRITE_INTERVAL | CLR_WRITE_NEEDED)) {
        const clr_real error = clr_error_of(j, fallen, tau, ask.estimator);
        e.error = unknown ? infinite : error;
    }
    e.bias = e.lower = e.upper = e.gain = e.needed = zero;
    e.kind = (clr_uint)(0u);
    if (ask.outputs & CLR_WRITE_BIAS) e.bias = q.empty || n.few ? infinite : clr_ratio_bias(q, j.spread, n);
    if (ask.outputs & CLR_WRITE_GAIN) e.gain = clr_gain_of(j.spread);
    if (ask.outputs & CLR_WRITE_NEEDED) e.needed = clr_needed_of(e.value, e.error, n, ask);
    if (ask.outputs & CLR_WRITE_INTERVAL) {
        const clr_interval c = ask.interval == CLR_INTERVAL_FIELLER ? clr_fieller_interval(q, j.spread, n, quantile)
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
    const clr_mask untold = ask.estimator == CLR_ESTIMATOR_CROSSFIT_REGRESSION ? j.cross.untold : never;
    const clr_mask some_empty = clr_uses_ratios(ask.estimator) ? r.ratios.zero_share.hi != zero && tau != zero : never;
    e.flags = (no_data ? (clr_uint)(0u)
                       : rules | clr_flag_if(some_empty, CLR_FLAG_ZERO_DENOMINATOR) |
                             clr_flag_if(fallen || untold, CLR_FLAG_FELL_BACK)) |
              clr_flag_if(no_data, CLR_FLAG_NO_DATA) | clr_flag_if(r.batches < (clr_uint)(added), CLR_FLAG_SKIPPED) |
              clr_flag_if(e.error == infinite, CLR_FLAG_NO_ERROR_BAR) | clr_flag_unless_finite(e.value);
    if (ask.outputs & (CLR_WRITE_INTERVAL | CLR_WRITE_NEEDED))
        e.flags |= clr_flag_if(e.error == zero && !no_data, CLR_FLAG_NO_SPREAD);
    return e;
}

CLR_NAMESPACE_END

#endif
