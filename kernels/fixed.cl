// Adds batches to a fixed-point state, merges states, reads one out as moments; looks for what a batch cannot hold.
#include "clratio/device/fixed.h"
#include "clratio/device/planes.h"

#define CLR_EACH_BATCH(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7)
#define CLR_BATCH_ARGUMENTS(k) global const float *m##k, global const float *t##k,
#define CLR_M(k) m##k,
#define CLR_T(k) t##k,

typedef struct {
    global ulong *m, *t, *mm, *tt, *mt, *weight;
    global uint* batches;
} clr_fixed_planes;

#define CLR_FIXED_ARGUMENTS(s)                                                                                              \
    global ulong *s##_m, global ulong *s##_t, global ulong *s##_mm, global ulong *s##_tt, global ulong *s##_mt,             \
        global ulong *s##_weight, global uint *s##_batches, clr_fixed_state s##_state
#define CLR_FIXED_PLANES(s)                                                                                                 \
    { s##_m, s##_t, s##_mm, s##_tt, s##_mt, s##_weight, s##_batches }

CLR_FN clr_uint clr_one_where(clr_mask m) { return m ? (clr_uint)(1u) : (clr_uint)(0u); }

CLR_FN clr_limbs clr_load_limbs(global const ulong* p, ulong stride, ulong i) {
    return clr_limbs_make(clr_load(p + i), clr_load(p + stride + i));
}

CLR_FN void clr_store_limbs(clr_limbs v, global ulong* p, ulong stride, ulong i) {
    clr_store(v.lo, p + i);
    clr_store(v.hi, p + stride + i);
}

// A state without batches is zero, whatever its planes hold: they are never cleared.
CLR_FN clr_fixed clr_load_fixed(clr_fixed_planes p, clr_fixed_state s, ulong i) {
    clr_fixed r;
    if (s.batches == 0) {
        const clr_wide zero = (clr_wide)(0UL);
        r.m = r.t = r.weight = zero;
        r.mm = r.tt = r.mt = clr_limbs_make(zero, zero);
        r.batches = (clr_uint)(0u);
        return r;
    }
    r.m = clr_load(p.m + i);
    r.t = clr_load(p.t + i);
    r.mm = clr_load_limbs(p.mm, s.stride, i);
    r.tt = clr_load_limbs(p.tt, s.stride, i);
    r.mt = clr_load_limbs(p.mt, s.stride, i);
    r.weight = (clr_wide)(s.weight);
    r.batches = (clr_uint)(s.batches);
    if (s.per_value) {
        r.weight = clr_load(p.weight + i);
        r.batches = clr_load(p.batches + i);
    }
    return r;
}

CLR_FN void clr_store_fixed(clr_fixed v, clr_fixed_planes p, clr_fixed_state s, ulong i) {
    clr_store(v.m, p.m + i);
    clr_store(v.t, p.t + i);
    clr_store_limbs(v.mm, p.mm, s.stride, i);
    clr_store_limbs(v.tt, p.tt, s.stride, i);
    clr_store_limbs(v.mt, p.mt, s.stride, i);
    if (!s.per_value) return;
    clr_store(v.weight, p.weight + i);
    clr_store(v.batches, p.batches + i);
}

typedef struct {
    clr_uint negative, skipped, outside;
} clr_fixed_tally;

CLR_FN clr_fixed_tally clr_fixed_tally_zero(void) {
    clr_fixed_tally r;
    r.negative = r.skipped = r.outside = (clr_uint)(0u);
    return r;
}

CLR_FN void clr_fixed_count(clr_fixed_tally* tally, clr_real m, clr_real t, clr_real limit) {
    const clr_real zero = (clr_real)(0.0f);
    tally->negative += clr_one_where(m < zero) + clr_one_where(t < zero);
    const clr_uint refused = clr_one_where(!clr_fixed_takes(m, t, limit));
    tally->skipped += refused;
    tally->outside += refused & clr_one_where(clr_is_finite(m) && clr_is_finite(t));
}

CLR_FN void clr_fixed_tell(const clr_fixed_tally* tally, global ulong* rows) {
    rows += get_global_id(0) * CLR_FIXED_TALLY;
    rows[CLR_FIXED_TALLY_NEGATIVE] += clr_sum_lanes(tally->negative);
    rows[CLR_FIXED_TALLY_SKIPPED] += clr_sum_lanes(tally->skipped);
    rows[CLR_FIXED_TALLY_OUTSIDE] += clr_sum_lanes(tally->outside);
}

// What a work-item adds, and what it counts.
typedef struct {
    global const float *m[CLR_FIXED_BATCHES_PER_LAUNCH], *t[CLR_FIXED_BATCHES_PER_LAUNCH];
    const clr_fixed_batches* batches;
    clr_fixed_planes planes;
    clr_fixed_state state;
    ulong count;
    clr_fixed_tally tally;
} clr_fixed_adder;

CLR_WORK_FN void clr_add_fixed_span(clr_fixed_adder* a, clr_span span) {
    const clr_real limit = (clr_real)(a->state.limit), scale = (clr_real)(a->state.scale);
    clr_fixed_tally tally = clr_fixed_tally_zero();
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        clr_fixed_run run = clr_fixed_run_zero();
        for (uint k = 0; k < a->batches->count; ++k) {
            const clr_real m = clr_load_view(a->m[k], a->batches->of[k].m, first, a->count);
            const clr_real t = clr_load_view(a->t[k], a->batches->of[k].t, first, a->count);
            clr_fixed_count(&tally, m, t, limit);
            run = clr_fixed_take(run, m, t, scale, limit);
        }
        const clr_fixed sum = clr_load_fixed(a->planes, a->state, first);
        clr_store_fixed(clr_fixed_add(sum, run, a->batches->weight), a->planes, a->state, first);
    }
    a->tally = tally;
}

kernel void clr_add_fixed(CLR_EACH_BATCH(CLR_BATCH_ARGUMENTS) clr_fixed_batches batches, CLR_FIXED_ARGUMENTS(s),
                          global ulong* rows, clr_range range) {
    clr_fixed_adder a = {
        {CLR_EACH_BATCH(CLR_M)}, {CLR_EACH_BATCH(CLR_T)}, &batches, CLR_FIXED_PLANES(s), s_state, range.count};
    clr_add_fixed_span(&a, clr_my_span(range));
    clr_fixed_tell(&a.tally, rows);
}

kernel void clr_merge_fixed(CLR_FIXED_ARGUMENTS(a), CLR_FIXED_ARGUMENTS(b), global ulong* a_rows, global const ulong* b_rows,
                            ulong row_words, clr_range range) {
    for (ulong i = get_global_id(0); i < row_words; i += get_global_size(0)) a_rows[i] += b_rows[i];
    const clr_fixed_planes to = CLR_FIXED_PLANES(a), from = CLR_FIXED_PLANES(b);
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        const clr_fixed sum = clr_fixed_merge(clr_load_fixed(to, a_state, first), clr_load_fixed(from, b_state, first));
        clr_store_fixed(sum, to, a_state, first);
    }
}

// What a work-item reads out.
typedef struct {
    clr_fixed_planes from;
    clr_fixed_state state;
    clr_planes to;
    clr_state to_state;
} clr_fixed_read;

CLR_WORK_FN void clr_read_fixed_span(const clr_fixed_read* r, clr_span span) {
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        const clr_fixed sum = clr_load_fixed(r->from, r->state, first);
        clr_store_moments(clr_fixed_moments(sum, r->state.resolution), r->to, r->to_state, first);
        if (r->state.per_value)
            clr_store_evidence(clr_fixed_weight(sum.weight), clr_both(0.0f, 0.0f), sum.batches, r->to, r->to_state, first);
    }
}

kernel void clr_read_fixed(CLR_FIXED_ARGUMENTS(s), global const ulong* from_rows, CLR_PLANE_ARGUMENTS(to),
                           clr_state to_state, global ulong* to_rows, ulong items, clr_range range) {
    for (ulong i = get_global_id(0); i < items; i += get_global_size(0)) {
        to_rows[i * CLR_TALLY_ADD + CLR_TALLY_NEGATIVE] = from_rows[i * CLR_FIXED_TALLY + CLR_FIXED_TALLY_NEGATIVE];
        to_rows[i * CLR_TALLY_ADD + CLR_TALLY_SKIPPED] = from_rows[i * CLR_FIXED_TALLY + CLR_FIXED_TALLY_SKIPPED];
    }
    const clr_fixed_read work = {CLR_FIXED_PLANES(s), s_state, CLR_PLANES(to), to_state};
    clr_read_fixed_span(&work, clr_my_span(range));
}

// What the state would count of one batch, without adding it.
kernel void clr_scan_fixed(global const float* m, clr_layout m_layout, global const float* t, clr_layout t_layout,
                           float limit, global ulong* rows, clr_range range) {
    clr_fixed_tally tally = clr_fixed_tally_zero();
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        clr_fixed_count(&tally, clr_load_view(m, m_layout, first, range.count),
                        clr_load_view(t, t_layout, first, range.count), (clr_real)(limit));
    }
    clr_fixed_tell(&tally, rows);
}
