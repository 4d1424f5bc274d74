// Adds batches to a state of moments, reads out in the same pass where asked; merges states; scans for non-finite input.
#include "clratio/device/planes.h"

#define CLR_EACH_BATCH(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7)
#define CLR_BATCH_ARGUMENTS(k) global const float *m##k, global const float *t##k,
#define CLR_M(k) m##k,
#define CLR_T(k) t##k,

CLR_FN clr_uint clr_one_where(clr_mask m) { return m ? (clr_uint)(1u) : (clr_uint)(0u); }

CLR_FN clr_entry clr_entry_of(const clr_batch* batch) {
    clr_entry e;
    e.share = clr_both(batch->share_hi, batch->share_lo);
    e.spread = (clr_real)(batch->spread);
    return e;
}

// The inputs of one launch.
typedef struct {
    global const float *m[CLR_BATCHES_PER_LAUNCH], *t[CLR_BATCHES_PER_LAUNCH];
} clr_inputs;

// A block of vectors stays in the first cache while the batches go over it one by one: neighbours do not wait for each
// other, and few streams run through memory at a time. GPUs keep one vector in registers.
#if CLR_GROUPED
#define CLR_BLOCK 1
#elif CLR_WIDTH == 32
#define CLR_BLOCK 16
#else
#define CLR_BLOCK 32
#endif

typedef struct {
    clr_moments moments[CLR_BLOCK];
} clr_block;

CLR_FN clr_real clr_lost_before(clr_planes planes, clr_state s, ulong i) {
    if (!(s.options & CLR_STATE_PER_VALUE)) return (clr_real)(0.0f);
    return clr_load_batches(planes, s, i) == (clr_uint)(s.group.batches) ? (clr_real)(0.0f) : (clr_real)(1.0f);
}

CLR_FN clr_real clr_lesser(clr_real a, clr_real b) { return a < b ? a : b; }

// 0 where no batch was left out before, and none has made a mean infinite or NaN.
CLR_FN clr_real clr_doubt(clr_moments s, clr_real lost) {
    const clr_real zero = (clr_real)(0.0f);
    return clr_fma(s.m.hi, zero, clr_fma(s.t.hi, zero, lost));
}

// Batch k over a block of whole vectors of contiguous values. The first pass takes the state from the planes, the last one
// puts it back, save for vectors in doubt: those it returns, a bit each, untouched.
CLR_FN uint clr_pass(const bool is_first, const bool is_last, uint k, const clr_inputs* in, const clr_batches* batches,
                     clr_block* block, clr_planes planes, clr_state s, ulong first, clr_real* least) {
    const clr_batch batch = batches->of[k];
    global const float* m_from = in->m[k] + batch.m.offset + first;
    global const float* t_from = in->t[k] + batch.t.offset + first;
    const bool skips = s.options & CLR_STATE_PER_VALUE;
    const clr_entry e = clr_entry_of(&batch);
    clr_real low = *least;
    uint doubtful = 0;
    for (uint v = 0; v < CLR_BLOCK; ++v) {
        const ulong at = first + v * CLR_WIDTH;
        const clr_real m = clr_load(m_from + v * CLR_WIDTH), t = clr_load(t_from + v * CLR_WIDTH);
        const clr_moments moments =
            clr_moments_add(is_first ? clr_load_moments(planes, s, at) : block->moments[v], m, t, e, s.group.batches + k);
        low = clr_lesser(m, clr_lesser(t, low));
        if (!is_last) {
            block->moments[v] = moments;
        } else if (skips && clr_any(clr_doubt(moments, clr_lost_before(planes, s, at)) != (clr_real)(0.0f))) {
            doubtful |= 1u << v;
        } else {
            clr_store_moments(moments, planes, s, at);
            if (skips)
                clr_store_evidence(clr_both(batch.sum_hi, batch.sum_lo), clr_both(batch.sum2_hi, batch.sum2_lo),
                                   (clr_uint)(s.group.batches + batches->count), planes, s, at);
        }
    }
    *least = low;
    return doubtful;
}

CLR_FN clr_uint clr_count_negative(const clr_inputs* in, const clr_batches* batches, ulong first) {
    const clr_real zero = (clr_real)(0.0f);
    clr_uint negative = (clr_uint)(0u);
    for (uint k = 0; k < batches->count; ++k) {
        global const float* m_from = in->m[k] + batches->of[k].m.offset + first;
        global const float* t_from = in->t[k] + batches->of[k].t.offset + first;
        for (uint v = 0; v < CLR_BLOCK; ++v)
            negative += clr_one_where(clr_load(m_from + v * CLR_WIDTH) < zero) +
                        clr_one_where(clr_load(t_from + v * CLR_WIDTH) < zero);
    }
    return negative;
}

CLR_FN uint clr_add_block(const clr_inputs* in, const clr_batches* batches, clr_planes planes, clr_state s, ulong first,
                          clr_uint* negative) {
    clr_block block;
    clr_real least = (clr_real)(0.0f);
    uint doubtful;
    const uint last = batches->count - 1;
    if (last == 0) {
        doubtful = clr_pass(true, true, 0, in, batches, &block, planes, s, first, &least);
    } else {
        clr_pass(true, false, 0, in, batches, &block, planes, s, first, &least);
        for (uint k = 1; k < last; ++k) clr_pass(false, false, k, in, batches, &block, planes, s, first, &least);
        doubtful = clr_pass(false, true, last, in, batches, &block, planes, s, first, &least);
    }
    if (clr_any(least < (clr_real)(0.0f))) *negative += clr_count_negative(in, batches, first);
    return doubtful;
}

// Any vector: each value has a share of its own in each batch.
CLR_FN void clr_add_vector(const clr_inputs* in, const clr_batches* batches, clr_planes planes, clr_state s, ulong first,
                           ulong count, clr_uint* negative, clr_uint* skipped) {
    const clr_real zero = (clr_real)(0.0f);
    const bool skips = s.options & CLR_STATE_PER_VALUE;
    clr_record r = clr_load_record(planes, s, first);
    for (uint k = 0; k < batches->count; ++k) {
        const clr_batch batch = batches->of[k];
        const clr_real m = clr_load_view(in->m[k], batch.m, first, count);
        const clr_real t = clr_load_view(in->t[k], batch.t, first, count);
        const clr_mask bad = skips ? !(clr_is_finite(m) && clr_is_finite(t)) : zero != zero;
        const clr_two added =
            clr_two_make(bad ? zero : (clr_real)(batch.weight_hi), bad ? zero : (clr_real)(batch.weight_lo));
        const clr_two sum = clr_two_add(r.weight, added);
        const clr_entry e = clr_entry_make(r.weight, added, sum);
        r.moments = clr_moments_add(r.moments, bad ? zero : m, bad ? zero : t, e, s.group.batches + k);
        if (s.options & CLR_STATE_RATIOS) r.ratios = clr_ratios_add(r.ratios, bad ? zero : m, bad ? zero : t, e);
        r.weight = sum;
        if (s.options & CLR_STATE_RELIABILITY) r.weight2 = clr_two_add(r.weight2, clr_two_square(added));
        r.batches += clr_one_where(!bad);
        *negative += clr_one_where(m < zero) + clr_one_where(t < zero);
        *skipped += clr_one_where(bad);
    }
    clr_store_record(r, planes, s, first);
}

kernel void clr_add(CLR_EACH_BATCH(CLR_BATCH_ARGUMENTS) clr_batches batches, CLR_PLANE_ARGUMENTS(s), clr_state s_state,
                    global ulong* add_rows, CLR_READING_ARGUMENTS, clr_range range) {
    const clr_inputs in = {{CLR_EACH_BATCH(CLR_M)}, {CLR_EACH_BATCH(CLR_T)}};
    const clr_planes planes = CLR_PLANES(s);
    const clr_outputs to = CLR_OUTPUTS;
    clr_question ask = reading.ask;
    ask.estimator = min(ask.estimator, CLR_ESTIMATOR_MEAN_OF_RATIOS);
    ask.outputs &= CLR_WRITE_ESTIMATE | CLR_WRITE_ERROR | CLR_WRITE_FLAGS | CLR_COUNT_FLAGS;
    const bool plain = batches.packed && !(s_state.options & CLR_STATE_RATIOS);
    const clr_batch last = batches.of[batches.count - 1];
    const clr_group grown = {s_state.group.batches + batches.count, last.sum_hi, last.sum_lo, last.sum2_hi, last.sum2_lo};
    clr_state after = s_state;
    after.group = grown;
    const bool skips = s_state.options & CLR_STATE_PER_VALUE;
    const clr_evidence whole = clr_evidence_of_group(grown, ask.reliability);
    clr_uint negative = (clr_uint)(0u), skipped = (clr_uint)(0u);
    clr_flag_tally tally = {{(clr_uint)(0u)}};

    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end;) {
        const ulong first = v * CLR_WIDTH;
        const bool in_block = plain && v + CLR_BLOCK <= span.end && first + CLR_BLOCK * CLR_WIDTH <= range.count;
        const ulong done = in_block ? CLR_BLOCK : 1;
        clr_uint counted = (clr_uint)(0u);
        uint left = in_block ? clr_add_block(&in, &batches, planes, s_state, first, &negative) : 1u;
        for (ulong at = first; left; left >>= 1, at += CLR_WIDTH)
            if (left & 1u)
                clr_add_vector(&in, &batches, planes, s_state, at, range.count, in_block ? &counted : &negative, &skipped);
        if (ask.outputs)
            for (ulong k = 0; k < done; ++k) {
                const ulong at = first + k * CLR_WIDTH;
                const clr_real control = clr_load_view(tau, reading.tau, at, range.count);
                clr_record r = clr_load_record(planes, after, at);
                r.moments = clr_moments_settle(r.moments);
                const clr_quotient q = clr_divide_means(r.moments.m, r.moments.t, control, ask.zero_policy);
                const clr_evidence n = skips ? clr_evidence_of(r.batches, r.weight, r.weight2, ask.reliability) : whole;
                const clr_estimate e = clr_read_out(r, q, clr_residual_of(r.moments, q.quotient), n, clr_folds_begin(),
                                                    reading.added, control, (clr_real)(0.0f), ask);
                clr_write_reading(e, reading, ask.outputs, to, &tally, at, range.count);
            }
        v += done * span.step;
    }
    add_rows[get_global_id(0) * CLR_TALLY_ADD + CLR_TALLY_NEGATIVE] += clr_sum_lanes(negative);
    add_rows[get_global_id(0) * CLR_TALLY_ADD + CLR_TALLY_SKIPPED] += clr_sum_lanes(skipped);
    if (ask.outputs) clr_store_flag_tally(&tally, flag_rows);
}

// entry: how b enters a for values that skipped nothing on either side; row_words of counters are added too.
kernel void clr_merge(CLR_PLANE_ARGUMENTS(a), clr_state a_state, CLR_PLANE_ARGUMENTS(b), clr_state b_state, clr_batch entry,
                      global ulong* a_rows, global const ulong* b_rows, ulong row_words, clr_range range) {
    for (ulong i = get_global_id(0); i < row_words; i += get_global_size(0)) a_rows[i] += b_rows[i];
    const clr_planes to = CLR_PLANES(a), from = CLR_PLANES(b);
    const clr_real zero = (clr_real)(0.0f);
    const bool skips = a_state.options & CLR_STATE_PER_VALUE;
    const clr_two whole = clr_both(entry.sum_hi, entry.sum_lo), whole2 = clr_both(entry.sum2_hi, entry.sum2_lo);
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        if (skips && clr_any(clr_lost_before(to, a_state, first) + clr_lost_before(from, b_state, first) != zero)) {
            const clr_record a = clr_load_record(to, a_state, first), b = clr_load_record(from, b_state, first);
            clr_store_record(clr_record_merge(a, b, (a_state.options & CLR_STATE_RATIOS) != 0), to, a_state, first);
            continue;
        }
        const clr_entry e = clr_entry_of(&entry);
        const clr_moments moments = clr_load_moments(to, a_state, first), more = clr_load_moments(from, b_state, first);
        clr_store_moments(clr_moments_merge(moments, more, e), to, a_state, first);
        if (skips)
            clr_store_evidence(whole, whole2, (clr_uint)(a_state.group.batches + b_state.group.batches), to, a_state, first);
        if (a_state.options & CLR_STATE_RATIOS) {
            const clr_ratios sum =
                clr_ratios_merge(clr_load_ratios(to, a_state, first), clr_load_ratios(from, b_state, first), e);
            clr_store_ratios(sum, to, a_state, first);
        }
    }
}

// rows[work-item] = how many values of m or t are NaN or infinite.
kernel void clr_scan(global const float* m, clr_layout m_layout, global const float* t, clr_layout t_layout,
                     global ulong* rows, clr_range range) {
    clr_uint bad = (clr_uint)(0u);
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        bad += clr_one_where(!clr_is_finite(clr_load_view(m, m_layout, first, range.count))) +
               clr_one_where(!clr_is_finite(clr_load_view(t, t_layout, first, range.count)));
    }
    rows[get_global_id(0)] = clr_sum_lanes(bad);
}
