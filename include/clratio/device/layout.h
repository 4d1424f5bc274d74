// Where value i of a view stands in its buffer, and how work is cut into ranges.
#ifndef CLRATIO_DEVICE_LAYOUT_H
#define CLRATIO_DEVICE_LAYOUT_H

#include "clratio/device/portable.h"

CLR_NAMESPACE_BEGIN

// Value i is element offset + (i / channels) * stride + i % channels.
// stride == channels: contiguous. stride == 0: the same numbers for every pixel.
typedef struct {
    clr_u64 offset;
    clr_u32 stride, channels;
} clr_layout;

// How many values there are, and how many vectors of them one work-item takes.
typedef struct {
    clr_u64 count;     // values
    clr_u64 per_item;  // vectors a work-item; 0 where work-items interleave
} clr_range;

#if defined(__OPENCL_C_VERSION__)

typedef struct {
    ulong begin, end, step;
} clr_span;

CLR_FN clr_span clr_my_span(clr_range range) {
    clr_span s;
    const ulong vectors = (range.count + CLR_WIDTH - 1) / CLR_WIDTH;
#if CLR_GROUPED
    s.begin = get_global_id(0);
    s.end = vectors;
    s.step = get_global_size(0);
#else
    s.begin = min(vectors, get_global_id(0) * range.per_item);
    s.end = min(vectors, s.begin + range.per_item);
    s.step = 1;
#endif
    return s;
}

// Of views with gaps, and of a last vector that is not whole; p is the view's first element.
CLR_RARE_FN clr_real clr_load_lanes(global const float* p, uint stride, uint channels, ulong first, ulong count) {
    ulong pixel = first / channels;
    uint channel = (uint)(first - pixel * channels);
    float lane[CLR_WIDTH];
    for (int i = 0; i < CLR_WIDTH; ++i) {
        lane[i] = first + i < count ? p[pixel * stride + channel] : 0.0f;
        if (++channel == channels) {
            channel = 0;
            ++pixel;
        }
    }
    return clr_load(lane);
}

CLR_RARE_FN void clr_store_lanes(clr_real v, global float* p, uint stride, uint channels, ulong first, ulong count) {
    ulong pixel = first / channels;
    uint channel = (uint)(first - pixel * channels);
    float lane[CLR_WIDTH];
    clr_store(v, lane);
    for (int i = 0; i < CLR_WIDTH && first + i < count; ++i) {
        p[pixel * stride + channel] = lane[i];
        if (++channel == channels) {
            channel = 0;
            ++pixel;
        }
    }
}

// The lanes first .. first + CLR_WIDTH - 1 of a view of `count` values; lanes past the end are 0.
CLR_FN clr_real clr_load_view(global const float* p, clr_layout view, ulong first, ulong count) {
    p += view.offset;
    if (view.stride == view.channels && first + CLR_WIDTH <= count) return clr_load(p + first);
    if (view.stride == 0 && view.channels == 1) return (clr_real)(*p);
    return clr_load_lanes(p, view.stride, view.channels, first, count);
}

CLR_FN void clr_store_view(clr_real v, global float* p, clr_layout view, ulong first, ulong count) {
    p += view.offset;
    if (view.stride == view.channels && first + CLR_WIDTH <= count)
        clr_store(v, p + first);
    else
        clr_store_lanes(v, p, view.stride, view.channels, first, count);
}

#if defined(__clang__) && CLR_WIDTH >= 8
#define CLR_PAST_ALIGNMENT (CLR_WIDTH == 8 ? 32 : 64)
#else
#define CLR_PAST_ALIGNMENT 0
#endif

// Whether whole vectors of a result go past the caches, which would read each line before it is written: large ones do.
CLR_FN bool clr_goes_past(global const float* p, clr_layout view, ulong count) {
    const ulong mask = CLR_PAST_ALIGNMENT - 1;
    return CLR_PAST_ALIGNMENT != 0 && count >= 1ul << 20 && view.stride == view.channels &&
           ((ulong)(p + view.offset) & mask) == 0;
}

CLR_FN void clr_store_past(clr_real v, global float* p) {
#if CLR_PAST_ALIGNMENT && CLR_WIDTH == 32
    __builtin_nontemporal_store(v.lo, (global float16*)p);
    __builtin_nontemporal_store(v.hi, (global float16*)(p + 16));
#elif CLR_PAST_ALIGNMENT
    __builtin_nontemporal_store(v, (global clr_real*)p);
#else
    clr_store(v, p);
#endif
}

// Past the caches where one vector fills a line: half of one, with much other work before the next, would be slower.
CLR_FN void clr_store_apart(clr_real v, global float* p, clr_layout view, ulong first, ulong count) {
    if (CLR_WIDTH >= 16 && first + CLR_WIDTH <= count && clr_goes_past(p, view, count))
        clr_store_past(v, p + view.offset + first);
    else
        clr_store_view(v, p, view, first, count);
}

#endif

CLR_NAMESPACE_END

#endif
