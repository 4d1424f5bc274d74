// Reads estimates out of moments, or straight out of one pair of means.
// A program with CLR_ESTIMATOR is for that estimator, and for estimate, error and flags alone: what they do not need costs
// nothing. One without it is for everything.
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
        if (estimate) clr_store_view(r.value, estimate, estimate_layout, first, range.count);
        if (flags) clr_store_view(clr_from_bits(r.flags), flags, packed, first, range.count);
        clr_count_flags(&tally, first + CLR_WIDTH <= range.count ? r.flags : r.flags & clr_lanes_below(first, range.count));
    }
    clr_store_flag_tally(&tally, flag_rows);
}

static inline clr_state clr_state_of(clr_groups groups, uint g) {
    const clr_state s = {2 * g * groups.stride, groups.stride, groups.of[g], groups.options};
    return s;
}

static inline clr_record clr_load_group(clr_planes base, clr_groups groups, uint g, ulong i) {
    const clr_state s = clr_state_of(groups, g);
    return clr_load_record(clr_planes_at(base, s.base), s, i);
}

// What the batches of all groups are worth together, where no value has skipped any.
static inline clr_evidence clr_whole_evidence(clr_groups groups, uint reliability) {
    clr_group sum = groups.of[0];
    clr_two weight = clr_both(sum.weight_hi, sum.weight_lo), weight2 = clr_both(sum.weight2_hi, sum.weight2_lo);
    for (uint g = 1; g < groups.count; ++g) {
        const clr_group more = groups.of[g];
        sum.batches += more.batches;
        weight = clr_two_add(weight, clr_both(more.weight_hi, more.weight_lo));
        weight2 = clr_two_add(weight2, clr_both(more.weight2_hi, more.weight2_lo));
    }
    return clr_evidence_of((clr_uint)(sum.batches), weight, weight2, reliability);
}

kernel void clr_combine_moments(CLR_PLANE_ARGUMENTS(s), clr_groups groups, CLR_READING_ARGUMENTS, clr_range range) {
    const clr_planes base = CLR_PLANES(s);
    const clr_outputs to = CLR_OUTPUTS;
    clr_question ask = reading.ask;
#if defined(CLR_ESTIMATOR)
    ask.estimator = CLR_ESTIMATOR;
    ask.outputs &= CLR_WRITE_ESTIMATE | CLR_WRITE_ERROR | CLR_WRITE_FLAGS;
#endif
    const clr_state first_group = clr_state_of(groups, 0);
    const clr_evidence whole = clr_whole_evidence(groups, ask.reliability);
    const bool skips = groups.options & CLR_STATE_PER_VALUE;
    clr_flag_tally tally = {{(clr_uint)(0u)}};
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        const clr_real control = clr_load_view(tau, reading.tau, first, range.count);
        clr_record all = clr_load_record(base, first_group, first);
        all.moments = clr_moments_settle(all.moments);
        for (uint g = 1; g < groups.count; ++g)
            all = clr_record_merge(all, clr_load_group(base, groups, g, first), clr_uses_ratios(ask.estimator));
        const clr_quotient q = clr_divide_means(all.moments.m, all.moments.t, control, ask.zero_policy);
        clr_folds folds = clr_folds_begin();
        if (clr_uses_groups(ask.estimator))
            for (uint g = 0; g < groups.count; ++g)
                folds = clr_fold(folds, all, q, clr_load_group(base, groups, g, first), control, ask.estimator);
        const clr_evidence n = skips ? clr_evidence_of(all.batches, all.weight, all.weight2, ask.reliability) : whole;
        const clr_estimate e =
            clr_read_out(all, q, n, folds, reading.added, control, clr_quantile_for(all.batches, reading, quantiles), ask);
        clr_write_reading(e, reading, ask.outputs, to, &tally, first, range.count);
    }
    clr_store_flag_tally(&tally, flag_rows);
}
