// Images and errors of a single-scattering scene. A vector is CLR_WIDTH neighbouring pixels of one row.
// CLR_GENERATOR: CLR_PHILOX or CLR_PCG4D3X. CLR_SAMPLING: CLR_UNI .. CLR_WVDS_MIS. CLR_INDEPENDENT_T: t of other samples.
#include "clratio/device/layout.h"
#include "clratio/device/medium.h"

// A vector of pixels: `pixel` and `column` are those of lane 0, `lanes` of the lanes lie in the image.
typedef struct {
    uint row, column, pixel, lanes;
} clr_pixels;

CLR_FN clr_pixels clr_pixels_of(clr_medium s, uint row, uint vector) {
    clr_pixels p;
    p.row = row;
    p.column = vector * CLR_WIDTH;
    p.pixel = row * s.width + p.column;
    p.lanes = min((uint)CLR_WIDTH, s.width - p.column);
    return p;
}

CLR_FN uint clr_vectors_a_row(clr_medium s) { return (s.width + CLR_WIDTH - 1) / CLR_WIDTH; }

// The lanes of channel c, in the device's order of channels, become values 3 (first + lane) + c of the view.
CLR_FN void clr_store_channels(const clr_real* v, clr_medium s, global float* p, clr_layout view, ulong first, uint lanes) {
    p += view.offset;
    for (int c = 0; c < 3; ++c) {
        float lane[CLR_WIDTH];
        clr_store(v[c], lane);
        for (uint i = 0; i < lanes; ++i) {
            const ulong value = (first + i) * 3 + s.channel[c];
            if (view.stride == view.channels)
                p[value] = lane[i];
            else
                p[value / view.channels * view.stride + value % view.channels] = lane[i];
        }
    }
}

// tau of the rows from first_row on; with `shares`, mu. range counts lanes, whole vectors for each row.
kernel void clr_medium_exact(global float* out, clr_layout layout, clr_medium s, global const float* occluders,
                             global const float* shares, uint shaded, uint first_row, clr_range range) {
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const uint row = (uint)(v / clr_vectors_a_row(s));
        const clr_pixels p = clr_pixels_of(s, first_row + row, (uint)(v - (ulong)row * clr_vectors_a_row(s)));
        clr_medium_ray ray = clr_aim(s, occluders, (clr_uint)(p.column) + clr_lanes(), p.row);
        if (shaded)
            for (int c = 0; c < 3; ++c) ray.tau[c] = ray.tau[c] * clr_load(shares + (ulong)c * s.plane + p.pixel);
        clr_store_channels(ray.tau, s, out, layout, (ulong)row * s.width + p.column, p.lanes);
    }
}

// What a work-item renders.
CLR_WORK_FN void clr_render_span(global float* m, clr_layout m_layout, global float* t, clr_layout t_layout, clr_medium s,
                                 global const float* occluders, clr_stream stream, clr_sampler sampler, uint levels,
                                 uint first_row, ulong level_pixels, clr_span span) {
    clr_stream other = stream;
    other.id |= CLR_INDEPENDENT;
    uint list[CLR_SHADOW_LIST];
    clr_shadows shadows;
    shadows.list = list;
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const uint row = (uint)(v / clr_vectors_a_row(s));
        const clr_pixels p = clr_pixels_of(s, first_row + row, (uint)(v - (ulong)row * clr_vectors_a_row(s)));
        const clr_medium_ray ray = clr_aim(s, occluders, (clr_uint)(p.column) + clr_lanes(), p.row);
        const clr_medium_plan plan = clr_make_plan(CLR_SAMPLING, s, &ray);
        clr_find_shadows(s, occluders, &ray, &shadows);
        clr_medium_sums sums = clr_no_samples(), others = clr_no_samples();
        const int some_hit = clr_any(ray.length > (clr_real)(0.0f));
        const uint steps = clr_step_count(sampler, levels);
        for (uint k = 0; k < steps; ++k) {
            clr_step step = clr_step_of(sampler, levels, k);
            if (!some_hit) step.from = step.to;
            sums =
                clr_do_step(step, CLR_GENERATOR, CLR_SAMPLING, s, occluders, &ray, &plan, &shadows, stream, p.pixel, sums);
#if CLR_INDEPENDENT_T
            others =
                clr_do_step(step, CLR_GENERATOR, CLR_SAMPLING, s, occluders, &ray, &plan, &shadows, other, p.pixel, others);
#endif
            if (!levels && k + 1 < steps) continue;
            clr_medium_sums means;
            for (int c = 0; c < 3; ++c) {
                means.m[c] = sums.m[c] * (clr_real)(step.sampler.inverse_samples);
                means.t[c] = (CLR_INDEPENDENT_T ? others.t[c] : sums.t[c]) * (clr_real)(step.sampler.inverse_samples);
            }
            const ulong first = (levels ? k : 0) * level_pixels + (ulong)row * s.width + p.column;
            clr_store_channels(means.m, s, m, m_layout, first, p.lanes);
            clr_store_channels(means.t, s, t, t_layout, first, p.lanes);
        }
    }
}

// Means of m and t. Values of level k begin at k * level_values.
kernel void clr_medium_render(global float* m, clr_layout m_layout, global float* t, clr_layout t_layout, clr_medium s,
                              global const float* occluders, clr_stream stream, clr_sampler sampler, uint levels,
                              uint first_row, ulong level_pixels, clr_range range) {
    clr_render_span(m, m_layout, t, t_layout, s, occluders, stream, sampler, levels, first_row, level_pixels,
                    clr_my_span(range));
}

// Errors counted and summed, no image stored. A task is one row of the image of one seed; its sums are its own, and the
// counters are those of its work-group: CLR_GROUPED = 0 has one work-item to a group and no atomics.
CLR_FN void clr_count_slot(global uint* counter) {
#if CLR_GROUPED
    atomic_inc(counter);
#else
    *counter += 1;
#endif
}

CLR_FN void clr_count_error(clr_tally tally, global uint* counters, clr_real e, clr_mask valid) {
    const clr_uint slot = clr_slot(tally.bins, e);
    const clr_mask atom = clr_abs(e) <= (clr_real)(CLR_ATOM);
    const clr_uint where = atom ? (clr_uint)(tally.bins.count + CLR_ATOM_SLOT) : slot;
    uint lane[CLR_WIDTH];
    clr_store(valid ? where : (clr_uint)(tally.bins.count + CLR_UNUSED_SLOT), lane);
    for (int i = 0; i < CLR_WIDTH; ++i) clr_count_slot(counters + lane[i]);
}

CLR_FN void clr_count_zeros(clr_tally tally, global uint* counters, clr_mask zero) {
    if (!clr_any(zero)) return;
    uint lane[CLR_WIDTH];
    clr_store(zero ? (clr_uint)(1u) : (clr_uint)(0u), lane);
    for (int i = 0; i < CLR_WIDTH; ++i)
        if (lane[i]) clr_count_slot(counters + tally.bins.count + CLR_ZERO_SLOT);
}

// sums[0], sums[1]: errors and their squares, of each lane.
CLR_FN void clr_sum_error(clr_tally tally, clr_wide* sums, clr_real e, clr_mask valid) {
    const clr_int units = clr_error_units(e, tally.inverse_unit);
    const clr_wide wide = clr_to_wide(valid ? units : (clr_int)(0));
    sums[0] += wide;
    sums[1] += (wide * wide + (clr_wide)(2048)) >> 12;
}

CLR_FN ulong clr_lane_sum(clr_wide v) {
    ulong lane[CLR_WIDTH], sum = 0;
    clr_store(v, lane);
    for (int i = 0; i < CLR_WIDTH; ++i) sum += lane[i];
    return sum;
}

CLR_FN clr_mask clr_lanes_below(uint lanes) { return clr_to_int(clr_lanes()) < (clr_int)((int)lanes); }

CLR_FN void clr_tally_level(clr_tally tally, global uint* counters, clr_wide* sums, clr_medium s, clr_medium_sums samples,
                            const clr_real* t, float inverse_samples, const clr_medium_ray* ray, const clr_real* share,
                            clr_mask valid) {
    const uint slots = tally.bins.count + CLR_ERROR_SLOTS;
    for (int c = 0; c < 3; ++c) {
        const uint plain = s.channel[c], ratio = 3 + plain;
        const clr_medium_errors e = clr_errors_of(samples.m[c], t[c], inverse_samples, ray->tau[c], share[c]);
        clr_count_error(tally, counters + plain * slots, e.plain, valid);
        clr_count_error(tally, counters + ratio * slots, e.ratio, valid);
        clr_count_zeros(tally, counters + ratio * slots, e.zero & valid);
        clr_sum_error(tally, sums + 2 * plain, e.plain, valid);
        clr_sum_error(tally, sums + 2 * ratio, e.ratio, valid);
    }
}

// The tasks of a work-item: task = seed * rows + row.
CLR_WORK_FN void clr_tally_tasks(global uint* own, global ulong* totals, clr_medium s, global const float* occluders,
                                 global const float* shares, clr_stream stream, clr_sampler sampler, clr_tally tally,
                                 uint first_row, uint rows, clr_span tasks) {
    const uint slots = tally.bins.count + CLR_ERROR_SLOTS, values = tally.levels * CLR_LEVEL_VALUES;
    uint list[CLR_SHADOW_LIST];
    clr_shadows shadows;
    shadows.list = list;
    for (ulong task = tasks.begin; task < tasks.end; task += tasks.step) {
        clr_wide sums[2 * CLR_MOST_LEVELS * CLR_LEVEL_VALUES];
        for (uint i = 0; i < 2 * values; ++i) sums[i] = (clr_wide)(0);
        const uint row = (uint)(task % rows);
        clr_stream from = stream;
        from.seed += task / rows;
        clr_stream other = from;
        other.id |= CLR_INDEPENDENT;
        for (uint v = 0; v < clr_vectors_a_row(s); ++v) {
            const clr_pixels p = clr_pixels_of(s, first_row + row, v);
            const clr_medium_ray ray = clr_aim(s, occluders, (clr_uint)(p.column) + clr_lanes(), p.row);
            const clr_mask valid = (ray.length > (clr_real)(0.0f)) & clr_lanes_below(p.lanes);
            if (!clr_any(valid)) continue;
            const clr_medium_plan plan = clr_make_plan(CLR_SAMPLING, s, &ray);
            clr_find_shadows(s, occluders, &ray, &shadows);
            clr_real share[3];
            for (int c = 0; c < 3; ++c) share[c] = clr_load(shares + (ulong)c * s.plane + p.pixel);
            clr_medium_sums samples = clr_no_samples(), others = clr_no_samples();
            for (uint k = 0; k < tally.levels; ++k) {
                const clr_step step = clr_step_of(sampler, tally.levels, k);
                samples = clr_do_step(step, CLR_GENERATOR, CLR_SAMPLING, s, occluders, &ray, &plan, &shadows, from, p.pixel,
                                      samples);
#if CLR_INDEPENDENT_T
                others = clr_do_step(step, CLR_GENERATOR, CLR_SAMPLING, s, occluders, &ray, &plan, &shadows, other, p.pixel,
                                     others);
#endif
                clr_tally_level(tally, own + k * CLR_LEVEL_VALUES * slots, sums + 2 * k * CLR_LEVEL_VALUES, s, samples,
                                CLR_INDEPENDENT_T ? others.t : samples.t, step.sampler.inverse_samples, &ray, share, valid);
            }
        }
        for (uint i = 0; i < 2 * values; ++i) totals[task * 2 * values + i] = clr_lane_sum(sums[i]);
    }
}

// counters: levels * 6 rows of slots for each work-group, which has per_group tasks.
kernel void clr_medium_tally(global uint* counters, global ulong* totals, clr_medium s, global const float* occluders,
                             global const float* shares, clr_stream stream, clr_sampler sampler, clr_tally tally,
                             uint first_row, uint rows, ulong tasks, ulong per_group) {
    const ulong row = (ulong)(tally.levels * CLR_LEVEL_VALUES) * (tally.bins.count + CLR_ERROR_SLOTS);
    const ulong begin = min(tasks, get_group_id(0) * per_group);
    const clr_span own = {begin + get_local_id(0), min(tasks, begin + per_group), get_local_size(0)};
    clr_tally_tasks(counters + get_group_id(0) * row, totals, s, occluders, shares, stream, sampler, tally, first_row, rows,
                    own);
}
