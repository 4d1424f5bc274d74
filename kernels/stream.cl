// Draws `first` .. `first + count - 1` of a stream, to memory. CLR_GENERATOR: CLR_PHILOX or CLR_PCG4D3X.
// range counts the blocks from first_block on, a multiple of CLR_WIDTH.
#include "clratio/device/quantile.h"
#include "clratio/device/store.h"
#include "clratio/device/stream.h"

kernel void clr_fill_words(global uint* out, clr_layout layout, clr_stream stream, ulong first, ulong count,
                           ulong first_block, clr_range range) {
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong block = first_block + v * CLR_WIDTH;
        const clr_words w = clr_draw(CLR_GENERATOR, stream, block);
        clr_put_words_quads(w.w0, w.w1, w.w2, w.w3, out, layout, (long)(4 * block) - (long)first, count);
    }
}

kernel void clr_fill_uniforms(global float* out, clr_layout layout, clr_stream stream, ulong first, ulong count,
                              ulong first_block, clr_range range) {
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong block = first_block + v * CLR_WIDTH;
        const clr_words w = clr_draw(CLR_GENERATOR, stream, block);
        clr_put_quads(clr_uniform(w.w0), clr_uniform(w.w1), clr_uniform(w.w2), clr_uniform(w.w3), out, layout,
                      (long)(4 * block) - (long)first, count);
    }
}

kernel void clr_fill_normals(global float* out, clr_layout layout, clr_stream stream, ulong first, ulong count,
                             ulong first_block, clr_range range) {
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong block = first_block + v * CLR_WIDTH;
        const clr_words w = clr_draw(CLR_GENERATOR, stream, block);
        clr_put_quads(clr_normal(w.w0), clr_normal(w.w1), clr_normal(w.w2), clr_normal(w.w3), out, layout,
                      (long)(4 * block) - (long)first, count);
    }
}

#if CLR_FP64

kernel void clr_fill_uniforms_double(global double* out, clr_layout layout, clr_stream stream, ulong first, ulong count,
                                     ulong first_block, clr_range range) {
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong block = first_block + v * CLR_WIDTH;
        const clr_words w = clr_draw(CLR_GENERATOR, stream, block);
        clr_put_double_pairs(clr_uniform_double(w.w0, w.w1), clr_uniform_double(w.w2, w.w3), out, layout,
                             (long)(2 * block) - (long)first, count);
    }
}

kernel void clr_fill_normals_double(global double* out, clr_layout layout, clr_stream stream, ulong first, ulong count,
                                    ulong first_block, clr_range range) {
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong block = first_block + v * CLR_WIDTH;
        const clr_words w = clr_draw(CLR_GENERATOR, stream, block);
        clr_put_double_pairs(clr_normal_double(w.w0, w.w1), clr_normal_double(w.w2, w.w3), out, layout,
                             (long)(2 * block) - (long)first, count);
    }
}

#endif
