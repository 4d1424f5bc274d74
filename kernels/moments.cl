// Adds batches to a state of moments; merges states; scans for non-finite input. A program with CLR_ASKED adds and reads
// out in one pass: CLR_ESTIMATOR and those outputs, of states of CLR_STATE_OPTIONS, or with CLR_STATELESS of none.
#include "clratio/device/planes.h"

#define CLR_EACH_BATCH(X) X(0) X(1) X(2) X(3) X(4) X(5) X(6) X(7)
#define CLR_BATCH_ARGUMENTS(k) global const float *m##k, global const float *t##k,

CLR_FN clr_uint clr_one_where(clr_mask m) { return m ? (clr_uint)(1u) : (clr_uint)(0u); }

CLR_FN clr_entry clr_entry_of(const clr_batch* batch) {
    clr_entry e;
    e.share = clr_both(batch->share_hi, batch->share_lo);
    e.spread = (clr_real)(batch->spread);
    return e;
}

// What a work-item adds, and what it counts.
typedef struct {
    global const float *m[CLR_BATCHES_PER_LAUNCH], *t[CLR_BATCHES_PER_LAUNCH];
    const clr_batches* batches;
    clr_planes planes;
    clr_state state;
    ulong count;
    clr_uint negative, skipped;
} clr_adder;

// Its options are constants where the program knows them, which a pointer hides.
CLR_FN clr_state clr_state_of(const clr_adder* a) {
    clr_state s = a->state;
#if defined(CLR_STATE_OPTIONS)
    s.options = CLR_STATE_OPTIONS;
#endif
    return s;
}

CLR_FN bool clr_has(const clr_adder* a, uint option) { return (clr_state_of(a).options & option) != 0; }
CLR_FN bool clr_skips(const clr_adder* a) { return clr_has(a, CLR_STATE_PER_VALUE); }

// A block of vectors stays in the first cache while the batches go over it one by one: neighbours do not wait for each
// other, and few streams run through memory at a time. GPUs keep one vector in registers.
#if CLR_GROUPED
#define CLR_BLOCK 1
#elif CLR_WIDTH >= 16
#define CLR_BLOCK 16
#else
#define CLR_BLOCK 32
#endif

typedef struct {
    clr_moments moments[CLR_BLOCK];
} clr_block;

// 1 where a batch was left out before this launch.
CLR_FN clr_real clr_lost_before(clr_planes planes, clr_state s, ulong i) {
    if (!(s.options & CLR_STATE_PER_VALUE)) return (clr_real)(0.0f);
    return clr_load_batches(planes, s, i) == (clr_uint)(s.group.batches) ? (clr_real)(0.0f) : (clr_real)(1.0f);
}

// Whether some value has lost a batch, or a mean is infinite or NaN, which tells that a batch was.
CLR_FN bool clr_in_doubt(clr_moments s, clr_real lost) {
    const clr_real zero = (clr_real)(0.0f);
    return clr_any(clr_fma(s.m.hi, zero, clr_fma(s.t.hi, zero, lost)) != zero);
}

// Left to clr_add_vector.
CLR_FN bool clr_is_doubtful(const bool keeps, const clr_adder* a, clr_moments moments, ulong first) {
    if (!clr_skips(a)) return false;
    return clr_in_doubt(moments, keeps ? clr_lost_before(a->planes, clr_state_of(a), first) : (clr_real)(0.0f));
}

CLR_FN clr_state clr_grown(const clr_adder* a) {
    const clr_batch last = a->batches->of[a->batches->count - 1];
    const clr_group group = {a->state.group.batches + a->batches->count, last.sum_hi, last.sum_lo, last.sum2_hi,
                             last.sum2_lo};
    clr_state grown = clr_state_of(a);
    grown.group = group;
    return grown;
}

// Of a vector whose values all have the same evidence.
CLR_FN void clr_put_back(clr_moments moments, const clr_adder* a, ulong at) {
    clr_store_moments(moments, a->planes, clr_state_of(a), at);
    if (!clr_skips(a)) return;
    const clr_group g = clr_grown(a).group;
    clr_store_evidence(clr_both(g.weight_hi, g.weight_lo), clr_both(g.weight2_hi, g.weight2_lo), (clr_uint)(g.batches),
                       a->planes, clr_state_of(a), at);
}

// What is fetched ahead together: a cache line of values, or a vector where that is more or is the block.
#define CLR_CHUNK (CLR_WIDTH < CLR_LINE && CLR_BLOCK > 1 ? CLR_LINE : CLR_WIDTH)

// The plane of the state whose turn it is to be fetched ahead, while batch k goes over a block.
CLR_FN global const float* clr_plane_at_turn(clr_planes p, uint k) {
    return k == 1 ? p.m : k == 2 ? p.t : k == 3 ? p.mm : k == 4 ? p.tt : k == 5 ? p.mt : 0;
}

// A chunk of m, t and, unless it is 0, a plane. Any address will do.
CLR_FN void clr_prefetch_chunk(global const float* m, global const float* t, global const float* plane, clr_state s,
                               ulong at) {
    CLR_UNROLL
    for (uint c = 0; c < CLR_CHUNK; c += CLR_LINE) {
        clr_prefetch(m + c);
        clr_prefetch(t + c);
    }
    if (!plane) return;
    CLR_UNROLL
    for (uint c = 0; c < CLR_CHUNK; c += CLR_WIDTH) clr_prefetch_two(plane, s, at + c);
}

// Batch k over a block of whole vectors of contiguous values. The first pass takes the state from the planes. The last one
// puts it back, save for vectors in doubt, of which it gives a bit each.
CLR_FN uint clr_pass(const bool is_first, const bool is_last, uint k, clr_block* block, const clr_adder* a, ulong first,
                     clr_uint* all_signs) {
    const clr_batch batch = a->batches->of[k];
    global const float* m_from = a->m[k] + batch.m.offset + first;
    global const float* t_from = a->t[k] + batch.t.offset + first;
    const clr_entry e = clr_entry_of(&batch);
    const uint index = a->state.group.batches + k;
    const ulong ahead = CLR_BLOCK * CLR_WIDTH;
    global const float* plane = is_first || is_last ? 0 : clr_plane_at_turn(a->planes, k);
    clr_uint signs = *all_signs;
    uint doubtful = 0;
    for (uint chunk = 0; chunk < CLR_BLOCK * CLR_WIDTH; chunk += CLR_CHUNK) {
        clr_prefetch_chunk(m_from + ahead + chunk, t_from + ahead + chunk, plane, clr_state_of(a), first + ahead + chunk);
        for (uint c = chunk; c < chunk + CLR_CHUNK; c += CLR_WIDTH) {
            const uint v = c / CLR_WIDTH;
            const clr_real m = clr_load(m_from + c), t = clr_load(t_from + c);
            signs |= clr_bits(m) | clr_bits(t);
            const clr_moments before =
                is_first ? clr_load_moments(a->planes, clr_state_of(a), first + c) : block->moments[v];
            const clr_moments moments = clr_moments_add(before, m, t, e, index);
            if (!is_last)
                block->moments[v] = moments;
            else if (clr_is_doubtful(true, a, moments, first + c))
                doubtful |= 1u << v;
            else
                clr_put_back(moments, a, first + c);
        }
    }
    *all_signs = signs;
    return doubtful;
}

CLR_FN void clr_count_negative(clr_adder* a, ulong first) {
    const clr_real zero = (clr_real)(0.0f);
    for (uint k = 0; k < a->batches->count; ++k) {
        global const float* m_from = a->m[k] + a->batches->of[k].m.offset + first;
        global const float* t_from = a->t[k] + a->batches->of[k].t.offset + first;
        for (uint v = 0; v < CLR_BLOCK; ++v)
            a->negative += clr_one_where(clr_load(m_from + v * CLR_WIDTH) < zero) +
                           clr_one_where(clr_load(t_from + v * CLR_WIDTH) < zero);
    }
}

// A bit for each vector that is left to clr_add_vector.
CLR_FN uint clr_add_block(clr_adder* a, ulong first) {
    clr_block block;
    clr_uint signs = (clr_uint)(0u);
    uint doubtful;
    const uint last = a->batches->count - 1;
    if (last == 0) {
        doubtful = clr_pass(true, true, 0, &block, a, first, &signs);
    } else {
        clr_pass(true, false, 0, &block, a, first, &signs);
        for (uint k = 1; k < last; ++k) clr_pass(false, false, k, &block, a, first, &signs);
        doubtful = clr_pass(false, true, last, &block, a, first, &signs);
    }
    if (clr_any(signs >= (clr_uint)(0x80000000u))) clr_count_negative(a, first);
    return doubtful;
}

// The same for a block that stays. Of no state it is one pass over and over: a small program is loaded sooner.
CLR_FN uint clr_fill_block(const bool keeps, clr_block* block, clr_adder* a, ulong first) {
    clr_uint signs = (clr_uint)(0u);
    if (keeps)
        clr_pass(true, false, 0, block, a, first, &signs);
    else
        for (uint v = 0; v < CLR_BLOCK; ++v) block->moments[v] = clr_moments_none();
    for (uint k = keeps ? 1 : 0; k < a->batches->count; ++k) clr_pass(false, false, k, block, a, first, &signs);
    if (clr_any(signs >= (clr_uint)(0x80000000u))) clr_count_negative(a, first);
    uint doubtful = 0;
    for (uint v = 0; clr_skips(a) && v < CLR_BLOCK; ++v)
        doubtful |= clr_is_doubtful(keeps, a, block->moments[v], first + v * CLR_WIDTH) ? 1u << v : 0u;
    return doubtful;
}

// Any vector: each value has a share of its own in each batch.
CLR_FN clr_record clr_add_vector(clr_adder* a, ulong first, const bool count_negative) {
    const clr_real zero = (clr_real)(0.0f);
    clr_record r = clr_load_record(a->planes, clr_state_of(a), first);
    for (uint k = 0; k < a->batches->count; ++k) {
        const clr_batch batch = a->batches->of[k];
        const clr_real m = clr_load_view(a->m[k], batch.m, first, a->count);
        const clr_real t = clr_load_view(a->t[k], batch.t, first, a->count);
        const clr_mask bad = clr_skips(a) ? !(clr_is_finite(m) && clr_is_finite(t)) : zero != zero;
        const clr_two added =
            clr_two_make(bad ? zero : (clr_real)(batch.weight_hi), bad ? zero : (clr_real)(batch.weight_lo));
        const clr_two sum = clr_two_add(r.weight, added);
        const clr_entry e = clr_entry_make(r.weight, added, sum);
        r.moments = clr_moments_add(r.moments, bad ? zero : m, bad ? zero : t, e, a->state.group.batches + k);
        if (clr_has(a, CLR_STATE_RATIOS)) r.ratios = clr_ratios_add(r.ratios, bad ? zero : m, bad ? zero : t, e);
        r.weight = sum;
        if (clr_has(a, CLR_STATE_RELIABILITY)) r.weight2 = clr_two_add(r.weight2, clr_two_square(added));
        r.batches += clr_one_where(!bad);
        if (count_negative) a->negative += clr_one_where(m < zero) + clr_one_where(t < zero);
        a->skipped += clr_one_where(bad);
    }
    return r;
}

CLR_FN clr_adder clr_adder_make(const clr_batches* batches, clr_planes planes, clr_state s, ulong count) {
    clr_adder a;
    a.batches = batches;
    a.planes = planes;
    a.state = s;
    a.count = count;
    a.negative = a.skipped = (clr_uint)(0u);
    return a;
}
#define CLR_TAKE_INPUT(k)                                                                                                   \
    a.m[k] = m##k;                                                                                                          \
    a.t[k] = t##k;

CLR_FN bool clr_is_block(const clr_adder* a, ulong v, clr_span span) {
    return a->batches->packed && !clr_has(a, CLR_STATE_RATIOS) && v + CLR_BLOCK <= span.end &&
           (v + CLR_BLOCK) * CLR_WIDTH <= a->count;
}

CLR_FN void clr_store_add_tally(const clr_adder* a, global ulong* rows) {
    rows += get_global_id(0) * CLR_TALLY_ADD;
    rows[CLR_TALLY_NEGATIVE] += clr_sum_lanes(a->negative);
    rows[CLR_TALLY_SKIPPED] += clr_sum_lanes(a->skipped);
}

#if defined(CLR_ASKED)

typedef struct {
    const clr_reading* reading;
    global const float *tau, *quantiles;
    clr_outputs to;
    clr_evidence whole;  // of a value that has lost no batch
    clr_flag_tally tally;
} clr_reader;

// As clr_combine_moments reads it out of the planes.
CLR_FN void clr_read_record(clr_record r, clr_evidence n, clr_reader* reader, ulong first, ulong count) {
    clr_question ask = reader->reading->ask;
    ask.estimator = CLR_ESTIMATOR;
    ask.outputs = CLR_ASKED;
    const clr_real control = clr_load_view(reader->tau, reader->reading->tau, first, count);
    const clr_estimate e = clr_read_out(clr_joint_of(r, n, control, ask.zero_policy), reader->reading->added, control,
                                        clr_quantile_for(r.batches, *reader->reading, reader->quantiles), ask);
    clr_write_reading(e, *reader->reading, ask.outputs, reader->to, &reader->tally, first, count);
}

// The only batch of a launch over a vector of a block.
CLR_FN clr_moments clr_add_one(const bool keeps, const clr_adder* a, ulong first, clr_uint* signs) {
    const clr_batch batch = a->batches->of[0];
    global const float* m_from = a->m[0] + batch.m.offset + first;
    global const float* t_from = a->t[0] + batch.t.offset + first;
    clr_prefetch(m_from + CLR_BLOCK * CLR_WIDTH);
    clr_prefetch(t_from + CLR_BLOCK * CLR_WIDTH);
    const clr_real m = clr_load(m_from), t = clr_load(t_from);
    *signs |= clr_bits(m) | clr_bits(t);
    const clr_moments before = keeps ? clr_load_moments(a->planes, clr_state_of(a), first) : clr_moments_none();
    return clr_moments_add(before, m, t, clr_entry_of(&batch), a->state.group.batches);
}

// What the same vector of the next block needs besides m and t: while a block is read out nothing else reads memory.
CLR_FN void clr_prefetch_next(const bool keeps, const clr_adder* a, const clr_reader* reader, ulong first) {
    const ulong next = first + CLR_BLOCK * CLR_WIDTH;
    if (keeps) clr_prefetch_moments(a->planes, clr_state_of(a), next);
    clr_prefetch(reader->tau + reader->reading->tau.offset + next);
}

// All but the moments of values that have lost no batch.
CLR_FN clr_record clr_record_of_all(clr_group g) {
    clr_record r;
    r.weight = clr_both(g.weight_hi, g.weight_lo);
    r.weight2 = clr_both(g.weight2_hi, g.weight2_lo);
    r.batches = (clr_uint)(g.batches);
    r.ratios.quotient = r.ratios.zero_m = r.ratios.zero_share = clr_both(0.0f, 0.0f);
    return r;
}

// What a work-item adds and reads out. A block stays in the cache while several batches go over it, and is read out then.
// One batch is added and read out vector by vector, in three quarters of the time: neither memory nor arithmetic waits.
CLR_WORK_FN void clr_add_and_read(const bool keeps, clr_adder* a, clr_reader* reader, clr_span span) {
    const clr_record whole = clr_record_of_all(clr_grown(a).group);
    const bool one = a->batches->count == 1;
    for (ulong v = span.begin; v < span.end;) {
        const bool in_block = clr_is_block(a, v, span);
        const ulong done = in_block ? CLR_BLOCK : 1, first = v * CLR_WIDTH;
        clr_uint signs = (clr_uint)(0u);
        clr_block block;
        const uint doubtful = !in_block ? 1u : one ? 0u : clr_fill_block(keeps, &block, a, first);
        for (uint k = 0; k < done; ++k) {
            const ulong at = first + k * CLR_WIDTH;
            clr_record r = whole;
            clr_evidence n = reader->whole;
            bool alone = doubtful >> k & 1u;
            if (in_block) {
                clr_prefetch_next(keeps, a, reader, at);
                r.moments = one ? clr_add_one(keeps, a, at, &signs) : block.moments[k];
                alone = alone || (one && clr_is_doubtful(keeps, a, r.moments, at));
            }
            if (alone) {
                r = clr_add_vector(a, at, !in_block);
                if (keeps) clr_store_record(r, a->planes, clr_state_of(a), at);
                if (clr_skips(a)) n = clr_evidence_of(r.batches, r.weight, r.weight2, reader->reading->ask.reliability);
            } else if (keeps) {
                clr_put_back(r.moments, a, at);
            }
            clr_read_record(r, n, reader, at, a->count);
        }
        if (clr_any(signs >= (clr_uint)(0x80000000u))) clr_count_negative(a, first);
        v += done * span.step;
    }
}

#define CLR_MAKE_READER(a)                                                                                                  \
    clr_reader reader = {&reading,                                                                                          \
                         tau,                                                                                               \
                         quantiles,                                                                                         \
                         CLR_OUTPUTS,                                                                                       \
                         clr_evidence_of_group(clr_grown(&a).group, reading.ask.reliability),                               \
                         {{(clr_uint)(0u)}}};

#if !defined(CLR_STATELESS)

kernel void clr_add_and_combine(CLR_EACH_BATCH(CLR_BATCH_ARGUMENTS) clr_batches batches, CLR_PLANE_ARGUMENTS(s),
                                clr_state s_state, global ulong* add_rows, CLR_READING_ARGUMENTS, clr_range range) {
    const clr_planes planes = CLR_PLANES(s);
    clr_adder a = clr_adder_make(&batches, planes, s_state, range.count);
    CLR_EACH_BATCH(CLR_TAKE_INPUT)
    CLR_MAKE_READER(a)
    clr_add_and_read(true, &a, &reader, clr_my_span(range));
    clr_store_add_tally(&a, add_rows);
    clr_store_flag_tally(&reader.tally, reading.ask.counted, flag_rows);
}

#else

// The batches are all there are.
kernel void clr_combine_batches(CLR_EACH_BATCH(CLR_BATCH_ARGUMENTS) clr_batches batches, global ulong* add_rows,
                                CLR_READING_ARGUMENTS, clr_range range) {
    const clr_planes none = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
    const clr_state empty = {0, 1, {0, 0.0f, 0.0f, 0.0f, 0.0f}, CLR_STATE_OPTIONS};
    clr_adder a = clr_adder_make(&batches, none, empty, range.count);
    CLR_EACH_BATCH(CLR_TAKE_INPUT)
    CLR_MAKE_READER(a)
    clr_add_and_read(false, &a, &reader, clr_my_span(range));
    clr_store_add_tally(&a, add_rows);
    clr_store_flag_tally(&reader.tally, reading.ask.counted, flag_rows);
}

#endif

#else

// What a work-item adds.
CLR_WORK_FN void clr_add_span(clr_adder* a, clr_span span) {
    for (ulong v = span.begin; v < span.end;) {
        const bool in_block = clr_is_block(a, v, span);
        uint alone = in_block ? clr_add_block(a, v * CLR_WIDTH) : 1u;
        for (ulong at = v * CLR_WIDTH; alone; alone >>= 1, at += CLR_WIDTH)
            if (alone & 1u) clr_store_record(clr_add_vector(a, at, !in_block), a->planes, clr_state_of(a), at);
        v += (in_block ? CLR_BLOCK : 1) * span.step;
    }
}

kernel void clr_add(CLR_EACH_BATCH(CLR_BATCH_ARGUMENTS) clr_batches batches, CLR_PLANE_ARGUMENTS(s), clr_state s_state,
                    global ulong* add_rows, clr_range range) {
    const clr_planes planes = CLR_PLANES(s);
    clr_adder a = clr_adder_make(&batches, planes, s_state, range.count);
    CLR_EACH_BATCH(CLR_TAKE_INPUT)
    clr_add_span(&a, clr_my_span(range));
    clr_store_add_tally(&a, add_rows);
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

#endif
