// Histograms of error samples, drawn and counted in one go, and of values in memory.
// A work-group is a task: one part of one model's samples, counted in a row of 32-bit counters of its own. clr_add_rows adds
// the rows of all parts to 64-bit totals. CLR_GROUPED = 0: one work-item to a group, no atomics. CLR_GROUPED = 1: the group
// shares the row, in local memory where CLR_LOCAL_ROWS. CLR_GENERATOR: CLR_PHILOX or CLR_PCG4D3X.
#include "clratio/device/error.h"
#include "clratio/device/histogram.h"
#include "clratio/device/layout.h"
#include "clratio/device/stream.h"

#if CLR_GROUPED && CLR_LOCAL_ROWS
#define CLR_COUNTERS local
#else
#define CLR_COUNTERS global
#endif

CLR_FN void clr_count_one(CLR_COUNTERS uint* counters, uint slot) {
#if CLR_GROUPED
    atomic_inc(counters + slot);
#else
    counters[slot] += 1;
#endif
}

CLR_FN void clr_count_all(CLR_COUNTERS uint* counters, clr_uint slots) {
    uint lane[CLR_WIDTH];
    clr_store(slots, lane);
    for (int i = 0; i < CLR_WIDTH; ++i) clr_count_one(counters, lane[i]);
}

// Counts the lanes i with 0 <= at + i step < count; a negative index is a large one here.
CLR_FN void clr_count_some(CLR_COUNTERS uint* counters, clr_uint slots, long at, int step, ulong count) {
    uint lane[CLR_WIDTH];
    clr_store(slots, lane);
    for (int i = 0; i < CLR_WIDTH; ++i)
        if ((ulong)(at + i * step) < count) clr_count_one(counters, lane[i]);
}

#if !CLR_GROUPED
// The slots of one step are counted in the next, read back from memory: taking a vector's lanes out one by one would compete
// with the arithmetic for the vector unit. Measured on PoCL with AVX-512: 1.09 times as fast.
typedef struct {
    local uint* slots;  // two steps of 2 CLR_WIDTH
    uint next;          // where the next step goes
    uint waiting;       // 0 before the first step
} clr_queue;

CLR_FN void clr_count_waiting(clr_queue queue, global uint* counters) {
    const local uint* slots = queue.slots + (queue.next ^ (2 * CLR_WIDTH));
    for (uint i = 0; i < queue.waiting; ++i) counters[slots[i]] += 1;
}

CLR_FN clr_queue clr_count_later(clr_queue queue, global uint* counters, clr_uint even, clr_uint odd) {
    local clr_uint* to = (local clr_uint*)(queue.slots + queue.next);
    to[0] = even;
    to[1] = odd;
    clr_count_waiting(queue, counters);
    queue.next ^= 2 * CLR_WIDTH;
    queue.waiting = 2 * CLR_WIDTH;
    return queue;
}
#endif

CLR_FN void clr_group_barrier(void) {
#if CLR_GROUPED
    barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);
#endif
}

// The counters of this task, all 0: its row, or local memory that clr_finish_row copies there.
CLR_FN CLR_COUNTERS uint* clr_start_row(global uint* row, local uint* shared, uint slots) {
#if CLR_GROUPED && CLR_LOCAL_ROWS
    CLR_COUNTERS uint* counters = shared;
#else
    CLR_COUNTERS uint* counters = row;
#endif
    for (uint k = get_local_id(0); k < slots; k += get_local_size(0)) counters[k] = 0;
    clr_group_barrier();
    return counters;
}

CLR_FN void clr_finish_row(global uint* row, CLR_COUNTERS uint* counters, uint slots) {
    clr_group_barrier();
#if CLR_GROUPED && CLR_LOCAL_ROWS
    for (uint k = get_local_id(0); k < slots; k += get_local_size(0)) row[k] = counters[k];
#endif
}

// The vectors of part `part` for this work-item.
CLR_FN clr_span clr_part_span(uint part, ulong per_part, ulong vectors) {
    clr_span s;
    s.begin = min(vectors, part * per_part) + get_local_id(0);
    s.end = min(vectors, (part + 1) * per_part);
    s.step = get_local_size(0);
    return s;
}

// A copy: PoCL's work-items share a by-value argument that they write to.
CLR_FN clr_stream clr_stream_of(clr_stream stream, uint model) {
    stream.id += model;
    return stream;
}

// Samples first .. first + count - 1 of laws[first_model + m] from stream id + m. Task: part * models + m.
kernel void clr_histogram_errors(global uint* rows, global const clr_canonical* laws, ulong first_model, uint models,
                                 clr_stream stream, clr_bins bins, ulong first, ulong count, ulong first_block,
                                 ulong vectors, ulong per_part, local uint* shared) {
    const uint slots = bins.count + CLR_OUTER_SLOTS, part = get_group_id(0) / models,
               model = get_group_id(0) - part * models;
    global uint* row = rows + get_group_id(0) * slots;
    CLR_COUNTERS uint* counters = clr_start_row(row, shared, slots);
    const clr_canonical law = laws[first_model + model];
#if !CLR_GROUPED
    local clr_uint queued[4];
    clr_queue queue = {(local uint*)queued, 0, 0};
#endif
    const clr_stream own = clr_stream_of(stream, model);
    const clr_span span = clr_part_span(part, per_part, vectors);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong block = first_block + v * CLR_WIDTH;
        const long at = (long)(2 * block) - (long)first;
        const clr_words w = clr_draw(CLR_GENERATOR, own, block);
        const clr_uint even = clr_slot(bins, clr_error_sample(law, w.w0, w.w1));
        const clr_uint odd = clr_slot(bins, clr_error_sample(law, w.w2, w.w3));
        if (at >= 0 && (ulong)at + 2 * CLR_WIDTH <= count) {
#if CLR_GROUPED
            clr_count_all(counters, even);
            clr_count_all(counters, odd);
#else
            queue = clr_count_later(queue, counters, even, odd);
#endif
        } else {
            clr_count_some(counters, even, at, 2, count);
            clr_count_some(counters, odd, at + 1, 2, count);
        }
    }
#if !CLR_GROUPED
    clr_count_waiting(queue, counters);
#endif
    clr_finish_row(row, counters, slots);
}

#if CLR_FP64
kernel void clr_histogram_errors_double(global uint* rows, global const clr_canonical_double* laws, ulong first_model,
                                        uint models, clr_stream stream, clr_bins_double bins, ulong first, ulong count,
                                        ulong first_block, ulong vectors, ulong per_part, local uint* shared) {
    const uint slots = bins.count + CLR_OUTER_SLOTS, part = get_group_id(0) / models,
               model = get_group_id(0) - part * models;
    global uint* row = rows + get_group_id(0) * slots;
    CLR_COUNTERS uint* counters = clr_start_row(row, shared, slots);
    const clr_canonical_double law = laws[first_model + model];
    const clr_stream own = clr_stream_of(stream, model);
    const clr_span span = clr_part_span(part, per_part, vectors);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong block = first_block + v * CLR_WIDTH;
        const clr_words w = clr_draw(CLR_GENERATOR, own, block);
        const clr_uint slot = clr_slot_double(bins, clr_error_sample_double(law, w.w0, w.w1, w.w2, w.w3));
        clr_count_some(counters, slot, (long)block - (long)first, 1, count);
    }
    clr_finish_row(row, counters, slots);
}
#endif

// The values first .. end - 1 of a view. Task: part.
kernel void clr_histogram_values(global uint* rows, global const float* x, clr_layout layout, clr_bins bins, ulong first,
                                 ulong end, ulong vectors, ulong per_part, local uint* shared) {
    const uint slots = bins.count + CLR_OUTER_SLOTS;
    global uint* row = rows + get_group_id(0) * slots;
    CLR_COUNTERS uint* counters = clr_start_row(row, shared, slots);
    const clr_span span = clr_part_span(get_group_id(0), per_part, vectors);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong at = first + v * CLR_WIDTH;
        const clr_uint slot = clr_slot(bins, clr_load_view(x, layout, at, end));
        if (at + CLR_WIDTH <= end)
            clr_count_all(counters, slot);
        else
            clr_count_some(counters, slot, at, 1, end);
    }
    clr_finish_row(row, counters, slots);
}

// totals[offset + j] += rows[part range.count + j] over all parts.
kernel void clr_add_rows(global ulong* totals, ulong offset, global const uint* rows, uint parts, clr_range range) {
    const clr_span span = clr_my_span(range);
    totals += offset;
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong j = v * CLR_WIDTH;
        if (j + CLR_WIDTH <= range.count) {
            clr_wide sum = clr_load(totals + j);
            for (ulong part = 0; part < parts; ++part) sum += clr_to_wide(clr_load(rows + part * range.count + j));
            clr_store(sum, totals + j);
        } else {
            for (ulong i = j; i < range.count; ++i)
                for (ulong part = 0; part < parts; ++part) totals[i] += rows[part * range.count + i];
        }
    }
}
