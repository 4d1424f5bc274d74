// The law of the error, exact and as published: density, log density and tail probability, theory of Hinkley 1969.
// The formulas stand once, in law_formulas.h: read here for float lanes, and in C++ again for double.
#ifndef CLRATIO_DEVICE_LAW_H
#define CLRATIO_DEVICE_LAW_H

#include "clratio/device/exponential.h"
#include "clratio/device/layout.h"

CLR_NAMESPACE_BEGIN

// A model as it lies in memory, in units of its standard deviation sd = sqrt(a^2 + b^2):
// s, a / sd, b / sd, 1 / sd (+inf for a point mass), and 2 T(1/s, -a/b) with Owen's T.
typedef struct {
    float s, a, b, inverse_sd, half_turn;
} clr_law;

// What a launch works out: `points` values for each model.
typedef struct {
    clr_layout x, out;
    clr_u64 points;
    clr_u32 shared_x;  // 1: every model has the same x
    clr_u32 unused;
} clr_law_task;

CLR_CONSTANT float clr_gauss_node[6] = {0.0337652429f, 0.169395307f, 0.380690407f, 0.619309593f, 0.830604693f, 0.966234757f};
CLR_CONSTANT float clr_gauss_weight[6] = {0.0856622462f, 0.180380787f, 0.233956967f,
                                          0.233956967f,  0.180380787f, 0.0856622462f};

CLR_NAMESPACE_END

#define CLR_LAW_REAL clr_real
#define CLR_LAW_K(x) ((clr_real)(x##f))
#define CLR_LAW_MODEL clr_law_lanes
#define CLR_LAW_POINT clr_law_point
#define CLR_LAW_NODES 6
#define CLR_LAW_NODE clr_gauss_node
#define CLR_LAW_WEIGHT clr_gauss_weight
#define CLR_LAW_CUT CLR_LAW_K(5.5)       // exp(-CUT^2 / 2) is below the rounding of T
#define CLR_LAW_FAR CLR_LAW_K(10.2)      // erfc is 0 beyond
#define CLR_LAW_TINY CLR_LAW_K(1.0e-18)  // its square is a normal number
#define CLR_LAW_LEAST CLR_LAW_K(1.0e-37)
#include "clratio/device/law_formulas.h"

#if !defined(__OPENCL_C_VERSION__)

CLR_NAMESPACE_BEGIN

// Gauss-Legendre on [0, 1].
inline constexpr double gauss_node_20[20] = {
    0.00343570040745253761, 0.0180140363610431044, 0.0438827858743370471, 0.0804415140888905883, 0.126834046769924604,
    0.181973159636742487,   0.244566499024586451,  0.31314695564229022,   0.386107074429177461,  0.461736739433251333,
    0.538263260566748667,   0.613892925570822539,  0.68685304435770978,   0.755433500975413549,  0.818026840363257513,
    0.873165953230075396,   0.919558485911109412,  0.956117214125662953,  0.981985963638956896,  0.996564299592547462};
inline constexpr double gauss_weight_20[20] = {
    0.00880700356957605916, 0.0203007149001934707, 0.0313360241670545318, 0.0416383707883523744, 0.0509650599086202175,
    0.0590972659807592087,  0.0658443192245883134, 0.0710480546591910257, 0.0745864932363018734, 0.0763766935653629253,
    0.0763766935653629253,  0.0745864932363018734, 0.0710480546591910257, 0.0658443192245883134, 0.0590972659807592087,
    0.0509650599086202175,  0.0416383707883523744, 0.0313360241670545318, 0.0203007149001934707, 0.00880700356957605916};

CLR_NAMESPACE_END

#undef CLR_LAW_REAL
#undef CLR_LAW_K
#undef CLR_LAW_MODEL
#undef CLR_LAW_POINT
#undef CLR_LAW_NODES
#undef CLR_LAW_NODE
#undef CLR_LAW_WEIGHT
#undef CLR_LAW_CUT
#undef CLR_LAW_FAR
#undef CLR_LAW_TINY
#undef CLR_LAW_LEAST
#define CLR_LAW_REAL double
#define CLR_LAW_K(x) x
#define CLR_LAW_MODEL clr_law_double
#define CLR_LAW_POINT clr_law_point_double
#define CLR_LAW_NODES 20
#define CLR_LAW_NODE gauss_node_20
#define CLR_LAW_WEIGHT gauss_weight_20
#define CLR_LAW_CUT 8.6
#define CLR_LAW_FAR 27.3
#define CLR_LAW_TINY 1.0e-150
#define CLR_LAW_LEAST 1.0e-300
#include "clratio/device/law_formulas.h"

#endif

#endif
