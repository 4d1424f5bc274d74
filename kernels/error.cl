// Error samples `first` .. `first + count - 1` of one model, to memory. CLR_GENERATOR: CLR_PHILOX or CLR_PCG4D3X.
#include "clratio/device/error.h"
#include "clratio/device/store.h"
#include "clratio/device/stream.h"

// range counts the blocks from first_block on, a multiple of CLR_WIDTH.
kernel void clr_error_samples(global float* out, clr_layout layout, clr_canonical law, clr_stream stream, ulong first,
                              ulong count, ulong first_block, clr_range range) {
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong block = first_block + v * CLR_WIDTH;
        const clr_words w = clr_draw(CLR_GENERATOR, stream, block);
        clr_put_pairs(clr_error_sample(law, w.w0, w.w1), clr_error_sample(law, w.w2, w.w3), out, layout,
                      (long)(2 * block) - (long)first, count);
    }
}

#if CLR_FP64
kernel void clr_error_samples_double(global double* out, clr_layout layout, clr_canonical_double law, clr_stream stream,
                                     ulong first, ulong count, ulong first_block, clr_range range) {
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong block = first_block + v * CLR_WIDTH;
        const clr_words w = clr_draw(CLR_GENERATOR, stream, block);
        clr_put_double(clr_error_sample_double(law, w.w0, w.w1, w.w2, w.w3), out, layout, (long)block - (long)first, count);
    }
}
#endif
