// A state's planes in device memory, the batches that enter it, and what is read out of it.
#ifndef CLRATIO_DEVICE_PLANES_H
#define CLRATIO_DEVICE_PLANES_H

#include "clratio/device/estimator.h"
#include "clratio/device/layout.h"

CLR_NAMESPACE_BEGIN

#define CLR_BATCHES_PER_LAUNCH 8

// One batch of a launch. share and spread are the clr_entry, and sum and sum2 the weight and the sum of squared weights
// after it, of a value that skipped nothing.
typedef struct {
    clr_layout m, t;
    float weight_hi, weight_lo, share_hi, share_lo, spread, sum_hi, sum_lo, sum2_hi, sum2_lo;
} clr_batch;

typedef struct {
    clr_batch of[CLR_BATCHES_PER_LAUNCH];
    clr_u32 count, packed;  // packed: every view is contiguous
} clr_batches;

#define CLR_STATE_PER_VALUE 1u    // weight and batch count are planes
#define CLR_STATE_RATIOS 2u       // the planes of clr_ratios are there
#define CLR_STATE_RELIABILITY 4u  // weight2 is kept, a plane with CLR_STATE_PER_VALUE

#define CLR_MOST_GROUPS 16

// What all values of a group share; unless CLR_STATE_PER_VALUE, its weight.
typedef struct {
    clr_u32 batches;
    float weight_hi, weight_lo, weight2_hi, weight2_lo;
} clr_group;

// A plane lies in tiles of CLR_TILE values: for each group in turn their hi parts, then their lo parts. So a pass over a
// state reads few streams, in long runs, however many groups there are.
#define CLR_TILE 32

// One group of a state: its place among the groups of each tile.
typedef struct {
    clr_u32 place, groups;
    clr_group group;
    clr_u32 options;
} clr_state;

// Where no value has skipped a batch: a group's clr_part of them all.
typedef struct {
    float p_hi, p_lo, a, apart;
} clr_member;

// All groups of a state.
typedef struct {
    clr_u32 options, count, held;  // held: those that have a batch
    clr_group of[CLR_MOST_GROUPS];
    clr_member member[CLR_MOST_GROUPS];
} clr_groups;

typedef struct {
    clr_layout tau, estimate, error, bias, lower, upper, gain, needed;
    clr_question ask;
    float quantile;            // of the interval, for all batches
    clr_u32 quantiles, added;  // quantiles[]: how many there are, for 0, 1, .. batches; batches offered so far
} clr_reading;

// A work-item's row of counters while adding, and while reading out: one for each flag, then values with any flag.
#define CLR_TALLY_NEGATIVE 0
#define CLR_TALLY_SKIPPED 1
#define CLR_TALLY_ADD 2
#define CLR_TALLY_FLAGS (CLR_FLAG_BITS + 1)

#if defined(__OPENCL_C_VERSION__)

typedef struct {
    global float *m, *t, *mm, *tt, *mt, *weight, *weight2, *batches, *quotient, *zero_m, *zero_share;
} clr_planes;

#define CLR_PLANE_ARGUMENTS(s)                                                                                              \
    global float *s##_m, global float *s##_t, global float *s##_mm, global float *s##_tt, global float *s##_mt,             \
        global float *s##_weight, global float *s##_weight2, global float *s##_batches, global float *s##_quotient,         \
        global float *s##_zero_m, global float *s##_zero_share
#define CLR_PLANES(s)                                                                                                       \
    { s##_m, s##_t, s##_mm, s##_tt, s##_mt, s##_weight, s##_weight2, s##_batches, s##_quotient, s##_zero_m, s##_zero_share }

// Where the values from i on have their elements in a plane of one element each; i is the first of a vector.
CLR_FN ulong clr_element(clr_state s, ulong i) { return (i / CLR_TILE * s.groups + s.place) * CLR_TILE + i % CLR_TILE; }

// The same for hi parts; lo parts are CLR_TILE further.
CLR_FN ulong clr_element_of_two(clr_state s, ulong i) {
    return (i / CLR_TILE * s.groups + s.place) * (2 * CLR_TILE) + i % CLR_TILE;
}

CLR_FN clr_two clr_both(float hi, float lo) { return clr_two_make((clr_real)(hi), (clr_real)(lo)); }

CLR_FN clr_evidence clr_evidence_of_group(clr_group g, uint reliability) {
    return clr_evidence_of((clr_uint)(g.batches), clr_both(g.weight_hi, g.weight_lo), clr_both(g.weight2_hi, g.weight2_lo),
                           reliability);
}

CLR_FN void clr_store_two(clr_two v, global float* p, clr_state s, ulong i) {
    clr_store(v.hi, p + clr_element_of_two(s, i));
    clr_store(v.lo, p + clr_element_of_two(s, i) + CLR_TILE);
}

// A group without batches is zero, whatever its planes hold: they are never cleared.
CLR_FN clr_two clr_load_plane(global const float* p, clr_state s, ulong i) {
    if (s.group.batches == 0) return clr_both(0.0f, 0.0f);
    p += clr_element_of_two(s, i);
    return clr_two_make(clr_load(p), clr_load(p + CLR_TILE));
}

CLR_FN clr_moments clr_load_moments(clr_planes p, clr_state s, ulong i) {
    clr_moments r;
    r.m = clr_load_plane(p.m, s, i);
    r.t = clr_load_plane(p.t, s, i);
    r.mm = clr_load_plane(p.mm, s, i);
    r.tt = clr_load_plane(p.tt, s, i);
    r.mt = clr_load_plane(p.mt, s, i);
    return r;
}

#define CLR_LINE 16  // floats of a cache line

// Two floats for each lane of a vector, each cache line once.
CLR_FN void clr_prefetch_vector(global const float* p) {
    CLR_UNROLL
    for (int k = 0; k < 2 * CLR_WIDTH; k += CLR_LINE) clr_prefetch(p + k);
}

// A vector's share of the hi and lo parts that a group has in a tile.
CLR_FN void clr_prefetch_two(global const float* p, clr_state s, ulong i) {
    clr_prefetch_vector(p + (i / CLR_TILE * s.groups + s.place) * (2 * CLR_TILE) + i % CLR_TILE * 2);
}

CLR_FN void clr_prefetch_moments(clr_planes p, clr_state s, ulong i) {
    clr_prefetch_two(p.m, s, i);
    clr_prefetch_two(p.t, s, i);
    clr_prefetch_two(p.mm, s, i);
    clr_prefetch_two(p.tt, s, i);
    clr_prefetch_two(p.mt, s, i);
}

// A group's turn in a vector's share of what all groups have in a tile. If every group takes its turn, lines are asked for
// in the order of their addresses, and a processor sees one run.
CLR_FN void clr_prefetch_turn(global const float* p, clr_state s, ulong i) {
    const ulong vector = i % CLR_TILE / CLR_WIDTH;
    clr_prefetch_vector(p + i / CLR_TILE * s.groups * (2 * CLR_TILE) + (vector * s.groups + s.place) * (2 * CLR_WIDTH));
}

// Whether a plane's turn is in this pass: memory answers only so many requests at a time, so each pass over the groups makes
// its share of them, the later ones more.
CLR_FN bool clr_has_turn(uint plane, uint planes, uint pass, uint passes) {
    const uint turn = (plane + 1) * passes - 1;
    return turn >= pass * planes && turn < (pass + 1) * planes;
}

// The planes of an estimator: several are more streams than a processor fetches ahead by itself. i may lie past the end.
CLR_FN void clr_prefetch_planes(clr_planes p, clr_state s, clr_question ask, uint pass, uint passes, bool in_turn, ulong i) {
    const bool mean = ask.estimator == CLR_ESTIMATOR_MEAN, averages = ask.estimator == CLR_ESTIMATOR_MEAN_OF_RATIOS;
    const bool pair = !mean && !averages, scatter = !averages && clr_asks_scatter(ask), both = pair && scatter;
    const bool ratios = clr_uses_ratios(ask.estimator), flags = (ask.outputs & (CLR_WRITE_FLAGS | CLR_COUNT_FLAGS)) != 0;
    global const float* planes[] = {p.m, p.t, p.mm, p.tt, p.mt, p.quotient, p.zero_m, p.zero_share};
    const bool reads[] = {true, pair, scatter, both, both, ratios, averages, averages || (ratios && flags)};
    uint count = 0, plane = 0;
    CLR_UNROLL
    for (uint k = 0; k < 8; ++k) count += reads[k] ? 1 : 0;
    CLR_UNROLL
    for (uint k = 0; k < 8; ++k)
        if (reads[k] && clr_has_turn(plane++, count, pass, passes)) {
            if (in_turn)
                clr_prefetch_turn(planes[k], s, i);
            else
                clr_prefetch_two(planes[k], s, i);
        }
}

CLR_FN void clr_store_moments(clr_moments r, clr_planes p, clr_state s, ulong i) {
    clr_store_two(r.m, p.m, s, i);
    clr_store_two(r.t, p.t, s, i);
    clr_store_two(r.mm, p.mm, s, i);
    clr_store_two(r.tt, p.tt, s, i);
    clr_store_two(r.mt, p.mt, s, i);
}

CLR_FN void clr_store_evidence(clr_two weight, clr_two weight2, clr_uint batches, clr_planes p, clr_state s, ulong i) {
    clr_store_two(weight, p.weight, s, i);
    if (s.options & CLR_STATE_RELIABILITY) clr_store_two(weight2, p.weight2, s, i);
    clr_store(clr_from_bits(batches), p.batches + clr_element(s, i));
}

CLR_FN clr_ratios clr_load_ratios(clr_planes p, clr_state s, ulong i) {
    clr_ratios r;
    r.quotient = clr_load_plane(p.quotient, s, i);
    r.zero_m = clr_load_plane(p.zero_m, s, i);
    r.zero_share = clr_load_plane(p.zero_share, s, i);
    return r;
}

CLR_FN clr_uint clr_load_batches(clr_planes p, clr_state s, ulong i) {
    return s.group.batches == 0 ? (clr_uint)(0u) : clr_bits(clr_load(p.batches + clr_element(s, i)));
}

CLR_FN void clr_store_ratios(clr_ratios r, clr_planes p, clr_state s, ulong i) {
    clr_store_two(r.quotient, p.quotient, s, i);
    clr_store_two(r.zero_m, p.zero_m, s, i);
    clr_store_two(r.zero_share, p.zero_share, s, i);
}

CLR_FN clr_record clr_load_record(clr_planes p, clr_state s, ulong i) {
    clr_record r;
    r.moments = clr_load_moments(p, s, i);
    r.weight = clr_both(s.group.weight_hi, s.group.weight_lo);
    r.weight2 = clr_both(s.group.weight2_hi, s.group.weight2_lo);
    r.batches = (clr_uint)(s.group.batches);
    if (s.options & CLR_STATE_PER_VALUE) {
        r.weight = clr_load_plane(p.weight, s, i);
        if (s.options & CLR_STATE_RELIABILITY) r.weight2 = clr_load_plane(p.weight2, s, i);
        r.batches = clr_load_batches(p, s, i);
    }
    r.ratios.quotient = r.ratios.zero_m = r.ratios.zero_share = clr_both(0.0f, 0.0f);
    if (s.options & CLR_STATE_RATIOS) r.ratios = clr_load_ratios(p, s, i);
    return r;
}

CLR_FN void clr_store_record(clr_record r, clr_planes p, clr_state s, ulong i) {
    clr_store_moments(r.moments, p, s, i);
    if (s.options & CLR_STATE_PER_VALUE) clr_store_evidence(r.weight, r.weight2, r.batches, p, s, i);
    if (s.options & CLR_STATE_RATIOS) clr_store_ratios(r.ratios, p, s, i);
}

CLR_FN ulong clr_sum_lanes(clr_uint v) {
    uint lane[CLR_WIDTH];
    clr_store(v, lane);
    ulong sum = 0;
    for (int i = 0; i < CLR_WIDTH; ++i) sum += lane[i];
    return sum;
}

// All ones in the lanes first + lane < count, else 0.
CLR_FN clr_uint clr_lanes_below(ulong first, ulong count) {
    uint lane[CLR_WIDTH];
    for (int i = 0; i < CLR_WIDTH; ++i) lane[i] = first + i < count ? 0xffffffffu : 0u;
    return clr_load(lane);
}

// Neighbours mostly have the same flags: vectors that do are counted together. All 0 to begin with.
typedef struct {
    clr_uint of[CLR_TALLY_FLAGS], last;
    uint times;  // how often `last` came and is not yet counted
} clr_flag_tally;

CLR_FN void clr_settle_flags(clr_flag_tally* tally, uint counted) {
    const clr_uint times = (clr_uint)(tally->times), zero = (clr_uint)(0u);
    tally->times = 0;
    if (!clr_any(tally->last != zero)) return;
    for (uint bit = 0; bit < CLR_FLAG_BITS; ++bit)
        tally->of[bit] += (tally->last & (clr_uint)(1u << bit)) != zero ? times : zero;
    tally->of[CLR_FLAG_BITS] += (tally->last & (clr_uint)(counted)) != zero ? times : zero;
}

CLR_FN void clr_count_flags(clr_flag_tally* tally, clr_uint flags, uint counted) {
    if (clr_any(flags != tally->last)) {
        clr_settle_flags(tally, counted);
        tally->last = flags;
    }
    ++tally->times;
}

CLR_FN void clr_store_flag_tally(clr_flag_tally* tally, uint counted, global ulong* rows) {
    if (!rows) return;
    clr_settle_flags(tally, counted);
    for (uint k = 0; k < CLR_TALLY_FLAGS; ++k) rows[get_global_id(0) * CLR_TALLY_FLAGS + k] = clr_sum_lanes(tally->of[k]);
}

#define CLR_READING_ARGUMENTS                                                                                               \
    global const float *tau, global float *estimate, global float *error, global float *bias, global float *lower,          \
        global float *upper, global float *kind, global float *gain, global float *needed, global float *flags,             \
        global ulong *flag_rows, global const float *quantiles, clr_reading reading
#define CLR_OUTPUTS                                                                                                         \
    { estimate, error, bias, lower, upper, kind, gain, needed, flags }

typedef struct {
    global float *estimate, *error, *bias, *lower, *upper, *kind, *gain, *needed, *flags;
} clr_outputs;

// The interval's quantile for each value's own number of trials; beyond the table, that of the whole state.
CLR_FN clr_real clr_quantile_for(clr_uint trials, clr_reading reading, global const float* quantiles) {
    if (reading.quantiles == 0) return (clr_real)(reading.quantile);
    uint count[CLR_WIDTH];
    float lane[CLR_WIDTH];
    clr_store(trials, count);
    for (int i = 0; i < CLR_WIDTH; ++i) lane[i] = count[i] < reading.quantiles ? quantiles[count[i]] : reading.quantile;
    return clr_load(lane);
}

CLR_FN void clr_write_reading(clr_estimate e, clr_reading reading, uint wanted, clr_outputs to, clr_flag_tally* tally,
                              ulong first, ulong count) {
    const clr_layout packed = {0, 1, 1};
    if (wanted & CLR_WRITE_ESTIMATE) clr_store_apart(e.value, to.estimate, reading.estimate, first, count);
    if (wanted & CLR_WRITE_ERROR) clr_store_apart(e.error, to.error, reading.error, first, count);
    if (wanted & CLR_WRITE_BIAS) clr_store_apart(e.bias, to.bias, reading.bias, first, count);
    if (wanted & CLR_WRITE_LOWER) clr_store_apart(e.lower, to.lower, reading.lower, first, count);
    if (wanted & CLR_WRITE_UPPER) clr_store_apart(e.upper, to.upper, reading.upper, first, count);
    if (wanted & CLR_WRITE_KIND) clr_store_apart(clr_from_bits(e.kind), to.kind, packed, first, count);
    if (wanted & CLR_WRITE_GAIN) clr_store_apart(e.gain, to.gain, reading.gain, first, count);
    if (wanted & CLR_WRITE_NEEDED) clr_store_apart(e.needed, to.needed, reading.needed, first, count);
    if (wanted & CLR_WRITE_FLAGS) clr_store_apart(clr_from_bits(e.flags), to.flags, packed, first, count);
    if (wanted & CLR_COUNT_FLAGS)
        clr_count_flags(tally, first + CLR_WIDTH <= count ? e.flags : e.flags & clr_lanes_below(first, count),
                        reading.ask.counted);
}

#endif

CLR_NAMESPACE_END

#endif
