// The error of a ratio estimator as a function of two standard normals, eq. (14) in canonical form:
//     X = (a Z2 + b Z1) / (1 + s Z2)
// s is the standard deviation of the relative denominator, a Z2 + b Z1 the residual m - (mu / tau) t.
#ifndef CLRATIO_DEVICE_CANONICAL_H
#define CLRATIO_DEVICE_CANONICAL_H

#include "clratio/device/portable.h"

CLR_NAMESPACE_BEGIN

// One model. s >= 0, without unit; a and b >= 0 in the units of m. s == 0 and a == 0: the plain mean of m.
typedef struct {
    float s, a, b;
} clr_canonical;

#if CLR_FP64
typedef struct {
    double s, a, b;
} clr_canonical_double;
#endif

CLR_NAMESPACE_END

#endif
