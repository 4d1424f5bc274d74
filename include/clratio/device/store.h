// Vectors of draws into views, in the order of their index. OpenCL C only.
#ifndef CLRATIO_DEVICE_STORE_H
#define CLRATIO_DEVICE_STORE_H

#include "clratio/device/layout.h"

#if defined(__OPENCL_C_VERSION__)

// put: lane i becomes value at + i of the view, where 0 <= at + i < count; other lanes are dropped.
// zip: the lanes of a and b in turn. put_pairs, put_quads: vectors whose lanes come in turn.
#define CLR_PUT(name, vector, element)                                                                                      \
    CLR_FN void name(vector v, global element* p, clr_layout view, long at, ulong count) {                                  \
        p += view.offset;                                                                                                   \
        if (view.stride == view.channels && at >= 0 && (ulong)at + CLR_WIDTH <= count) {                                    \
            if (((ulong)(p + at) & (sizeof(v) - 1)) == 0)                                                                   \
                *(global vector*)(p + at) = v;                                                                              \
            else                                                                                                            \
                clr_store(v, p + at);                                                                                       \
            return;                                                                                                         \
        }                                                                                                                   \
        element lane[CLR_WIDTH];                                                                                            \
        clr_store(v, lane);                                                                                                 \
        for (int i = 0; i < CLR_WIDTH; ++i) {                                                                               \
            if ((ulong)(at + i) >= count) continue;                                                                         \
            const ulong pixel = (ulong)(at + i) / view.channels;                                                            \
            p[pixel * view.stride + ((ulong)(at + i) - pixel * view.channels)] = lane[i];                                   \
        }                                                                                                                   \
    }                                                                                                                       \
    CLR_FN void name##_pairs(vector a, vector b, global element* p, clr_layout view, long at, ulong count) {                \
        name(CLR_ZIP_LOW(vector, a, b), p, view, at, count);                                                                \
        name(CLR_ZIP_HIGH(vector, a, b), p, view, at + CLR_WIDTH, count);                                                   \
    }                                                                                                                       \
    CLR_FN void name##_quads(vector a, vector b, vector c, vector d, global element* p, clr_layout view, long at,           \
                             ulong count) {                                                                                 \
        name##_pairs(CLR_ZIP_LOW(vector, a, c), CLR_ZIP_LOW(vector, b, d), p, view, at, count);                             \
        name##_pairs(CLR_ZIP_HIGH(vector, a, c), CLR_ZIP_HIGH(vector, b, d), p, view, at + 2 * CLR_WIDTH, count);           \
    }

#if CLR_WIDTH == 1
#define CLR_ZIP_LOW(vector, a, b) (a)
#define CLR_ZIP_HIGH(vector, a, b) (b)
#elif CLR_WIDTH == 2
#define CLR_ZIP_LOW(vector, a, b) ((vector)((a).s0, (b).s0))
#define CLR_ZIP_HIGH(vector, a, b) ((vector)((a).s1, (b).s1))
#elif CLR_WIDTH == 4
#define CLR_ZIP_LOW(vector, a, b) ((vector)((a).s0, (b).s0, (a).s1, (b).s1))
#define CLR_ZIP_HIGH(vector, a, b) ((vector)((a).s2, (b).s2, (a).s3, (b).s3))
#elif CLR_WIDTH == 8
#define CLR_ZIP_LOW(vector, a, b) ((vector)((a).s0, (b).s0, (a).s1, (b).s1, (a).s2, (b).s2, (a).s3, (b).s3))
#define CLR_ZIP_HIGH(vector, a, b) ((vector)((a).s4, (b).s4, (a).s5, (b).s5, (a).s6, (b).s6, (a).s7, (b).s7))
#else
#define CLR_ZIP_LOW(vector, a, b)                                                                                           \
    ((vector)((a).s0, (b).s0, (a).s1, (b).s1, (a).s2, (b).s2, (a).s3, (b).s3, (a).s4, (b).s4, (a).s5, (b).s5, (a).s6,       \
              (b).s6, (a).s7, (b).s7))
#define CLR_ZIP_HIGH(vector, a, b)                                                                                          \
    ((vector)((a).s8, (b).s8, (a).s9, (b).s9, (a).sa, (b).sa, (a).sb, (b).sb, (a).sc, (b).sc, (a).sd, (b).sd, (a).se,       \
              (b).se, (a).sf, (b).sf))
#endif

CLR_PUT(clr_put, clr_real, float)
CLR_PUT(clr_put_words, clr_uint, uint)
#if CLR_FP64
CLR_PUT(clr_put_double, clr_double, double)
#endif

#endif

#endif
