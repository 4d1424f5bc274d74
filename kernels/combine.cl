// Reads estimates out of moments, or straight out of one pair of means.
// A program with CLR_ESTIMATOR is for that estimator, for states of CLR_STATE_OPTIONS, and for the outputs CLR_ASKED: what
// they do not need costs nothing, and nothing branches. One without it is for everything.
#include "clratio/device/planes.h"

#define CLR_ALL_FLAGS 0xffffffffu

#if defined(CLR_ESTIMATOR)
#define CLR_OPTIONS_OF(groups) CLR_STATE_OPTIONS
#else
#define CLR_OPTIONS_OF(groups) (groups)->options
#endif

#if CLR_GROUPED
#define CLR_RUN 1
#else
#define CLR_RUN 8
#endif

// A run of vectors without gaps. Flags are rare: they are looked at once.
CLR_FN void clr_combine_run(global const float* m, global const float* t, global const float* tau, const bool one_tau,
                            global float* to, const bool past, uint zero_policy, clr_flag_tally* tally) {
    clr_uint flags[CLR_RUN], some = (clr_uint)(0u);
    for (uint k = 0; k < CLR_RUN; ++k) {
        const uint at = k * CLR_WIDTH;
        const clr_plain_ratio r =
            clr_read_means(clr_load(m + at), clr_load(t + at), one_tau ? (clr_real)(*tau) : clr_load(tau + at), zero_policy);
        if (past)
            clr_store_past(r.value, to + at);
        else
            clr_store(r.value, to + at);
        flags[k] = r.flags;
        some |= r.flags;
    }
    if (!clr_any(some != (clr_uint)(0u))) return;
    for (uint k = 0; k < CLR_RUN; ++k) clr_count_flags(tally, flags[k], CLR_ALL_FLAGS);
}

CLR_FN bool clr_is_packed(clr_layout view) { return view.stride == view.channels; }

kernel void clr_combine(global const float* m, clr_layout m_layout, global const float* t, clr_layout t_layout,
                        global const float* tau, clr_layout tau_layout, global float* estimate, clr_layout estimate_layout,
                        global float* flags, global ulong* flag_rows, uint zero_policy, clr_range range) {
    const clr_layout packed = {0, 1, 1};
    const bool one_tau = tau_layout.stride == 0 && tau_layout.channels == 1;
    const bool runs = clr_is_packed(m_layout) && clr_is_packed(t_layout) && (one_tau || clr_is_packed(tau_layout)) &&
                      estimate && clr_is_packed(estimate_layout) && !flags;
    const bool past = runs && estimate != m && clr_goes_past(estimate, estimate_layout, range.count);
    clr_flag_tally tally = {{(clr_uint)(0u)}};
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end;) {
        const ulong first = v * CLR_WIDTH;
        if (runs && v + CLR_RUN <= span.end && first + CLR_RUN * CLR_WIDTH <= range.count) {
            clr_combine_run(m + m_layout.offset + first, t + t_layout.offset + first,
                            tau + tau_layout.offset + (one_tau ? 0 : first), one_tau,
                            estimate + estimate_layout.offset + first, past, zero_policy, &tally);
            v += CLR_RUN * span.step;
            continue;
        }
        const clr_plain_ratio r =
            clr_read_means(clr_load_view(m, m_layout, first, range.count), clr_load_view(t, t_layout, first, range.count),
                           clr_load_view(tau, tau_layout, first, range.count), zero_policy);
        if (estimate) clr_store_view(r.value, estimate, estimate_layout, first, range.count);
        if (flags) clr_store_apart(clr_from_bits(r.flags), flags, packed, first, range.count);
        clr_count_flags(&tally, first + CLR_WIDTH <= range.count ? r.flags : r.flags & clr_lanes_below(first, range.count),
                        CLR_ALL_FLAGS);
        v += span.step;
    }
    clr_store_flag_tally(&tally, CLR_ALL_FLAGS, flag_rows);
}

CLR_FN clr_state clr_state_of(const clr_groups* groups, uint g) {
    const clr_state s = {g, groups->count, groups->of[g], CLR_OPTIONS_OF(groups)};
    return s;
}

CLR_FN clr_record clr_load_group(clr_planes base, const clr_groups* groups, uint g, ulong i) {
    return clr_load_record(base, clr_state_of(groups, g), i);
}

// What the batches of all groups are worth together, where no value has skipped any.
CLR_FN clr_evidence clr_whole_evidence(const clr_groups* groups, uint reliability) {
    clr_group sum = groups->of[0];
    clr_two weight = clr_both(sum.weight_hi, sum.weight_lo), weight2 = clr_both(sum.weight2_hi, sum.weight2_lo);
    for (uint g = 1; g < groups->count; ++g) {
        const clr_group more = groups->of[g];
        sum.batches += more.batches;
        weight = clr_two_add(weight, clr_both(more.weight_hi, more.weight_lo));
        weight2 = clr_two_add(weight2, clr_both(more.weight2_hi, more.weight2_lo));
    }
    return clr_evidence_of((clr_uint)(sum.batches), weight, weight2, reliability);
}

#if defined(CLR_MANY_GROUPS)

CLR_FN bool clr_weighs_values(const clr_groups* groups) { return (CLR_OPTIONS_OF(groups) & CLR_STATE_PER_VALUE) != 0; }

CLR_FN clr_part clr_part_in(const clr_groups* groups, uint g, clr_record group, clr_whole whole) {
    if (clr_weighs_values(groups)) return clr_part_of(group.weight, whole);
    const clr_member member = groups->member[g];
    clr_part w;
    w.p = clr_both(member.p_hi, member.p_lo);
    w.a = (clr_real)(member.a);
    w.weight = group.weight.hi;
    w.apart = (clr_real)(member.apart);
    return w;
}

// Of a value that has lost no batch.
CLR_FN clr_whole clr_whole_of_all(const clr_groups* groups) {
    clr_whole whole = clr_whole_of(clr_both(0.0f, 0.0f));
    for (uint g = 0; g < groups->count; ++g) {
        clr_record group;
        group.weight = clr_both(groups->of[g].weight_hi, groups->of[g].weight_lo);
        whole = clr_count_part(whole, clr_part_in(groups, g, group, whole));
    }
    return whole;
}

// Weights and batches together, value by value, and the means of the first group that has any.
CLR_FN clr_record clr_weigh(clr_planes base, const clr_groups* groups, clr_whole* whole, ulong i) {
    clr_record all = clr_load_group(base, groups, 0, i);
    for (uint g = 1; g < groups->count; ++g) {
        const clr_record more = clr_load_group(base, groups, g, i);
        all.moments = clr_first_means(all, more);
        all.weight = clr_two_add(all.weight, more.weight);
        all.weight2 = clr_two_add(all.weight2, more.weight2);
        all.batches += more.batches;
    }
    *whole = clr_whole_of(all.weight);
    for (uint g = 0; g < groups->count; ++g)
        *whole = clr_count_part(*whole, clr_part_in(groups, g, clr_load_group(base, groups, g, i), *whole));
    return all;
}

CLR_FN bool clr_holds(const clr_groups* groups, uint g) { return groups->of[g].batches != 0; }

// Of all batches, what is the same for every value, or else what each has; means: of the first group that has any.
CLR_FN clr_record clr_begin_joint(clr_planes base, const clr_groups* groups, clr_whole* whole, ulong i) {
    if (clr_weighs_values(groups)) return clr_weigh(base, groups, whole, i);
    uint g = 0;
    while (g + 1 < groups->count && !clr_holds(groups, g)) ++g;
    return clr_load_group(base, groups, g, i);
}

CLR_FN void clr_prefetch_group(clr_planes base, const clr_groups* groups, uint g, clr_question ask, uint pass, ulong i) {
    const bool in_turn = groups->held == groups->count;
    clr_prefetch_planes(base, clr_state_of(groups, g), ask, pass, clr_asks_line(ask) ? 3 : 2, in_turn, i + CLR_TILE);
}

// The first pass.
CLR_FN clr_record clr_pool_groups(clr_record all, clr_planes base, const clr_groups* groups, clr_whole whole,
                                  clr_question ask, ulong i) {
    const bool about_first = clr_uses_groups(ask.estimator);
    all.moments = about_first ? clr_pool_begin(all.moments) : clr_moments_none();
    all.ratios = clr_ratios_none();
    for (uint g = 0; g < groups->count; ++g) {
        if (!clr_holds(groups, g)) continue;
        const clr_record group = clr_load_group(base, groups, g, i);
        const clr_part part = clr_part_in(groups, g, group, whole);
        clr_prefetch_group(base, groups, g, ask, 0, i);
        all.moments = about_first ? clr_pool_distances(all.moments, group.moments, part.p)
                                  : clr_pool_means(all.moments, group.moments, part.p);
        if (clr_asks_within(ask)) all.moments = clr_pool_within(all.moments, group.moments);
        all.ratios = clr_pool_ratios(all.ratios, group.ratios, part.p);
    }
    return all;
}

// All but the line.
CLR_FN clr_joint clr_join_groups(clr_planes base, const clr_groups* groups, clr_whole whole, clr_evidence n, clr_real tau,
                                 clr_question ask, ulong i) {
    clr_record all = clr_begin_joint(base, groups, &whole, i);
    all = clr_pool_groups(all, base, groups, whole, ask, i);
    clr_joint j = clr_joint_means(all, whole, tau, ask.zero_policy);
    for (uint g = 0; g < groups->count; ++g) {
        if (!clr_holds(groups, g)) continue;
        const clr_record group = clr_load_group(base, groups, g, i);
        clr_prefetch_group(base, groups, g, ask, 1, i);
        j.folds = clr_fold(j.folds, j.all.moments, j.q, group.moments, clr_part_in(groups, g, group, whole));
    }
    j.spread = clr_spread_of_groups(j.all.moments, j.q.quotient, j.folds);
    j.n = n;
    return j;
}

CLR_RARE_FN clr_spread clr_spread_within(clr_planes base, const clr_groups* groups, clr_whole whole, clr_real tau,
                                         clr_question ask, ulong i) {
    ask.outputs |= CLR_WRITE_BIAS;
    return clr_join_groups(base, groups, whole, clr_evidence_of_group(groups->of[0], 0), tau, ask, i).spread;
}

CLR_FN clr_rest clr_rest_but(clr_planes base, const clr_groups* groups, uint but, ulong i) {
    clr_rest rest = clr_rest_none();
    for (uint g = 0; g < groups->count; ++g) {
        if (g == but || !clr_holds(groups, g)) continue;
        const clr_record group = clr_load_group(base, groups, g, i);
        rest = clr_rest_weigh(rest, group.moments, group.weight.hi);
    }
    rest = clr_rest_center(rest);
    for (uint g = 0; g < groups->count; ++g) {
        if (g == but || !clr_holds(groups, g)) continue;
        const clr_record group = clr_load_group(base, groups, g, i);
        rest = clr_rest_scatter(rest, group.moments, group.weight.hi);
    }
    return rest;
}

// From the beginning; where a slope is in doubt the other groups are asked.
CLR_RARE_FN void clr_cross_again(clr_cross* to, clr_planes base, const clr_groups* groups, clr_whole whole, clr_real tau,
                                 clr_question ask, ulong i) {
    const clr_joint j = clr_join_groups(base, groups, whole, clr_evidence_of_group(groups->of[0], 0), tau, ask, i);
    clr_cross c = clr_cross_begin(j.folds, j.spread);
    for (uint g = 0; g < groups->count; ++g) {
        if (!clr_holds(groups, g)) continue;
        const clr_record group = clr_load_group(base, groups, g, i);
        const clr_part part = clr_part_in(groups, g, group, j.whole);
        clr_others others = clr_others_than(c, j.all.moments, group.moments, part);
        if (clr_any(clr_slope_in_doubt(others))) {
            const clr_rest rest = clr_rest_but(base, groups, g, i);
            others = clr_settle_doubt(others, rest);
            c.untold = c.untold || clr_is_untold(others, rest);
        }
        c = clr_cross_add(c, j.all.moments, others, group.moments, part);
    }
    *to = c;
}

CLR_FN clr_joint clr_join(clr_planes base, const clr_groups* groups, clr_whole whole, clr_evidence n, clr_real tau,
                          clr_question ask, ulong i) {
    clr_joint j = clr_join_groups(base, groups, whole, n, tau, ask, i);
    if (!clr_asks_within(ask)) {
        j.spread = clr_spread_none();
        if (clr_any(clr_has_delta_error(j, tau))) j.spread = clr_spread_within(base, groups, whole, tau, ask, i);
    }
    if (!clr_asks_line(ask)) return j;
    const bool crossfits = ask.estimator == CLR_ESTIMATOR_CROSSFIT_REGRESSION;
    const clr_real slope = clr_slope_of_regression(j.spread.mt, j.spread.tt);
    j.cross = clr_cross_begin(j.folds, j.spread);
    for (uint g = 0; g < groups->count; ++g) {
        if (!clr_holds(groups, g)) continue;
        const clr_record group = clr_load_group(base, groups, g, i);
        const clr_part part = clr_part_in(groups, g, group, j.whole);
        clr_prefetch_group(base, groups, g, ask, 2, i);
        j.folds = clr_fold_line(j.folds, j.all.moments, slope, group.moments, part);
        if (!crossfits) continue;
        const clr_others others = clr_others_than(j.cross, j.all.moments, group.moments, part);
        j.cross = clr_cross_add(j.cross, j.all.moments, others, group.moments, part);
    }
    if (crossfits && clr_any(j.cross.margin < (clr_real)(0.0f))) {
        clr_cross asked;  // taken over part by part: a copy of the whole would keep j in memory
        clr_cross_again(&asked, base, groups, whole, tau, ask, i);
        j.cross.sum = asked.sum;
        j.cross.untold = asked.untold;
    }
    j.spread.line = clr_line_of_groups(j.all.moments, slope, j.folds);
    return j;
}

#else

CLR_FN clr_whole clr_whole_of_all(const clr_groups* groups) { return clr_whole_of(clr_both(0.0f, 0.0f)); }

CLR_FN clr_joint clr_join(clr_planes base, const clr_groups* groups, clr_whole whole, clr_evidence n, clr_real tau,
                          clr_question ask, ulong i) {
    clr_prefetch_planes(base, clr_state_of(groups, 0), ask, 0, 1, false, i + 8 * CLR_TILE);
    return clr_joint_of(clr_load_group(base, groups, 0, i), n, tau, ask.zero_policy);
}

#endif

typedef struct {
    clr_planes planes;
    global const float *tau, *quantiles;
    clr_outputs to;
    clr_span span;
    ulong count;
} clr_read;

// One function for all costs a read-out of one group 3 to 10 % of its time; it saves the others a quarter of theirs to
// compile.
#if defined(CLR_ESTIMATOR) && !defined(CLR_MANY_GROUPS)
#define CLR_SPAN_FN CLR_FN
#else
#define CLR_SPAN_FN CLR_WORK_FN
#endif

// What a work-item reads out.
CLR_SPAN_FN void clr_combine_span(const clr_read* w, const clr_groups* groups, const clr_reading* reading,
                                  clr_flag_tally* counts) {
    clr_question ask = reading->ask;
#if defined(CLR_ESTIMATOR)
    ask.estimator = CLR_ESTIMATOR;
    ask.outputs = CLR_ASKED;
#endif
    const bool skips = CLR_OPTIONS_OF(groups) & CLR_STATE_PER_VALUE;
    const clr_evidence n = clr_whole_evidence(groups, ask.reliability);
    const clr_whole whole = clr_whole_of_all(groups);
    clr_flag_tally tally = {{(clr_uint)(0u)}};
    for (ulong v = w->span.begin; v < w->span.end; v += w->span.step) {
        const ulong first = v * CLR_WIDTH;
        const clr_real control = clr_load_view(w->tau, reading->tau, first, w->count);
        clr_joint j = clr_join(w->planes, groups, whole, n, control, ask, first);
        if (skips)
            j.n = clr_evidence_of(j.all.batches, j.all.weight, j.all.weight2, ask.reliability);
        else
            j.all.batches = n.batches;
        const clr_real quantile = clr_quantile_for(clr_trials(j, control, ask), *reading, w->quantiles);
        const clr_estimate e = clr_read_out(j, reading->added, control, quantile, ask);
        clr_write_reading(e, *reading, ask.outputs, w->to, &tally, first, w->count);
    }
    *counts = tally;
}

kernel void clr_combine_moments(CLR_PLANE_ARGUMENTS(s), clr_groups groups, CLR_READING_ARGUMENTS, clr_range range) {
    const clr_read work = {CLR_PLANES(s), tau, quantiles, CLR_OUTPUTS, clr_my_span(range), range.count};
    clr_flag_tally tally;
    clr_combine_span(&work, &groups, &reading, &tally);
    clr_store_flag_tally(&tally, reading.ask.counted, flag_rows);
}
