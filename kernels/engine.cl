// The self-test: + - * / sqrt fma on n triples of values, six blocks of n results.
#include "clratio/device/layout.h"

kernel void clr_self_test(global const float* x, global float* out, uint n, clr_range range) {
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong i = v * CLR_WIDTH;
        const clr_real a = clr_load(x + i), b = clr_load(x + n + i), c = clr_load(x + 2 * n + i);
        clr_store(a + b, out + i);
        clr_store(a - b, out + n + i);
        clr_store(a * b, out + 2 * n + i);
        clr_store(a / b, out + 3 * n + i);
        clr_store(clr_sqrt(clr_abs(a)), out + 4 * n + i);
        clr_store(clr_fma(a, b, c), out + 5 * n + i);
    }
}
