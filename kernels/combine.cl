// Reads estimates out of moments, or straight out of one pair of means.
// A program with CLR_ESTIMATOR is for that estimator, and for estimate, error and flags alone: what they do not need costs
// nothing. One without it is for everything.
#include "clratio/device/planes.h"

// With groups, a block of vectors is taken through one group after the other: each plane of each group is then read in runs.
// One vector at a time it would be 20 streams a group, more than prefetchers follow: measured with 8 groups, half again as
// slow.
#if defined(CLR_MANY_GROUPS) && !CLR_GROUPED
#define CLR_READ_BLOCK 16
#else
#define CLR_READ_BLOCK 1
#endif

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
        clr_count_flags(&tally, first + CLR_WIDTH <= range.count ? r.flags : r.flags & clr_lanes_below(first, range.count),
                        0xffffffffu);
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

static inline clr_two clr_weight_of(clr_groups groups, uint g) {
    return clr_both(groups.of[g].weight_hi, groups.of[g].weight_lo);
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
    for (ulong v = span.begin; v < span.end; v += CLR_READ_BLOCK * span.step) {
        const uint block = (uint)min((ulong)CLR_READ_BLOCK, (span.end - v + span.step - 1) / span.step);
        clr_record all[CLR_READ_BLOCK];
        clr_real control[CLR_READ_BLOCK];
        clr_quotient q[CLR_READ_BLOCK];
        clr_folds folds[CLR_READ_BLOCK];
        for (uint k = 0; k < block; ++k) {
            const ulong first = (v + k * span.step) * CLR_WIDTH;
            control[k] = clr_load_view(tau, reading.tau, first, range.count);
            all[k] = clr_load_record(base, first_group, first);
            all[k].moments = clr_moments_settle(all[k].moments);
            folds[k] = clr_folds_begin();
        }
        clr_two weight = clr_weight_of(groups, 0);
        for (uint g = 1; g < groups.count; ++g) {
            const clr_two sum = clr_two_add(weight, clr_weight_of(groups, g));
            const clr_entry entry = clr_entry_make(weight, clr_weight_of(groups, g), sum);
            for (uint k = 0; k < block; ++k) {
                const clr_record more = clr_load_group(base, groups, g, (v + k * span.step) * CLR_WIDTH);
                if (skips || clr_uses_ratios(ask.estimator))
                    all[k] = clr_record_merge(all[k], more, clr_uses_ratios(ask.estimator));
                else
                    all[k].moments = clr_moments_merge(all[k].moments, more.moments, entry);
            }
            weight = sum;
        }
        for (uint k = 0; k < block; ++k)
            q[k] = clr_divide_means(all[k].moments.m, all[k].moments.t, control[k], ask.zero_policy);
        for (uint g = 0; clr_uses_groups(ask.estimator) && g < groups.count; ++g) {
            const clr_part part = clr_part_of(clr_weight_of(groups, g), weight);
            for (uint k = 0; k < block; ++k) {
                const clr_record group = clr_load_group(base, groups, g, (v + k * span.step) * CLR_WIDTH);
                folds[k] = clr_fold(folds[k], all[k].moments, q[k], group.moments,
                                    skips ? clr_part_of(group.weight, all[k].weight) : part, control[k], ask.estimator);
            }
        }
        for (uint k = 0; k < block; ++k) {
            clr_record r = all[k];
            if (!skips) r.batches = whole.batches;
            const clr_evidence n = skips ? clr_evidence_of(r.batches, r.weight, r.weight2, ask.reliability) : whole;
            const clr_estimate e = clr_read_out(r, q[k], n, folds[k], reading.added, control[k],
                                                clr_quantile_for(r.batches, reading, quantiles), ask);
            clr_write_reading(e, reading, ask.outputs, to, &tally, (v + k * span.step) * CLR_WIDTH, range.count);
        }
    }
    clr_store_flag_tally(&tally, flag_rows);
}
