// Streams: the words of a stream as a pure function of their index. The layout is a contract, written in docs/streams.md.
// Block b of a stream holds its words 4 b .. 4 b + 3; b < 2^60.
#ifndef CLRATIO_DEVICE_STREAM_H
#define CLRATIO_DEVICE_STREAM_H

#include "clratio/device/pcg4d3x.h"
#include "clratio/device/philox.h"

CLR_NAMESPACE_BEGIN

#define CLR_PHILOX 0u   // Philox4x32-10
#define CLR_PCG4D3X 1u  // the fast hash, seeds of 32 bits

// Who draws: equal seeds, ids and indices in different domains share no numbers. 4 to 15 are free.
#define CLR_DOMAIN_USER 0u
#define CLR_DOMAIN_ERROR 1u
#define CLR_DOMAIN_SCENE 2u
#define CLR_DOMAIN_STUDY 3u

typedef struct {
    clr_u64 seed;
    clr_u32 id, domain;
} clr_stream;

// 0, 1, .. in the lanes.
CLR_FN clr_uint clr_lanes(void) {
#if CLR_WIDTH == 1
    return 0u;
#elif CLR_WIDTH == 2
    return (clr_uint)(0, 1);
#elif CLR_WIDTH == 4
    return (clr_uint)(0, 1, 2, 3);
#elif CLR_WIDTH == 8
    return (clr_uint)(0, 1, 2, 3, 4, 5, 6, 7);
#else
    return (clr_uint)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
#endif
}

// Blocks first .. first + CLR_WIDTH - 1; first is a multiple of CLR_WIDTH.
CLR_FN clr_words clr_draw(clr_u32 generator, clr_stream stream, clr_u64 first) {
    clr_words v;
    v.w0 = (clr_uint)((clr_u32)first) + clr_lanes();
    v.w1 = (clr_uint)((clr_u32)(first >> 32));
    v.w2 = (clr_uint)(stream.id);
    if (generator == CLR_PHILOX) {
        v.w3 = (clr_uint)(stream.domain);
        return clr_philox4x32(v, (clr_u32)stream.seed, (clr_u32)(stream.seed >> 32));
    }
    v.w1 |= (clr_uint)(stream.domain << 28);
    v.w3 = (clr_uint)((clr_u32)stream.seed);
    return clr_pcg4d3x(v);
}

CLR_NAMESPACE_END

#endif
