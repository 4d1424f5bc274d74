// A box of fog in collimated light, its camera rays, and the optical paths on them. Lanes are neighbouring pixels of one
// row. Source of the formulas: docs/medium.md.
#ifndef CLRATIO_DEVICE_MEDIUM_RAY_H
#define CLRATIO_DEVICE_MEDIUM_RAY_H

#include "clratio/device/exponential.h"
#include "clratio/device/quantile.h"
#include "clratio/device/twofloat.h"

CLR_NAMESPACE_BEGIN

// Samplings.
#define CLR_UNI 0u
#define CLR_DS 1u
#define CLR_DSA 2u
#define CLR_DSM 3u
#define CLR_WVDS_MEAN 4u
#define CLR_WVDS_MIN 5u
#define CLR_WVDS_MIS 6u

// Patterns.
#define CLR_IID 0u
#define CLR_STRATIFIED 1u
#define CLR_OFFSET 2u

#define CLR_MOST_LEVELS 7u
#define CLR_MOST_OCCLUDERS 256u      // of each kind
#define CLR_INDEPENDENT 0x80000000u  // of the stream id: t of other samples

#define CLR_FAR 1e30f          // longer than any distance in a scene
#define CLR_LEAST_RISE 1e-18f  // of phi over a piece: a flat piece is this steep, which changes no bit of any result
#define CLR_LOG2_E 1.44269504f

// A scene as kernels take it. Channels are in the order of their sigma, those without light last; `channel` says which is
// which. Axes along which the light does not travel have inverse_omega 0 and an exit CLR_FAR away.
typedef struct {
    float eye[3];
    float forward[2][3], right[2][3], up[2][3];  // two floats each; right and up reach from one pixel half way to the next
    float to_lo[2][3], to_hi[2][3];              // two floats each; from the eye to the corners of the box
    float lo[3], hi[3];
    float omega[3], inverse_omega[3], exit[3], beyond[3];
    float across[2][3];                             // with omega an orthonormal frame
    float skew[3];                                  // inverse_omega, or 1 where that is 0
    float sigma[3], inverse_sigma[3], strength[3];  // strength: sigma_s times irradiance
    float sigma_mean, inverse_sigma_mean;
    float phase[3];  // (1 - g^2) / (4 pi), 1 + g^2, 2 g
    clr_u32 channel[3];
    clr_u32 width, height, spheres, boxes, axial, plane;  // axial: some inverse_omega is 0; plane: see shares
} clr_medium;

// One after the other in memory, spheres first.
// Sphere: eye - centre, radius^2; the centre along across[0], across[1] and omega, 0.
// Box: lo - eye, hi - eye; the bounds of its shadow, see clr_box_bounds.
#define CLR_SPHERE_FLOATS 8u
#define CLR_BOX_FLOATS 18u

// What to draw for each pixel.
typedef struct {
    clr_u32 pattern, independent, samples;
    float inverse_samples;
} clr_sampler;

// A camera ray in the medium: x in [0, length] from `origin`. phi(x) = x + min_k (exit[k] + slope[k] x) is linear on three
// pieces, knot[i] to knot[i + 1], some of them empty.
typedef struct {
    clr_real length, phase;
    clr_real origin[3], direction[3];
    clr_real exit[3], slope[3];
    clr_real knot[4], phi[4];
    clr_real integral[3][3];  // of exp(-sigma phi) for each channel over each piece
    clr_real tau[3];
} clr_medium_ray;

// 2^y for y clamped to [-125, 125]; relative error below 1.8e-7, 1 at 0.
CLR_FN clr_real clr_exp2(clr_real y) {
    const clr_real high = (clr_real)(125.0f), low = (clr_real)(-125.0f);
    const clr_real below = y > high ? high : y;
    const clr_real c = below < low ? low : below;
    const clr_real shifted = c + (clr_real)(0x1.8p23f);
    const clr_real r = c - (shifted - (clr_real)(0x1.8p23f));
    clr_real p = (clr_real)(1.3264727e-3f);
    p = clr_fma(p, r, (clr_real)(9.671513e-3f));
    p = clr_fma(p, r, (clr_real)(5.5507336e-2f));
    p = clr_fma(p, r, (clr_real)(2.4022242e-1f));
    p = clr_fma(p, r, (clr_real)(6.931470e-1f));
    p = clr_fma(p, r, (clr_real)(1.0f));
    return clr_from_bits(clr_bits(p) + (clr_bits(shifted) << 23));
}

// 1 - e^-z for z >= 0; relative error below 2.5e-7.
CLR_FN clr_real clr_decayed(clr_real z) {
    clr_real p = (clr_real)(-1.1216349e-3f);
    p = clr_fma(p, z, (clr_real)(8.187386e-3f));
    p = clr_fma(p, z, (clr_real)(-4.162909e-2f));
    p = clr_fma(p, z, (clr_real)(1.6666225e-1f));
    p = clr_fma(p, z, (clr_real)(-0.49999982f));
    p = clr_fma(p, z, (clr_real)(1.0f));
    return z < (clr_real)(0.5f) ? p * z : (clr_real)(1.0f) - clr_exp2((clr_real)(-CLR_LOG2_E) * z);
}

// -log(1 + t) for -1 < t <= 0, relative error below 3e-7 however small t is; t is kept from -1 by half an ulp.
CLR_FN clr_real clr_minus_log1p(clr_real t) {
    const clr_real least = (clr_real)(-0.99999994f);
    const clr_real kept = t > least ? t : least;
    const clr_uint bits = clr_bits(kept + (clr_real)(1.0f));
    const clr_int e = clr_to_int(bits - (clr_uint)(0x3f3504f3u)) >> 23;
    const clr_real m = clr_from_bits(bits - (clr_to_uint(e) << 23));
    const clr_real f = e == (clr_int)(0) ? kept : m - (clr_real)(1.0f);
    const clr_real p = clr_log_polynomial(f);
    const clr_real square = f * f;
    const clr_real log_m = f + clr_fma(square * f, p, (clr_real)(-0.5f) * square);
    return clr_fma(clr_to_real(e), (clr_real)(-0.69314718f), -log_m);
}

CLR_FN clr_real clr_least(clr_real a, clr_real b) { return a < b ? a : b; }
CLR_FN clr_real clr_most(clr_real a, clr_real b) { return a > b ? a : b; }
CLR_FN clr_real clr_clamp(clr_real x, clr_real lo, clr_real hi) { return clr_least(clr_most(x, lo), hi); }

// One of three, by two masks of which the second implies the first.
CLR_FN clr_real clr_pick(clr_real a, clr_real b, clr_real c, clr_mask from_b, clr_mask from_c) {
    const clr_real ab = from_b ? b : a;
    return from_c ? c : ab;
}

typedef struct {
    clr_real enter, leave;
} clr_span_of_ray;

// 1 / direction, 1 where that is 0.
typedef struct {
    clr_real x[3];
} clr_inverse;

// Where a ray from 0 enters and leaves the box whose corners are the floats from `corners` on; enter > leave where it
// misses.
CLR_FN clr_span_of_ray clr_slabs(const clr_real* direction, clr_inverse inverse, CLR_GLOBAL const float* corners) {
    clr_span_of_ray s;
    s.enter = (clr_real)(-CLR_FAR);
    s.leave = (clr_real)(CLR_FAR);
    for (int k = 0; k < 3; ++k) {
        const float lo = corners[k], hi = corners[3 + k];
        const clr_mask along = direction[k] == (clr_real)(0.0f);
        const clr_real reach = (clr_real)(lo <= 0.0f && hi >= 0.0f ? CLR_FAR : -CLR_FAR);
        const clr_real a = (clr_real)(lo)*inverse.x[k], b = (clr_real)(hi)*inverse.x[k];
        s.enter = clr_most(s.enter, along ? -reach : clr_least(a, b));
        s.leave = clr_least(s.leave, along ? reach : clr_most(a, b));
    }
    return s;
}

CLR_FN clr_real clr_dot(const clr_real* a, const clr_real* b) {
    return clr_fma(a[2], b[2], clr_fma(a[1], b[1], a[0] * b[0]));
}
CLR_FN clr_real clr_dot_scalar(const float* a, const clr_real* b) {
    return clr_fma((clr_real)(a[2]), b[2], clr_fma((clr_real)(a[1]), b[1], (clr_real)(a[0]) * b[0]));
}

// Where a ray from 0 enters a sphere around -q, CLR_FAR if it misses. The discriminant is R^2 - |q - (q w) w|^2: the other
// form loses all digits of distant spheres.
CLR_FN clr_real clr_enter_sphere(const clr_real* direction, CLR_GLOBAL const float* sphere) {
    const float q[3] = {sphere[0], sphere[1], sphere[2]};
    const clr_real along = clr_dot_scalar(q, direction);
    clr_real off[3];
    for (int k = 0; k < 3; ++k) off[k] = clr_fma(-along, direction[k], (clr_real)(q[k]));
    const clr_real d = (clr_real)(sphere[3]) - clr_dot(off, off);
    const clr_real root = clr_sqrt(clr_most(d, (clr_real)(0.0f)));
    return d > (clr_real)(0.0f) ? -along - root : (clr_real)(CLR_FAR);
}

// The first occluder in front of the camera.
CLR_FN clr_real clr_first_hit(clr_medium s, CLR_GLOBAL const float* occluders, const clr_real* direction) {
    const clr_real zero = (clr_real)(0.0f);
    clr_real first = (clr_real)(CLR_FAR);
    clr_inverse inverse;
    for (int k = 0; k < 3; ++k) inverse.x[k] = (clr_real)(1.0f) / (direction[k] == zero ? (clr_real)(1.0f) : direction[k]);
    for (clr_u32 i = 0; i < s.spheres; ++i) {
        const clr_real enter = clr_enter_sphere(direction, occluders + i * CLR_SPHERE_FLOATS);
        first = enter > zero ? clr_least(first, enter) : first;
    }
    CLR_GLOBAL const float* boxes = occluders + s.spheres * CLR_SPHERE_FLOATS;
    for (clr_u32 i = 0; i < s.boxes; ++i) {
        const clr_span_of_ray span = clr_slabs(direction, inverse, boxes + i * CLR_BOX_FLOATS);
        const clr_real enter = span.leave >= span.enter ? span.enter : zero;
        first = enter > zero ? clr_least(first, enter) : first;
    }
    return first;
}

// Where line j meets line i of a falling sequence of slopes.
CLR_FN clr_real clr_crossing(const clr_medium_ray* ray, int i, int j) {
    const clr_real far = (clr_real)(CLR_FAR), zero = (clr_real)(0.0f);
    const clr_real fall = ray->slope[i] - ray->slope[j], gap = ray->exit[j] - ray->exit[i];
    const clr_real parallel = gap < zero ? -far : far;
    return fall > zero ? gap / (fall > zero ? fall : far) : parallel;
}

CLR_FN clr_real clr_phi(const clr_medium_ray* ray, clr_real x) {
    clr_real d = clr_fma(ray->slope[0], x, ray->exit[0]);
    d = clr_least(d, clr_fma(ray->slope[1], x, ray->exit[1]));
    d = clr_least(d, clr_fma(ray->slope[2], x, ray->exit[2]));
    return x + clr_most(d, (clr_real)(0.0f));
}

// phi where line `one` meets line `other`, or where the middle one is not on the envelope line `beyond`: on the flatter of
// the two. Light that grazes a face makes lines so steep that their differences lose most digits.
CLR_FN clr_real clr_phi_at_bend(const clr_medium_ray* ray, clr_real x, clr_mask middle, int one, int other, int beyond) {
    const clr_real exit = middle ? ray->exit[other] : ray->exit[beyond];
    const clr_real slope = middle ? ray->slope[other] : ray->slope[beyond];
    const clr_mask flatter = clr_abs(slope) < clr_abs(ray->slope[one]);
    const clr_real d = clr_fma(flatter ? slope : ray->slope[one], x, flatter ? exit : ray->exit[one]);
    const clr_mask bend = (x > (clr_real)(0.0f)) & (x < ray->length);
    return bend ? x + clr_most(d, (clr_real)(0.0f)) : clr_phi(ray, x);
}

CLR_FN clr_medium_ray clr_swap_exits(clr_medium_ray ray, int i, int j) {
    const clr_mask wrong = ray.slope[i] < ray.slope[j];
    const clr_real a = ray.exit[i], b = ray.slope[i];
    ray.exit[i] = wrong ? ray.exit[j] : a;
    ray.slope[i] = wrong ? ray.slope[j] : b;
    ray.exit[j] = wrong ? a : ray.exit[j];
    ray.slope[j] = wrong ? b : ray.slope[j];
    return ray;
}

// The lower envelope of the three exit distances: with falling slopes, the middle line is on it only where its crossings are
// in order.
CLR_FN clr_medium_ray clr_find_pieces(clr_medium_ray ray) {
    const clr_real zero = (clr_real)(0.0f);
    ray = clr_swap_exits(ray, 0, 1);
    ray = clr_swap_exits(ray, 1, 2);
    ray = clr_swap_exits(ray, 0, 1);
    const clr_real first = clr_crossing(&ray, 0, 1), second = clr_crossing(&ray, 1, 2), skip = clr_crossing(&ray, 0, 2);
    const clr_mask middle = first <= second;
    ray.knot[0] = zero;
    ray.knot[1] = clr_clamp(middle ? first : skip, zero, ray.length);
    ray.knot[2] = clr_clamp(middle ? second : skip, zero, ray.length);
    ray.knot[3] = ray.length;
    ray.phi[0] = clr_phi(&ray, ray.knot[0]);
    ray.phi[1] = clr_phi_at_bend(&ray, ray.knot[1], middle, 0, 1, 2);
    ray.phi[2] = clr_phi_at_bend(&ray, ray.knot[2], middle, 2, 1, 0);
    ray.phi[3] = clr_phi(&ray, ray.knot[3]);
    return ray;
}

CLR_FN clr_real clr_rise(const clr_medium_ray* ray, int piece) {
    return clr_most(clr_abs(ray->phi[piece + 1] - ray->phi[piece]), (clr_real)(CLR_LEAST_RISE));
}

// The integral of exp(-sigma phi) over a piece: all terms positive, no digits lost.
CLR_FN clr_real clr_piece_integral(const clr_medium_ray* ray, int piece, float sigma) {
    const clr_real z = (clr_real)(sigma)*clr_rise(ray, piece);
    const clr_real low = clr_least(ray->phi[piece], ray->phi[piece + 1]);
    const clr_real length = ray->knot[piece + 1] - ray->knot[piece];
    return length * clr_exp((clr_real)(-sigma) * low) * (clr_decayed(z) / z);
}

// c + i a + j b, where each number but i and j is of two floats.
CLR_FN clr_two clr_combine_axes(const float c[2][3], clr_real i, const float a[2][3], clr_real j, const float b[2][3],
                                int k) {
    const clr_two ia = clr_two_product(i, (clr_real)(a[0][k])), jb = clr_two_product(j, (clr_real)(b[0][k]));
    const clr_two first = clr_two_sum((clr_real)(c[0][k]), ia.hi), second = clr_two_sum(first.hi, jb.hi);
    const clr_real low = clr_fma(j, (clr_real)(b[1][k]), clr_fma(i, (clr_real)(a[1][k]), (clr_real)(c[1][k])));
    return clr_two_make(second.hi, (first.lo + second.lo) + (ia.lo + jb.lo) + low);
}

// c / d within a few 2^-46, inverse = 1 / d.hi.
CLR_FN clr_two clr_two_quotient(float high, float low, clr_two d, clr_real inverse) {
    const clr_real q = (clr_real)(high)*inverse;
    const clr_real rest = clr_fma(-q, d.hi, (clr_real)(high)) + clr_fma(-q, d.lo, (clr_real)(low));
    return clr_two_make(q, rest * inverse);
}

CLR_FN clr_two clr_choose(clr_mask first, clr_two a, clr_two b) {
    return clr_two_make(first ? a.hi : b.hi, first ? a.lo : b.lo);
}

// Where a ray enters and leaves the medium's box, in units of its direction. In two floats: the ends of short chords at the
// edges of the box would lose most digits in one.
typedef struct {
    clr_two enter, leave;
} clr_chord;

CLR_FN clr_chord clr_box_chord(clr_medium s, const clr_two* direction) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    clr_chord chord;
    chord.enter = clr_two_make((clr_real)(-CLR_FAR), zero);
    chord.leave = clr_two_make((clr_real)(CLR_FAR), zero);
    for (int k = 0; k < 3; ++k) {
        const clr_mask along = direction[k].hi == zero;
        const clr_real reach = (clr_real)(s.to_lo[0][k] <= 0.0f && s.to_hi[0][k] >= 0.0f ? CLR_FAR : -CLR_FAR);
        const clr_two d = clr_choose(along, clr_two_make(one, zero), direction[k]);
        const clr_real inverse = one / d.hi;
        const clr_two a = clr_two_quotient(s.to_lo[0][k], s.to_lo[1][k], d, inverse);
        const clr_two b = clr_two_quotient(s.to_hi[0][k], s.to_hi[1][k], d, inverse);
        const clr_mask upward = d.hi > zero;
        const clr_two enter = clr_choose(along, clr_two_make(-reach, zero), clr_choose(upward, a, b));
        const clr_two leave = clr_choose(along, clr_two_make(reach, zero), clr_choose(upward, b, a));
        chord.enter = clr_choose(enter.hi > chord.enter.hi, enter, chord.enter);
        chord.leave = clr_choose(leave.hi < chord.leave.hi, leave, chord.leave);
    }
    chord.enter = clr_choose(chord.enter.hi > zero, chord.enter, clr_two_make(zero, zero));
    return chord;
}

// The ray through pixel (column, row). `row` is the same in all lanes.
CLR_FN clr_medium_ray clr_aim(clr_medium s, CLR_GLOBAL const float* occluders, clr_uint column, clr_u32 row) {
    const clr_real zero = (clr_real)(0.0f);
    clr_medium_ray ray;
    clr_two to[3];
    clr_real direction[3];
    const clr_real across = clr_to_real(clr_to_int(column + column) + (clr_int)(1 - (int)s.width));
    const clr_real above = (clr_real)((float)((int)s.height - 1 - 2 * (int)row));
    for (int k = 0; k < 3; ++k) {
        to[k] = clr_combine_axes(s.forward, across, s.right, above, s.up, k);
        direction[k] = to[k].hi;
    }
    const clr_real size = clr_sqrt(clr_dot(direction, direction));
    for (int k = 0; k < 3; ++k) ray.direction[k] = direction[k] / size;

    clr_chord chord = clr_box_chord(s, to);
    const clr_real stop = clr_first_hit(s, occluders, ray.direction) / size;
    chord.leave = clr_choose(stop < chord.leave.hi, clr_two_make(stop, zero), chord.leave);
    const clr_real span = (chord.leave.hi - chord.enter.hi) + (chord.leave.lo - chord.enter.lo);
    const clr_mask hit = span > zero;
    const clr_two start = clr_choose(hit, chord.enter, clr_two_make(zero, zero));
    ray.length = hit ? span * size : zero;
    for (int k = 0; k < 3; ++k) {
        const clr_real rest = clr_fma(start.hi, to[k].lo, start.lo * to[k].hi);
        const clr_real at = clr_fma(start.hi, to[k].hi, (clr_real)(s.eye[k])) + rest;
        ray.origin[k] = clr_clamp(at, (clr_real)(s.lo[k]), (clr_real)(s.hi[k]));
        ray.exit[k] =
            clr_fma((clr_real)(s.exit[k]) - ray.origin[k], (clr_real)(s.inverse_omega[k]), (clr_real)(s.beyond[k]));
        ray.slope[k] = ray.direction[k] * (clr_real)(-s.inverse_omega[k]);
    }
    ray = clr_find_pieces(ray);
    const clr_real base = clr_fma((clr_real)(-s.phase[2]), clr_dot_scalar(s.omega, ray.direction), (clr_real)(s.phase[1]));
    ray.phase = (clr_real)(s.phase[0]) / (base * clr_sqrt(base));
    for (int c = 0; c < 3; ++c) {
        for (int i = 0; i < 3; ++i) ray.integral[c][i] = clr_piece_integral(&ray, i, s.sigma[c]);
        const clr_real sum = ray.integral[c][0] + ray.integral[c][1] + ray.integral[c][2];
        ray.tau[c] = (clr_real)(s.strength[c]) * ray.phase * sum;
    }
    return ray;
}

CLR_NAMESPACE_END

#endif
