// Images and errors of a single-scattering scene. A vector is CLR_WIDTH neighbouring pixels of one row.
// CLR_GENERATOR: CLR_PHILOX or CLR_PCG4D3X. CLR_SAMPLING: CLR_UNI .. CLR_WVDS_MIS. CLR_INDEPENDENT_T: t of other samples.
#include "clratio/device/layout.h"
#include "clratio/device/medium.h"

// A vector of pixels: `pixel` and `column` are those of lane 0, `lanes` of the lanes lie in the image.
typedef struct {
    uint row, column, pixel, lanes;
} clr_pixels;

static inline clr_pixels clr_pixels_of(clr_medium s, uint row, uint vector) {
    clr_pixels p;
    p.row = row;
    p.column = vector * CLR_WIDTH;
    p.pixel = row * s.width + p.column;
    p.lanes = min((uint)CLR_WIDTH, s.width - p.column);
    return p;
}

static inline uint clr_vectors_a_row(clr_medium s) { return (s.width + CLR_WIDTH - 1) / CLR_WIDTH; }

// The lanes of channel c, in the device's order of channels, become values 3 (first + lane) + c of the view.
static inline void clr_store_channels(const clr_real* v, clr_medium s, global float* p, clr_layout view, ulong first,
                                      uint lanes) {
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
            for (int c = 0; c < 3; ++c)
                ray.tau[c] = ray.tau[c] * clr_load(shares + (ulong)c * s.plane + p.pixel);
        clr_store_channels(ray.tau, s, out, layout, (ulong)row * s.width + p.column, p.lanes);
    }
}

// Means of m and t. Values of level k begin at k * level_values.
kernel void clr_medium_render(global float* m, clr_layout m_layout, global float* t, clr_layout t_layout, clr_medium s,
                              global const float* occluders, clr_stream stream, clr_sampler sampler, uint levels,
                              uint first_row, ulong level_pixels, clr_range range) {
    const clr_span span = clr_my_span(range);
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
        const uint steps = clr_step_count(sampler, levels);
        for (uint k = 0; k < steps; ++k) {
            const clr_step step = clr_step_of(sampler, levels, k);
            sums = clr_do_step(step, CLR_GENERATOR, CLR_SAMPLING, s, occluders, &ray, &plan, &shadows, stream, p.pixel, sums);
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
