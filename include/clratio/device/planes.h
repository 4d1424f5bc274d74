// A state's planes in device memory, the batches that enter it, and what is read out of it.
#ifndef CLRATIO_DEVICE_PLANES_H
#define CLRATIO_DEVICE_PLANES_H

#include "clratio/device/layout.h"
#include "clratio/device/ratio.h"

CLR_NAMESPACE_BEGIN

#define CLR_BATCHES_PER_LAUNCH 8

// One batch of a launch. share and spread are the clr_entry, and sum the weight after it, of a value that skipped nothing.
typedef struct {
    clr_layout m, t;
    float weight_hi, weight_lo, share_hi, share_lo, spread_hi, spread_lo, sum_hi, sum_lo;
} clr_batch;

typedef struct {
    clr_batch of[CLR_BATCHES_PER_LAUNCH];
    clr_u32 count, packed;  // packed: every view is contiguous
} clr_batches;

#define CLR_STATE_PER_VALUE 1u  // weight and batch count are planes
#define CLR_STATE_RATIOS 2u     // the planes of clr_ratios are there

// What holds for a whole state: its plane stride in elements and, unless CLR_STATE_PER_VALUE, its weight.
typedef struct {
    clr_u64 stride;
    clr_u32 options, batches;
    float weight_hi, weight_lo;
} clr_state;

#define CLR_WRITE_ESTIMATE 1u
#define CLR_WRITE_ERROR 2u
#define CLR_WRITE_FLAGS 4u

typedef struct {
    clr_layout tau, estimate, error;
    clr_u32 estimator, zero_policy, outputs, unused;
} clr_reading;

// A work-item's row of counters while adding, and while reading out: one for each flag, then values with any flag.
#define CLR_TALLY_NEGATIVE 0
#define CLR_TALLY_SKIPPED 1
#define CLR_TALLY_ADD 2
#define CLR_TALLY_FLAGS (CLR_FLAG_BITS + 1)

#if defined(__OPENCL_C_VERSION__)

typedef struct {
    global float *m, *t, *mm, *tt, *mt, *weight, *batches, *quotient, *zero_m, *zero_share;
} clr_planes;

#define CLR_PLANE_ARGUMENTS(s)                                                                                              \
    global float *s##_m, global float *s##_t, global float *s##_mm, global float *s##_tt, global float *s##_mt,             \
        global float *s##_weight, global float *s##_batches, global float *s##_quotient, global float *s##_zero_m,          \
        global float *s##_zero_share, clr_state s##_state
#define CLR_PLANES(s)                                                                                                       \
    { s##_m, s##_t, s##_mm, s##_tt, s##_mt, s##_weight, s##_batches, s##_quotient, s##_zero_m, s##_zero_share }

// Everything a state knows of CLR_WIDTH values.
typedef struct {
    clr_moments moments;
    clr_ratios ratios;
    clr_two weight;
    clr_uint batches;
} clr_record;

static inline clr_two clr_load_two(global const float* p, ulong i, ulong stride) {
    return clr_two_make(clr_load(p + i), clr_load(p + stride + i));
}

static inline void clr_store_two(clr_two v, global float* p, ulong i, ulong stride) {
    clr_store(v.hi, p + i);
    clr_store(v.lo, p + stride + i);
}

static inline clr_two clr_two_zero(void) { return clr_two_make((clr_real)(0.0f), (clr_real)(0.0f)); }

// A state without batches is zero, whatever its planes hold: they are never cleared.
static inline clr_two clr_load_plane(global const float* p, clr_state s, ulong i) {
    return s.batches == 0 ? clr_two_zero() : clr_load_two(p, i, s.stride);
}

static inline clr_moments clr_load_moments(clr_planes p, clr_state s, ulong i) {
    clr_moments r;
    r.m = clr_load_plane(p.m, s, i);
    r.t = clr_load_plane(p.t, s, i);
    r.mm = clr_load_plane(p.mm, s, i);
    r.tt = clr_load_plane(p.tt, s, i);
    r.mt = clr_load_plane(p.mt, s, i);
    return r;
}

static inline void clr_store_moments(clr_moments s, clr_planes p, ulong stride, ulong i) {
    clr_store_two(s.m, p.m, i, stride);
    clr_store_two(s.t, p.t, i, stride);
    clr_store_two(s.mm, p.mm, i, stride);
    clr_store_two(s.tt, p.tt, i, stride);
    clr_store_two(s.mt, p.mt, i, stride);
}

static inline void clr_store_evidence(clr_two weight, clr_uint batches, clr_planes p, ulong stride, ulong i) {
    clr_store_two(weight, p.weight, i, stride);
    clr_store(clr_from_bits(batches), p.batches + i);
}

static inline clr_ratios clr_load_ratios(clr_planes p, clr_state s, ulong i) {
    clr_ratios r;
    r.quotient = clr_load_plane(p.quotient, s, i);
    r.zero_m = clr_load_plane(p.zero_m, s, i);
    r.zero_share = clr_load_plane(p.zero_share, s, i);
    return r;
}

static inline clr_uint clr_load_batches(clr_planes p, clr_state s, ulong i) {
    return s.batches == 0 ? (clr_uint)(0u) : clr_bits(clr_load(p.batches + i));
}

static inline void clr_store_ratios(clr_ratios r, clr_planes p, ulong stride, ulong i) {
    clr_store_two(r.quotient, p.quotient, i, stride);
    clr_store_two(r.zero_m, p.zero_m, i, stride);
    clr_store_two(r.zero_share, p.zero_share, i, stride);
}

static inline clr_record clr_load_record(clr_planes p, clr_state s, ulong i) {
    clr_record r;
    r.moments = clr_load_moments(p, s, i);
    if (s.options & CLR_STATE_PER_VALUE) {
        r.weight = clr_load_plane(p.weight, s, i);
        r.batches = clr_load_batches(p, s, i);
    } else {
        r.weight = clr_two_make((clr_real)(s.weight_hi), (clr_real)(s.weight_lo));
        r.batches = (clr_uint)(s.batches);
    }
    r.ratios.quotient = r.ratios.zero_m = r.ratios.zero_share = clr_two_zero();
    if (s.options & CLR_STATE_RATIOS) r.ratios = clr_load_ratios(p, s, i);
    return r;
}

static inline void clr_store_record(clr_record r, clr_planes p, clr_state s, ulong i) {
    clr_store_moments(r.moments, p, s.stride, i);
    if (s.options & CLR_STATE_PER_VALUE) clr_store_evidence(r.weight, r.batches, p, s.stride, i);
    if (s.options & CLR_STATE_RATIOS) clr_store_ratios(r.ratios, p, s.stride, i);
}

static inline clr_estimate clr_read_record(clr_record r, uint added, clr_real tau, clr_reading reading) {
    clr_evidence n;
    n.batches = r.batches;
    n.weight = r.weight.hi;
    return clr_read_out(r.moments, r.ratios, n, added, tau, reading.estimator, reading.zero_policy,
                        (reading.outputs & CLR_WRITE_ERROR) != 0);
}

static inline ulong clr_sum_lanes(clr_uint v) {
    uint lane[CLR_WIDTH];
    clr_store(v, lane);
    ulong sum = 0;
    for (int i = 0; i < CLR_WIDTH; ++i) sum += lane[i];
    return sum;
}

// All ones in the lanes first + lane < count, else 0.
static inline clr_uint clr_lanes_below(ulong first, ulong count) {
    uint lane[CLR_WIDTH];
    for (int i = 0; i < CLR_WIDTH; ++i) lane[i] = first + i < count ? 0xffffffffu : 0u;
    return clr_load(lane);
}

typedef struct {
    clr_uint of[CLR_TALLY_FLAGS];
} clr_flag_tally;

static inline void clr_count_flags(clr_flag_tally* tally, clr_uint flags) {
    if (!clr_any(flags != (clr_uint)(0u))) return;
    for (uint bit = 0; bit < CLR_FLAG_BITS; ++bit) tally->of[bit] += (flags >> bit) & (clr_uint)(1u);
    tally->of[CLR_FLAG_BITS] += flags != (clr_uint)(0u) ? (clr_uint)(1u) : (clr_uint)(0u);
}

static inline void clr_store_flag_tally(const clr_flag_tally* tally, global ulong* rows) {
    if (!rows) return;
    for (uint k = 0; k < CLR_TALLY_FLAGS; ++k) rows[get_global_id(0) * CLR_TALLY_FLAGS + k] = clr_sum_lanes(tally->of[k]);
}

#define CLR_READING_ARGUMENTS                                                                                               \
    global const float *tau, global float *estimate, global float *error, global float *flags, global ulong *flag_rows,     \
        clr_reading reading

static inline void clr_write_reading(clr_estimate e, clr_reading reading, global float* estimate, global float* error,
                                     global float* flags, clr_flag_tally* tally, ulong first, ulong count) {
    const clr_layout packed = {0, 1, 1};
    if (reading.outputs & CLR_WRITE_ESTIMATE) clr_store_view(e.value, estimate, reading.estimate, first, count);
    if (reading.outputs & CLR_WRITE_ERROR) clr_store_view(e.error, error, reading.error, first, count);
    if (reading.outputs & CLR_WRITE_FLAGS) clr_store_view(clr_from_bits(e.flags), flags, packed, first, count);
    clr_count_flags(tally, first + CLR_WIDTH <= count ? e.flags : e.flags & clr_lanes_below(first, count));
}

#endif

CLR_NAMESPACE_END

#endif
