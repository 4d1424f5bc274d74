// The bin of a value. Bins are half-open; what lies outside is counted apart, never clamped in.
#ifndef CLRATIO_DEVICE_HISTOGRAM_H
#define CLRATIO_DEVICE_HISTOGRAM_H

#include "clratio/device/portable.h"

CLR_NAMESPACE_BEGIN

// `count` bins on [lo, hi), at most 2^23; inverse_width = count / (hi - lo), rounded twice.
typedef struct {
    float lo, hi, inverse_width;
    clr_u32 count;
} clr_bins;

// A row of counters: the bins, then these.
#define CLR_UNDERFLOW 0u  // x < lo, -inf too
#define CLR_OVERFLOW 1u   // x >= hi, +inf too
#define CLR_NONFINITE 2u  // NaN
#define CLR_OUTER_SLOTS 3u

// x in [lo, hi) is in bin min(count - 1, floor((x - lo) inverse_width)), each step rounded: without the min, the value next
// to hi can land in bin `count`. The slot is built as a number: its conversion to an integer is in range whatever x is.
CLR_FN clr_uint clr_slot(clr_bins bins, clr_real x) {
    const clr_real lo = (clr_real)(bins.lo), hi = (clr_real)(bins.hi);
    const clr_real top = (clr_real)((float)(bins.count - 1));
    const clr_real position = (x - lo) * (clr_real)(bins.inverse_width);
    const clr_real bin = position < top ? position : top;
    const clr_real below_hi = x < hi ? bin : (clr_real)((float)(bins.count + CLR_OVERFLOW));
    const clr_real outside =
        x < lo ? (clr_real)((float)(bins.count + CLR_UNDERFLOW)) : (clr_real)((float)(bins.count + CLR_NONFINITE));
    return clr_to_uint(clr_to_int(x >= lo ? below_hi : outside));
}

#if CLR_FP64

typedef struct {
    double lo, hi, inverse_width;
    clr_u32 count;
} clr_bins_double;

CLR_FN clr_uint clr_slot_double(clr_bins_double bins, clr_double x) {
    const clr_double lo = (clr_double)(bins.lo), hi = (clr_double)(bins.hi);
    const clr_double top = (clr_double)((double)(bins.count - 1));
    const clr_double position = (x - lo) * (clr_double)(bins.inverse_width);
    const clr_double bin = position < top ? position : top;
    const clr_double below_hi = x < hi ? bin : (clr_double)((double)(bins.count + CLR_OVERFLOW));
    const clr_double outside =
        x < lo ? (clr_double)((double)(bins.count + CLR_UNDERFLOW)) : (clr_double)((double)(bins.count + CLR_NONFINITE));
    return clr_to_uint(clr_to_int(x >= lo ? below_hi : outside));
}

#endif

CLR_NAMESPACE_END

#endif
