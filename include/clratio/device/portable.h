// One vocabulary for OpenCL C 1.2 and C++: the only file that asks which compiler reads it.
// OpenCL C: types of CLR_WIDTH lanes (1, 2, 4, 8, 16). C++: one lane, inside clratio::device.
// With a clang behind OpenCL C, 32 lanes are two vectors of 16 in step, floats only: where one long chain of operations
// waits for itself, two of them fill the pipes (measured with AVX-512, in cache, over 8 groups: half the time).
// clr_pairs: 64-bit lanes that hold the even, or the odd, 32-bit lanes in their low halves and anything in their high
// halves. Below width 8 (where PoCL would take such short vectors apart) the even ones are all lanes, and the odd ones none.
#ifndef CLRATIO_DEVICE_PORTABLE_H
#define CLRATIO_DEVICE_PORTABLE_H

#if defined(__OPENCL_C_VERSION__)

#ifndef CLR_WIDTH
#error "CLR_WIDTH must be 1, 2, 4, 8 or 16; 32 with clang"
#endif
#ifndef CLR_GROUPED
#error "CLR_GROUPED must be 1 (work-groups share, as on a GPU) or 0 (a range for each work-item)"
#endif
#ifndef CLR_FP64
#error "CLR_FP64 must be 1 (the device has doubles) or 0"
#endif

#if defined(__clang__)
// Functions that are inlined have no calling convention to warn of; PoCL counts such warnings on the program's stderr.
#pragma clang diagnostic ignored "-Wpsabi"
#endif
#pragma OPENCL FP_CONTRACT OFF
#if CLR_FP64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#endif

#define CLR_NAMESPACE_BEGIN
#define CLR_NAMESPACE_END
#if defined(POCL_DEVICE_ADDRESS_BITS)
// PoCL leaves functions that return structures as calls: read-outs over groups take 2.4 times as long. Not for others:
// oclgrind cannot run what clang makes of it.
#define CLR_FN static inline __attribute__((always_inline))
#define CLR_RARE_FN static __attribute__((noinline))  // large, and seldom called
// All that a work-item does: PoCL makes three functions of a kernel, and would compile three times what they inline.
#define CLR_WORK_FN static __attribute__((noinline))
// OpenCL's own prefetch() does nothing there. Any address will do.
#define clr_prefetch(p) __builtin_prefetch((const void*)(size_t)(p), 0, 2)
#else
#define CLR_FN static inline
#define CLR_RARE_FN static
#define CLR_WORK_FN static inline
#define clr_prefetch(p) ((void)(p))
#endif
#if defined(__clang__)
#define CLR_UNROLL _Pragma("unroll")  // short loops over arrays of vectors: PoCL would keep them, and the arrays, in memory
#else
#define CLR_UNROLL
#endif
#define CLR_CONSTANT constant
#define CLR_GLOBAL global
#define CLR_JOIN_(a, b) a##b
#define CLR_JOIN(a, b) CLR_JOIN_(a, b)

typedef uint clr_u32;
typedef ulong clr_u64;

#if CLR_WIDTH == 32
typedef float clr_real __attribute__((ext_vector_type(32)));
typedef uint clr_uint __attribute__((ext_vector_type(32)));
typedef int clr_int __attribute__((ext_vector_type(32)));
typedef int clr_mask __attribute__((ext_vector_type(32)));
typedef ulong clr_wide __attribute__((ext_vector_type(32)));
typedef float clr_unaligned_real __attribute__((ext_vector_type(32), aligned(4)));
typedef uint clr_unaligned_uint __attribute__((ext_vector_type(32), aligned(4)));
#define clr_to_real(x) __builtin_convertvector(x, clr_real)
#define clr_to_uint(x) __builtin_convertvector(x, clr_uint)
#define clr_to_int(x) __builtin_convertvector(x, clr_int)
#define clr_to_wide(x) __builtin_convertvector(x, clr_wide)
#define clr_bits(x) __builtin_astype(x, clr_uint)
#define clr_from_bits(x) __builtin_astype(x, clr_real)
#define CLR_UNALIGNED(space, element, vector, unaligned)                                                                    \
    static inline vector __attribute__((overloadable)) clr_load(const space element* p) {                                   \
        return *(const space unaligned*)p;                                                                                  \
    }                                                                                                                       \
    static inline void __attribute__((overloadable)) clr_store(vector v, space element* p) { *(space unaligned*)p = v; }
CLR_UNALIGNED(global, float, clr_real, clr_unaligned_real)
CLR_UNALIGNED(private, float, clr_real, clr_unaligned_real)
CLR_UNALIGNED(global, uint, clr_uint, clr_unaligned_uint)
CLR_UNALIGNED(private, uint, clr_uint, clr_unaligned_uint)
#elif CLR_WIDTH == 1
typedef float clr_real;
typedef uint clr_uint;
typedef int clr_int;
typedef int clr_mask;
typedef ulong clr_wide;
#define clr_to_real(x) convert_float(x)
#define clr_to_uint(x) convert_uint(x)
#define clr_to_int(x) convert_int(x)
#define clr_to_wide(x) convert_ulong(x)
#define clr_bits(x) as_uint(x)
#define clr_from_bits(x) as_float(x)
#define clr_load(p) (*(p))
#define clr_store(v, p) (*(p) = (v))
#define clr_any(m) ((m) != 0)
#if CLR_FP64
typedef double clr_double;
typedef int clr_double_mask;
#define clr_to_double(x) convert_double(x)
#define clr_double_from_bits(x) as_double(x)
#define clr_double_bits(x) as_ulong(x)
#endif
#else
typedef CLR_JOIN(float, CLR_WIDTH) clr_real;
typedef CLR_JOIN(uint, CLR_WIDTH) clr_uint;
typedef CLR_JOIN(int, CLR_WIDTH) clr_int;
typedef CLR_JOIN(int, CLR_WIDTH) clr_mask;
typedef CLR_JOIN(ulong, CLR_WIDTH) clr_wide;
#define clr_to_real(x) CLR_JOIN(convert_float, CLR_WIDTH)(x)
#define clr_to_uint(x) CLR_JOIN(convert_uint, CLR_WIDTH)(x)
#define clr_to_int(x) CLR_JOIN(convert_int, CLR_WIDTH)(x)
#define clr_to_wide(x) CLR_JOIN(convert_ulong, CLR_WIDTH)(x)
#define clr_bits(x) CLR_JOIN(as_uint, CLR_WIDTH)(x)
#define clr_from_bits(x) CLR_JOIN(as_float, CLR_WIDTH)(x)
#define clr_load(p) CLR_JOIN(vload, CLR_WIDTH)(0, p)
#define clr_store(v, p) CLR_JOIN(vstore, CLR_WIDTH)(v, 0, p)
#if CLR_FP64
typedef CLR_JOIN(double, CLR_WIDTH) clr_double;
typedef CLR_JOIN(long, CLR_WIDTH) clr_double_mask;
#define clr_to_double(x) CLR_JOIN(convert_double, CLR_WIDTH)(x)
#define clr_double_from_bits(x) CLR_JOIN(as_double, CLR_WIDTH)(x)
#define clr_double_bits(x) CLR_JOIN(as_ulong, CLR_WIDTH)(x)
#endif
#endif

// Whether some lane of a mask is set. PoCL's any() takes wide masks apart: measured with AVX-512, stateless combine is 1.5
// times as fast without it where the arrays are in cache.
#if CLR_WIDTH >= 8
static inline int clr_any(clr_mask m) {
#if CLR_WIDTH == 8
    const long4 quarters = as_long4(m);
#else
#if CLR_WIDTH == 16
    const long8 halves = as_long8(m);
#else
    const long8 halves = as_long8(m.lo | m.hi);
#endif
    const long4 quarters = halves.lo | halves.hi;
#endif
    const long2 ends = quarters.lo | quarters.hi;
    return (ends.x | ends.y) != 0;
}
#elif CLR_WIDTH > 1
#define clr_any(m) any(m)
#endif

#if CLR_WIDTH < 8 || CLR_WIDTH == 32
typedef clr_wide clr_pairs;
#define clr_even_lanes(x) clr_to_wide(x)
#define clr_odd_lanes(x) ((clr_pairs)(0))
#define clr_interleave(even, odd) clr_to_uint(even)
#define clr_interleave_wide(even, odd) (even)
#if CLR_WIDTH == 1
#define clr_signed_pairs(x) as_long(x)
#define clr_unsigned_pairs(x) as_ulong(x)
#else
#define clr_signed_pairs(x) CLR_JOIN(as_long, CLR_WIDTH)(x)
#define clr_unsigned_pairs(x) CLR_JOIN(as_ulong, CLR_WIDTH)(x)
#endif
#else
#if CLR_WIDTH == 8
typedef ulong4 clr_pairs;
#define clr_even_lanes(x) as_ulong4(x)
#define clr_interleave_wide(even, odd)                                                                                      \
    ((clr_wide)((even).s0, (odd).s0, (even).s1, (odd).s1, (even).s2, (odd).s2, (even).s3, (odd).s3))
#define clr_signed_pairs(x) as_long4(x)
#define clr_unsigned_pairs(x) as_ulong4(x)
#else
typedef ulong8 clr_pairs;
#define clr_even_lanes(x) as_ulong8(x)
#define clr_interleave_wide(even, odd)                                                                                      \
    ((clr_wide)((even).s0, (odd).s0, (even).s1, (odd).s1, (even).s2, (odd).s2, (even).s3, (odd).s3, (even).s4, (odd).s4,    \
                (even).s5, (odd).s5, (even).s6, (odd).s6, (even).s7, (odd).s7))
#define clr_signed_pairs(x) as_long8(x)
#define clr_unsigned_pairs(x) as_ulong8(x)
#endif
#define clr_odd_lanes(x) (clr_even_lanes(x) >> 32)
#define clr_interleave(even, odd) CLR_JOIN(as_uint, CLR_WIDTH)(((even) & (clr_pairs)(0xffffffffUL)) | ((odd) << 32))
#endif

// Of the low halves, both with a sign; and a 64-bit lane with a sign shifted to the right.
#define clr_signed_half(x) (clr_signed_pairs((x) << 32) >> 32)
#define clr_signed_product(a, b) clr_unsigned_pairs(clr_signed_half(a) * clr_signed_half(b))
#define clr_signed_shift(x, by) clr_unsigned_pairs(clr_signed_pairs(x) >> (by))

#if CLR_WIDTH == 32
static inline clr_real clr_fma(clr_real a, clr_real b, clr_real c) {
    return (clr_real)(fma(a.lo, b.lo, c.lo), fma(a.hi, b.hi, c.hi));
}
static inline clr_real clr_sqrt(clr_real x) { return (clr_real)(sqrt(x.lo), sqrt(x.hi)); }
static inline clr_real clr_floor(clr_real x) { return (clr_real)(floor(x.lo), floor(x.hi)); }
static inline clr_real clr_abs(clr_real x) { return (clr_real)(fabs(x.lo), fabs(x.hi)); }
#else
#define clr_fma(a, b, c) fma(a, b, c)
#define clr_sqrt(x) sqrt(x)
#define clr_floor(x) floor(x)
#define clr_abs(x) fabs(x)
#endif

#else  // C++

#if defined(__FAST_MATH__)
#error "clratio's device headers promise exact bits: compile without -ffast-math"
#endif

#include <bit>
#include <cmath>
#include <cstdint>

#define CLR_WIDTH 1
#define CLR_FP64 1
#define CLR_UNROLL
#define CLR_NAMESPACE_BEGIN namespace clratio::device {
#define CLR_NAMESPACE_END }
#define CLR_FN inline
#define CLR_CONSTANT constexpr
#define CLR_GLOBAL

CLR_NAMESPACE_BEGIN

using clr_u32 = std::uint32_t;
using clr_u64 = std::uint64_t;
using clr_real = float;
using clr_uint = std::uint32_t;
using clr_int = std::int32_t;
using clr_mask = bool;
using clr_wide = std::uint64_t;
using clr_pairs = std::uint64_t;
using clr_double = double;
using clr_double_mask = bool;

template <class T> float clr_to_real(T x) { return static_cast<float>(x); }
template <class T> clr_uint clr_to_uint(T x) { return static_cast<clr_uint>(x); }
template <class T> clr_int clr_to_int(T x) { return static_cast<clr_int>(x); }
template <class T> clr_wide clr_to_wide(T x) { return static_cast<clr_wide>(x); }
inline clr_pairs clr_even_lanes(clr_uint x) { return x; }
inline clr_pairs clr_odd_lanes(clr_uint) { return 0; }
inline clr_uint clr_interleave(clr_pairs even, clr_pairs) { return static_cast<clr_uint>(even); }
inline clr_wide clr_interleave_wide(clr_pairs even, clr_pairs) { return even; }
inline clr_pairs clr_signed_product(clr_pairs a, clr_pairs b) {
    return static_cast<clr_pairs>(std::int64_t{static_cast<std::int32_t>(a)} * std::int64_t{static_cast<std::int32_t>(b)});
}
inline clr_pairs clr_signed_shift(clr_pairs x, int by) { return static_cast<clr_pairs>(static_cast<std::int64_t>(x) >> by); }
template <class T> double clr_to_double(T x) { return static_cast<double>(x); }
inline clr_uint clr_bits(float x) { return std::bit_cast<clr_uint>(x); }
inline float clr_from_bits(clr_uint x) { return std::bit_cast<float>(x); }
inline clr_u64 clr_double_bits(double x) { return std::bit_cast<clr_u64>(x); }
inline double clr_double_from_bits(clr_u64 x) { return std::bit_cast<double>(x); }
inline bool clr_any(bool m) { return m; }
template <class T> T clr_fma(T a, T b, T c) { return std::fma(a, b, c); }
template <class T> T clr_sqrt(T x) { return std::sqrt(x); }
template <class T> T clr_floor(T x) { return std::floor(x); }
template <class T> T clr_abs(T x) { return std::fabs(x); }

CLR_NAMESPACE_END

#endif

CLR_NAMESPACE_BEGIN

#define CLR_REAL_MAX 3.402823466e+38f

CLR_FN clr_mask clr_is_finite(clr_real x) { return clr_abs(x) <= (clr_real)(CLR_REAL_MAX); }

CLR_NAMESPACE_END

#endif
