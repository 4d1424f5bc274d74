// Adds batches to a state of moments, reads out in the same pass where asked; merges states; scans for non-finite input.
#include "clratio/device/planes.h"

#define CLR_EACH_BATCH(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7)
#define CLR_BATCH_ARGUMENTS(k) global const float *m##k, global const float *t##k,
#define CLR_M(k) m##k,
#define CLR_T(k) t##k,

static inline clr_uint clr_one_where(clr_mask m) { return m ? (clr_uint)(1u) : (clr_uint)(0u); }

static inline clr_two clr_spread_lanes(float hi, float lo) { return clr_two_make((clr_real)(hi), (clr_real)(lo)); }

static inline clr_record clr_add_good(clr_record r, clr_real m, clr_real t, const clr_batch* batch, clr_state s) {
    clr_entry e;
    e.share = clr_spread_lanes(batch->share_hi, batch->share_lo);
    e.spread = clr_spread_lanes(batch->spread_hi, batch->spread_lo);
    r.moments = clr_moments_add(r.moments, m, t, e);
    if (s.options & CLR_STATE_RATIOS) r.ratios = clr_ratios_add(r.ratios, m, t, e);
    r.weight = clr_two_add(r.weight, clr_spread_lanes(batch->weight_hi, batch->weight_lo));
    r.batches += (clr_uint)(1u);
    return r;
}

static inline clr_record clr_add_where(clr_record r, clr_mask good, clr_real m, clr_real t, const clr_batch* batch, clr_state s) {
    const clr_real zero = (clr_real)(0.0f);
    const clr_two weight = clr_spread_lanes(batch->weight_hi, batch->weight_lo);
    const clr_two added = clr_two_make(good ? weight.hi : zero, good ? weight.lo : zero);
    const clr_two sum = clr_two_add(r.weight, added);
    const clr_entry e = clr_entry_make(r.weight, added, sum);
    m = good ? m : zero;
    t = good ? t : zero;
    r.moments = clr_moments_add(r.moments, m, t, e);
    if (s.options & CLR_STATE_RATIOS) r.ratios = clr_ratios_add(r.ratios, m, t, e);
    r.weight = sum;
    r.batches += clr_one_where(good);
    return r;
}

kernel void clr_add(CLR_EACH_BATCH(CLR_BATCH_ARGUMENTS) clr_batches batches, CLR_PLANE_ARGUMENTS(s), global ulong* add_rows,
                    CLR_READING_ARGUMENTS, clr_range range) {
    global const float* const m_of[CLR_BATCHES_PER_LAUNCH] = {CLR_EACH_BATCH(CLR_M)};
    global const float* const t_of[CLR_BATCHES_PER_LAUNCH] = {CLR_EACH_BATCH(CLR_T)};
    const clr_planes planes = CLR_PLANES(s);
    const clr_real zero = (clr_real)(0.0f);
    clr_uint negative = (clr_uint)(0u), skipped = (clr_uint)(0u);
    clr_flag_tally tally = {{(clr_uint)(0u)}};

    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        clr_record r = clr_load_record(planes, s_state, first);
        for (uint k = 0; k < batches.count; ++k) {
            const clr_batch batch = batches.of[k];
            const clr_real m = clr_load_view(m_of[k], batch.m, first, range.count);
            const clr_real t = clr_load_view(t_of[k], batch.t, first, range.count);
            negative += clr_one_where(m < zero) + clr_one_where(t < zero);
            if (s_state.options & CLR_STATE_PER_VALUE) {
                const clr_mask good = clr_is_finite(m) && clr_is_finite(t);
                skipped += clr_one_where(!good);
                r = clr_add_where(r, good, m, t, &batch, s_state);
            } else {
                r = clr_add_good(r, m, t, &batch, s_state);
            }
        }
        clr_store_record(r, planes, s_state, first);
        if (reading.outputs) {
            const clr_real control = clr_load_view(tau, reading.tau, first, range.count);
            const clr_estimate e = clr_read_record(r, s_state.batches + batches.count, control, reading);
            clr_write_reading(e, reading, estimate, error, flags, &tally, first, range.count);
        }
    }
    add_rows[get_global_id(0) * CLR_TALLY_ADD + CLR_TALLY_NEGATIVE] += clr_sum_lanes(negative);
    add_rows[get_global_id(0) * CLR_TALLY_ADD + CLR_TALLY_SKIPPED] += clr_sum_lanes(skipped);
    if (reading.outputs) clr_store_flag_tally(&tally, flag_rows);
}

kernel void clr_merge(CLR_PLANE_ARGUMENTS(a), CLR_PLANE_ARGUMENTS(b), global ulong* a_rows, global const ulong* b_rows,
                      ulong row_words, clr_range range) {
    for (ulong i = get_global_id(0); i < row_words; i += get_global_size(0)) a_rows[i] += b_rows[i];
    const clr_planes to = CLR_PLANES(a), from = CLR_PLANES(b);
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        clr_record r = clr_load_record(to, a_state, first);
        const clr_record other = clr_load_record(from, b_state, first);
        const clr_two sum = clr_two_add(r.weight, other.weight);
        const clr_entry e = clr_entry_make(r.weight, other.weight, sum);
        r.moments = clr_moments_merge(r.moments, other.moments, e);
        if (a_state.options & CLR_STATE_RATIOS) r.ratios = clr_ratios_merge(r.ratios, other.ratios, e);
        r.weight = sum;
        r.batches += other.batches;
        clr_store_record(r, to, a_state, first);
    }
}

// rows[work-item] = how many values of m or t are NaN or infinite.
kernel void clr_scan(global const float* m, clr_layout m_layout, global const float* t, clr_layout t_layout, global ulong* rows,
                     clr_range range) {
    clr_uint bad = (clr_uint)(0u);
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        bad += clr_one_where(!clr_is_finite(clr_load_view(m, m_layout, first, range.count))) +
               clr_one_where(!clr_is_finite(clr_load_view(t, t_layout, first, range.count)));
    }
    rows[get_global_id(0)] = clr_sum_lanes(bad);
}
