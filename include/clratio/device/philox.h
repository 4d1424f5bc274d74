// Philox4x32-10 of Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3" (SC 2011).
#ifndef CLRATIO_DEVICE_PHILOX_H
#define CLRATIO_DEVICE_PHILOX_H

#include "clratio/device/portable.h"

CLR_NAMESPACE_BEGIN

// Four words a lane: a counter, or what a generator makes of it.
typedef struct {
    clr_uint w0, w1, w2, w3;
} clr_words;

// The bits of 32-bit words are kept in the low halves of 64-bit lanes, whose high halves are never cleared: a product then
// is one 32 x 32 -> 64 multiplication, its high word one shift, its low word nothing at all. Measured: 3 times mul_hi on a
// CPU.
#define CLR_PHILOX_ROUND(k0, k1)                                                                                            \
    p0 = (c0 & (clr_wide)(0xffffffffUL)) * (clr_wide)(0xd2511f53u);                                                         \
    p1 = (c2 & (clr_wide)(0xffffffffUL)) * (clr_wide)(0xcd9e8d57u);                                                         \
    c0 = (p1 >> 32) ^ c1 ^ (clr_wide)(k0);                                                                                  \
    c2 = (p0 >> 32) ^ c3 ^ (clr_wide)(k1);                                                                                  \
    c1 = p1;                                                                                                                \
    c3 = p0

// Bijective in the counter for each key. Random123's philox4x32(counter, key).
CLR_FN clr_words clr_philox4x32(clr_words counter, clr_u32 key0, clr_u32 key1) {
    const clr_u32 step0 = 0x9e3779b9u, step1 = 0xbb67ae85u;
    clr_wide c0 = clr_to_wide(counter.w0), c1 = clr_to_wide(counter.w1);
    clr_wide c2 = clr_to_wide(counter.w2), c3 = clr_to_wide(counter.w3);
    clr_wide p0, p1;
    CLR_PHILOX_ROUND(key0, key1);
    CLR_PHILOX_ROUND(key0 + step0, key1 + step1);
    CLR_PHILOX_ROUND(key0 + 2 * step0, key1 + 2 * step1);
    CLR_PHILOX_ROUND(key0 + 3 * step0, key1 + 3 * step1);
    CLR_PHILOX_ROUND(key0 + 4 * step0, key1 + 4 * step1);
    CLR_PHILOX_ROUND(key0 + 5 * step0, key1 + 5 * step1);
    CLR_PHILOX_ROUND(key0 + 6 * step0, key1 + 6 * step1);
    CLR_PHILOX_ROUND(key0 + 7 * step0, key1 + 7 * step1);
    CLR_PHILOX_ROUND(key0 + 8 * step0, key1 + 8 * step1);
    CLR_PHILOX_ROUND(key0 + 9 * step0, key1 + 9 * step1);
    clr_words out;
    out.w0 = clr_to_uint(c0);
    out.w1 = clr_to_uint(c1);
    out.w2 = clr_to_uint(c2);
    out.w3 = clr_to_uint(c3);
    return out;
}

CLR_NAMESPACE_END

#endif
