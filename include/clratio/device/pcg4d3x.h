// pcg4d3x, this library's own variant of the hash pcg4d of Jarzynski and Olano, "Hash functions for GPU rendering" (JCGT
// 9(3), 2020): three rounds instead of two, each followed by v ^= v >> 16.
#ifndef CLRATIO_DEVICE_PCG4D3X_H
#define CLRATIO_DEVICE_PCG4D3X_H

#include "clratio/device/philox.h"

CLR_NAMESPACE_BEGIN

#define CLR_PCG4D3X_ROUND                                                                                                   \
    v.w0 += v.w1 * v.w3;                                                                                                    \
    v.w1 += v.w2 * v.w0;                                                                                                    \
    v.w2 += v.w0 * v.w1;                                                                                                    \
    v.w3 += v.w1 * v.w2;                                                                                                    \
    v.w0 ^= v.w0 >> 16;                                                                                                     \
    v.w1 ^= v.w1 >> 16;                                                                                                     \
    v.w2 ^= v.w2 >> 16;                                                                                                     \
    v.w3 ^= v.w3 >> 16

// Bijective in the four words.
CLR_FN clr_words clr_pcg4d3x(clr_words v) {
    const clr_uint a = (clr_uint)(1664525u), c = (clr_uint)(1013904223u);
    v.w0 = v.w0 * a + c;
    v.w1 = v.w1 * a + c;
    v.w2 = v.w2 * a + c;
    v.w3 = v.w3 * a + c;
    CLR_PCG4D3X_ROUND;
    CLR_PCG4D3X_ROUND;
    CLR_PCG4D3X_ROUND;
    return v;
}

CLR_NAMESPACE_END

#endif
