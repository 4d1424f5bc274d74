// Reads estimates out of moments, or straight out of one pair of means.
// A program with CLR_ESTIMATOR is for that estimator, for states of CLR_STATE_OPTIONS, and for the outputs CLR_ASKED: what
// they do not need costs nothing, and nothing branches. One without it is for everything.
#include "clratio/device/planes.h"

kernel void clr_combine(global const float* m, clr_layout m_layout, global const float* t, clr_layout t_layout,
                        global const float* tau, clr_layout tau_layout, global float* estimate, clr_layout estimate_layout,
                        global float* flags, global ulong* flag_rows, uint zero_policy, clr_range range) {
    const clr_layout packed = {0, 1, 1};
    clr_flag_tally tally = {{(clr_uint)(0u)}};
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        const clr_plain_ratio r =
            clr_read_means(clr_load_view(m, m_layout, first, range.count), clr_load_view(t, t_layout, first, range.count),
                           clr_load_view(tau, tau_layout, first, range.count), zero_policy);
        if (estimate == m)
            clr_store_view(r.value, estimate, estimate_layout, first, range.count);
        else if (estimate)
            clr_store_apart(r.value, estimate, estimate_layout, first, range.count);
        if (flags) clr_store_apart(clr_from_bits(r.flags), flags, packed, first, range.count);
        clr_count_flags(&tally, first + CLR_WIDTH <= range.count ? r.flags : r.flags & clr_lanes_below(first, range.count),
                        0xffffffffu);
    }
    clr_store_flag_tally(&tally, flag_rows);
}

CLR_FN clr_state clr_state_of(const clr_groups* groups, uint g) {
    const clr_state s = {g, groups->count, groups->of[g], groups->options};
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

CLR_FN clr_record clr_join(clr_record all, clr_record more, const clr_groups* groups, uint g, bool with_ratios) {
    if (groups->options & CLR_STATE_PER_VALUE) return clr_record_join(all, more, with_ratios);
    const clr_member member = groups->member[g];
    clr_entry entry;
    entry.share = clr_both(member.share_hi, member.share_lo);
    entry.spread = (clr_real)(member.spread);
    all.moments = clr_moments_join(all.moments, more.moments, entry);
    if (with_ratios) all.ratios = clr_ratios_merge(all.ratios, more.ratios, entry);
    return all;
}

CLR_FN clr_part clr_part_in(const clr_groups* groups, uint g, clr_record group, clr_record all, clr_evidence whole) {
    if (groups->options & CLR_STATE_PER_VALUE) return clr_part_of(group.weight, all.weight);
    clr_part w;
    w.p = (clr_real)(groups->member[g].p);
    w.a = (clr_real)(groups->member[g].a);
    w.all = whole.weight;
    w.none = groups->of[g].batches == 0 ? clr_always() : clr_never();
    return w;
}

kernel void clr_combine_moments(CLR_PLANE_ARGUMENTS(s), clr_groups groups, CLR_READING_ARGUMENTS, clr_range range) {
    const clr_planes base = CLR_PLANES(s);
    const clr_outputs to = CLR_OUTPUTS;
    clr_question ask = reading.ask;
#if defined(CLR_ESTIMATOR)
    ask.estimator = CLR_ESTIMATOR;
    ask.outputs = CLR_ASKED;
    groups.options = CLR_STATE_OPTIONS;
#endif
    const bool skips = groups.options & CLR_STATE_PER_VALUE;
    const clr_evidence whole = clr_whole_evidence(&groups, ask.reliability);
    clr_flag_tally tally = {{(clr_uint)(0u)}};
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        const clr_real control = clr_load_view(tau, reading.tau, first, range.count);
        clr_record all = clr_load_group(base, &groups, 0, first);
#if defined(CLR_MANY_GROUPS)
        for (uint g = 1; g < groups.count; ++g) {
            all = clr_join(all, clr_load_group(base, &groups, g, first), &groups, g, clr_uses_ratios(ask.estimator));
        }
#endif
        all.moments = clr_moments_settle(all.moments);
        if (!skips) all.batches = whole.batches;
        const clr_quotient q = clr_divide_means(all.moments.m, all.moments.t, control, ask.zero_policy);
        const clr_evidence n = skips ? clr_evidence_of(all.batches, all.weight, all.weight2, ask.reliability) : whole;
        clr_folds folds = clr_folds_begin();
#if defined(CLR_MANY_GROUPS)
        for (uint g = 0; clr_uses_groups(ask.estimator) && g < groups.count; ++g) {
            const clr_record group = clr_load_group(base, &groups, g, first);
            folds = clr_fold(folds, all.moments, q, group.moments, clr_part_in(&groups, g, group, all, whole), control,
                             ask.estimator);
        }
#endif
        const clr_residual d = clr_folds_residual(ask.estimator) ? folds.residual : clr_residual_of(all.moments, q.quotient);
        const clr_estimate e = clr_read_out(all, q, d, n, folds, reading.added, control,
                                            clr_quantile_for(all.batches, reading, quantiles), ask);
        clr_write_reading(e, reading, ask.outputs, to, &tally, first, range.count);
    }
    clr_store_flag_tally(&tally, flag_rows);
}
