// Single scattering of collimated light in a box of fog: camera rays, the optical paths on them, the samplers and the
// shadows. Lanes are neighbouring pixels of one row. What is the same for all samples of a ray is set up once; a sample is
// then
// + - * fma, comparisons and at most one division, without branches. Source of the formulas: docs/medium.md.
#ifndef CLRATIO_DEVICE_MEDIUM_H
#define CLRATIO_DEVICE_MEDIUM_H

#include "clratio/device/exponential.h"
#include "clratio/device/histogram.h"
#include "clratio/device/quantile.h"
#include "clratio/device/stream.h"
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

// The inverse of a cumulative distribution that decays exponentially over an interval of u: the optical depth travelled is
// -log(1 + t), t linear in u.
typedef struct {
    clr_real slope, offset;
} clr_line;

// u from `from` to `from + share` maps to depths 0 to z, or z to 0 where `falling`.
CLR_FN clr_line clr_depth_line(clr_real from, clr_real share, clr_real z, clr_mask falling) {
    const clr_real zero = (clr_real)(0.0f);
    const clr_real steep = share > zero ? clr_decayed(z) / (share > zero ? share : (clr_real)(1.0f)) : zero;
    clr_line l;
    l.slope = falling ? steep : -steep;
    l.offset = falling ? -steep * (from + share) : steep * from;
    return l;
}

// Everything about a sampling that is the same for all samples of a ray.
typedef struct {
    clr_real scale[3];             // of the weights
    clr_real channel_from[2];      // of u: where channels 1 and 2 begin
    clr_real piece_from[3][2];     // where pieces 1 and 2 of each channel begin
    clr_line depth[3][3];          // [channel][piece]
    clr_real low[3], rise[3];      // phi of each piece from its thin end
    clr_real start[3], stride[3];  // x at the thin end, and its change for each unit of phi
} clr_medium_plan;

CLR_FN clr_medium_plan clr_plan_pieces(clr_medium_plan plan, const clr_medium_ray* ray) {
    for (int i = 0; i < 3; ++i) {
        const clr_mask falls = ray->phi[i + 1] < ray->phi[i];
        const clr_real length = ray->knot[i + 1] - ray->knot[i];
        plan.low[i] = falls ? ray->phi[i + 1] : ray->phi[i];
        plan.rise[i] = clr_rise(ray, i);
        plan.start[i] = falls ? ray->knot[i + 1] : ray->knot[i];
        plan.stride[i] = (falls ? -length : length) / plan.rise[i];
    }
    return plan;
}

// Channel c's pieces share out u from `from` on, piece i taking integral[i] * share.
CLR_FN clr_medium_plan clr_plan_channel(clr_medium_plan plan, const clr_medium_ray* ray, int c, float sigma,
                                        const clr_real* integral, clr_real from, clr_real share) {
    for (int i = 0; i < 3; ++i) {
        const clr_real part = integral[i] * share;
        plan.depth[c][i] = clr_depth_line(from, part, (clr_real)(sigma)*plan.rise[i], ray->phi[i + 1] < ray->phi[i]);
        from = from + part;
        if (i < 2) plan.piece_from[c][i] = from;
    }
    return plan;
}

CLR_FN clr_real clr_inverse_or_zero(clr_real x) {
    const clr_mask some = x > (clr_real)(0.0f);
    return some ? (clr_real)(1.0f) / (some ? x : (clr_real)(1.0f)) : (clr_real)(0.0f);
}

// Of all channels, with light or without.
CLR_FN float clr_least_sigma(clr_medium s) {
    const float ab = s.sigma[0] < s.sigma[1] ? s.sigma[0] : s.sigma[1];
    return ab < s.sigma[2] ? ab : s.sigma[2];
}

CLR_FN clr_medium_plan clr_make_plan(clr_u32 sampling, clr_medium s, const clr_medium_ray* ray) {
    const clr_real zero = (clr_real)(0.0f), one = (clr_real)(1.0f);
    const clr_mask never = zero > one;
    clr_medium_plan plan;
    for (int c = 0; c < 3; ++c) {
        plan.scale[c] = (clr_real)(s.strength[c]) * ray->phase;
        for (int i = 0; i < 3; ++i) {
            plan.depth[c][i].slope = zero;
            plan.depth[c][i].offset = zero;
        }
        plan.piece_from[c][0] = one;
        plan.piece_from[c][1] = one;
        plan.low[c] = zero;
        plan.rise[c] = ray->length;
        plan.start[c] = zero;
        plan.stride[c] = one;
    }
    plan.channel_from[0] = one;
    plan.channel_from[1] = one;
    const clr_real sum = ray->tau[0] + ray->tau[1] + ray->tau[2];
    if (sampling == CLR_UNI)
        for (int c = 0; c < 3; ++c) plan.scale[c] = plan.scale[c] * ray->length;
    if (sampling == CLR_DS) {
        const clr_real z = clr_most((clr_real)(s.sigma_mean) * ray->length, (clr_real)(CLR_LEAST_RISE));
        plan.depth[0][0] = clr_depth_line(zero, one, z, never);
        for (int c = 0; c < 3; ++c) plan.scale[c] = plan.scale[c] * ray->length * (clr_decayed(z) / z);
    }
    if (sampling == CLR_DSA) {
        plan.depth[0][0].slope = -one;
        for (int c = 0; c < 3; ++c) plan.scale[c] = plan.scale[c] * (clr_real)(s.inverse_sigma_mean);
    }
    if (sampling == CLR_DSM) {
        const clr_real third = (clr_real)(0.33333334f);
        for (int c = 0; c < 3; ++c) {
            const clr_real z = clr_most((clr_real)(s.sigma[c]) * ray->length, (clr_real)(CLR_LEAST_RISE));
            plan.depth[c][0] = clr_depth_line((clr_real)((float)c) * third, third, z, never);
            plan.low[c] = third * clr_inverse_or_zero(ray->length * (clr_decayed(z) / z));
        }
        plan.channel_from[0] = third;
        plan.channel_from[1] = third + third;
    }
    if (sampling == CLR_WVDS_MEAN || sampling == CLR_WVDS_MIN) {
        const float sigma = sampling == CLR_WVDS_MEAN ? s.sigma_mean : clr_least_sigma(s);
        clr_real integral[3];
        for (int i = 0; i < 3; ++i) integral[i] = clr_piece_integral(ray, i, sigma);
        const clr_real whole = integral[0] + integral[1] + integral[2];
        plan = clr_plan_pieces(plan, ray);
        plan = clr_plan_channel(plan, ray, 0, sigma, integral, zero, clr_inverse_or_zero(whole));
        for (int c = 0; c < 3; ++c) plan.scale[c] = plan.scale[c] * whole;
    }
    if (sampling == CLR_WVDS_MIS) {
        const clr_real share = ray->phase * clr_inverse_or_zero(sum);
        plan = clr_plan_pieces(plan, ray);
        clr_real from = zero;
        for (int c = 0; c < 3; ++c) {
            plan = clr_plan_channel(plan, ray, c, s.sigma[c], ray->integral[c], from, (clr_real)(s.strength[c]) * share);
            from = from + ray->tau[c] * clr_inverse_or_zero(sum);
            if (c < 2) plan.channel_from[c] = from;
            plan.scale[c] = sum;
        }
    }
    return plan;
}

// One sample: where it lies and what it is worth without occluders.
typedef struct {
    clr_real x, t[3];
} clr_medium_sample;

CLR_FN clr_medium_sample clr_sample_uniform(clr_medium s, const clr_medium_ray* ray, const clr_medium_plan* plan,
                                            clr_real u) {
    clr_medium_sample out;
    out.x = u * ray->length;
    const clr_real phi = clr_phi(ray, out.x);
    CLR_UNROLL
    for (int c = 0; c < 3; ++c) out.t[c] = plan->scale[c] * clr_exp2((clr_real)(-s.sigma[c] * CLR_LOG2_E) * phi);
    return out;
}

// DS and DSA: 1 / p = e^(sigma_mean x) times a constant of the ray.
CLR_FN clr_medium_sample clr_sample_distance(clr_u32 sampling, clr_medium s, const clr_medium_ray* ray,
                                             const clr_medium_plan* plan, clr_real u) {
    clr_medium_sample out;
    const clr_real depth = clr_minus_log1p(clr_fma(plan->depth[0][0].slope, u, plan->depth[0][0].offset));
    const clr_real x = depth * (clr_real)(s.inverse_sigma_mean);
    const clr_mask inside = x < ray->length;
    out.x = clr_clamp(x, (clr_real)(0.0f), ray->length);
    const clr_real phi = clr_phi(ray, out.x), back = (clr_real)(s.sigma_mean * CLR_LOG2_E) * out.x;
    CLR_UNROLL
    for (int c = 0; c < 3; ++c) {
        const clr_real t = plan->scale[c] * clr_exp2(clr_fma((clr_real)(-s.sigma[c] * CLR_LOG2_E), phi, back));
        out.t[c] = sampling == CLR_DSA ? (inside ? t : (clr_real)(0.0f)) : t;
    }
    return out;
}

// DSM: low[j] e^(-sigma_j x) is the density's part j.
CLR_FN clr_medium_sample clr_sample_distance_mis(clr_medium s, const clr_medium_ray* ray, const clr_medium_plan* plan,
                                                 clr_real u) {
    clr_medium_sample out;
    const clr_mask b = u >= plan->channel_from[0], c2 = u >= plan->channel_from[1];
    const clr_real slope = clr_pick(plan->depth[0][0].slope, plan->depth[1][0].slope, plan->depth[2][0].slope, b, c2);
    const clr_real offset = clr_pick(plan->depth[0][0].offset, plan->depth[1][0].offset, plan->depth[2][0].offset, b, c2);
    const clr_real inverse =
        clr_pick((clr_real)(s.inverse_sigma[0]), (clr_real)(s.inverse_sigma[1]), (clr_real)(s.inverse_sigma[2]), b, c2);
    out.x = clr_clamp(clr_minus_log1p(clr_fma(slope, u, offset)) * inverse, (clr_real)(0.0f), ray->length);
    const clr_real phi = clr_phi(ray, out.x);
    const clr_real back = (clr_real)(s.sigma[0] * CLR_LOG2_E) * out.x;
    clr_real density = plan->low[0];
    CLR_UNROLL
    for (int c = 1; c < 3; ++c)
        density = clr_fma(plan->low[c], clr_exp2(clr_fma((clr_real)(-s.sigma[c] * CLR_LOG2_E), out.x, back)), density);
    const clr_real inverse_density = clr_inverse_or_zero(density);
    CLR_UNROLL
    for (int c = 0; c < 3; ++c)
        out.t[c] = plan->scale[c] * inverse_density * clr_exp2(clr_fma((clr_real)(-s.sigma[c] * CLR_LOG2_E), phi, back));
    return out;
}

typedef struct {
    clr_real x, phi;
} clr_medium_place;

// The place on the ray where u falls: its piece, and how deep in it.
CLR_FN clr_medium_place clr_place(const clr_medium_ray* ray, const clr_medium_plan* plan, clr_real u, clr_mask in1,
                                  clr_mask in2, clr_line line, clr_real inverse_sigma) {
    clr_medium_place p;
    const clr_real rise = clr_pick(plan->rise[0], plan->rise[1], plan->rise[2], in1, in2);
    const clr_real depth = clr_minus_log1p(clr_fma(line.slope, u, line.offset));
    const clr_real above = clr_clamp(depth * inverse_sigma, (clr_real)(0.0f), rise);
    p.phi = clr_pick(plan->low[0], plan->low[1], plan->low[2], in1, in2) + above;
    const clr_real x = clr_fma(above, clr_pick(plan->stride[0], plan->stride[1], plan->stride[2], in1, in2),
                               clr_pick(plan->start[0], plan->start[1], plan->start[2], in1, in2));
    p.x = clr_clamp(x, (clr_real)(0.0f), ray->length);
    return p;
}

// WVDS with one sigma: 1 / p = e^(sigma phi) times a constant of the ray. One exponential, so that t is constant where the
// channel's sigma is this one.
CLR_FN clr_medium_sample clr_sample_wvds(float sigma, clr_medium s, const clr_medium_ray* ray, const clr_medium_plan* plan,
                                         clr_real u) {
    const clr_mask in1 = u >= plan->piece_from[0][0], in2 = u >= plan->piece_from[0][1];
    clr_line line;
    line.slope = clr_pick(plan->depth[0][0].slope, plan->depth[0][1].slope, plan->depth[0][2].slope, in1, in2);
    line.offset = clr_pick(plan->depth[0][0].offset, plan->depth[0][1].offset, plan->depth[0][2].offset, in1, in2);
    const clr_medium_place p = clr_place(ray, plan, u, in1, in2, line, (clr_real)(1.0f / sigma));
    clr_medium_sample out;
    out.x = p.x;
    CLR_UNROLL
    for (int c = 0; c < 3; ++c) out.t[c] = plan->scale[c] * clr_exp2((clr_real)((sigma - s.sigma[c]) * CLR_LOG2_E) * p.phi);
    return out;
}

// One-sample MIS with the balance heuristic and channel shares tau_c / sum tau: t_c = sum tau * e_c / sum e, e_c =
// strength_c exp(-(sigma_c - sigma_0) phi).
CLR_FN clr_medium_sample clr_sample_wvds_mis(clr_medium s, const clr_medium_ray* ray, const clr_medium_plan* plan,
                                             clr_real u) {
    const clr_mask b = u >= plan->channel_from[0], c2 = u >= plan->channel_from[1];
    const clr_mask in1 = u >= clr_pick(plan->piece_from[0][0], plan->piece_from[1][0], plan->piece_from[2][0], b, c2);
    const clr_mask in2 = u >= clr_pick(plan->piece_from[0][1], plan->piece_from[1][1], plan->piece_from[2][1], b, c2);
    clr_real slope[3], offset[3];
    CLR_UNROLL
    for (int i = 0; i < 3; ++i) {
        slope[i] = clr_pick(plan->depth[0][i].slope, plan->depth[1][i].slope, plan->depth[2][i].slope, b, c2);
        offset[i] = clr_pick(plan->depth[0][i].offset, plan->depth[1][i].offset, plan->depth[2][i].offset, b, c2);
    }
    clr_line line;
    line.slope = clr_pick(slope[0], slope[1], slope[2], in1, in2);
    line.offset = clr_pick(offset[0], offset[1], offset[2], in1, in2);
    const clr_real inverse =
        clr_pick((clr_real)(s.inverse_sigma[0]), (clr_real)(s.inverse_sigma[1]), (clr_real)(s.inverse_sigma[2]), b, c2);
    const clr_medium_place p = clr_place(ray, plan, u, in1, in2, line, inverse);
    clr_medium_sample out;
    out.x = p.x;
    const clr_real e0 = (clr_real)(s.strength[0]);
    const clr_real e1 = (clr_real)(s.strength[1]) * clr_exp2((clr_real)((s.sigma[0] - s.sigma[1]) * CLR_LOG2_E) * p.phi);
    const clr_real e2 = (clr_real)(s.strength[2]) * clr_exp2((clr_real)((s.sigma[0] - s.sigma[2]) * CLR_LOG2_E) * p.phi);
    const clr_real whole = plan->scale[0] / (e0 + e1 + e2);
    out.t[0] = e0 * whole;
    out.t[1] = e1 * whole;
    out.t[2] = e2 * whole;
    return out;
}

CLR_FN clr_medium_sample clr_sample(clr_u32 sampling, clr_medium s, const clr_medium_ray* ray, const clr_medium_plan* plan,
                                    clr_real u) {
    if (sampling == CLR_UNI) return clr_sample_uniform(s, ray, plan, u);
    if (sampling == CLR_DS || sampling == CLR_DSA) return clr_sample_distance(sampling, s, ray, plan, u);
    if (sampling == CLR_DSM) return clr_sample_distance_mis(s, ray, plan, u);
    if (sampling == CLR_WVDS_MEAN) return clr_sample_wvds(s.sigma_mean, s, ray, plan, u);
    if (sampling == CLR_WVDS_MIN) return clr_sample_wvds(clr_least_sigma(s), s, ray, plan, u);
    return clr_sample_wvds_mis(s, ray, plan, u);
}

// Shadows, in coordinates that are linear along the ray: places across the light and along it for spheres, and for boxes
// g_k = p_k / omega_k and their differences, in which the shadow of a box is a product of intervals.
#define CLR_SPHERE_COORDINATES 3
#define CLR_BOX_COORDINATES 6
#define CLR_SHADOW_LIST (2u * CLR_MOST_OCCLUDERS)

typedef struct {
    clr_real base[9], rate[9];
    clr_u32 spheres, boxes;  // how many of them can shade the ray
    clr_u32* list;  // where they stand; boxes from CLR_MOST_OCCLUDERS on. Memory of the caller: CLR_SHADOW_LIST long
} clr_shadows;

typedef struct {
    clr_real c[6];
} clr_light_place;

CLR_FN clr_light_place clr_sphere_place(const clr_shadows* shadows, clr_real x) {
    clr_light_place p;
    CLR_UNROLL
    for (int k = 0; k < CLR_SPHERE_COORDINATES; ++k) p.c[k] = clr_fma(shadows->rate[k], x, shadows->base[k]);
    return p;
}

CLR_FN clr_light_place clr_box_place(const clr_shadows* shadows, clr_real x) {
    clr_light_place p;
    CLR_UNROLL
    for (int k = 0; k < CLR_BOX_COORDINATES; ++k) p.c[k] = clr_fma(shadows->rate[3 + k], x, shadows->base[3 + k]);
    return p;
}

// Toward the light from a place d = p - centre: across it, and along it where positive. Shaded where <= radius^2: behind the
// sphere as seen from the light that is a cylinder, in front of it the ball itself.
CLR_FN clr_real clr_sphere_distance(clr_real across1, clr_real across2, clr_real along) {
    const clr_real ahead = clr_most(along, (clr_real)(0.0f));
    return clr_fma(across1, across1, clr_fma(across2, across2, ahead * ahead));
}

// Box: floats 6 to 17 are the least and the most of each difference of coordinates, the most of each coordinate (beyond it
// the box lies behind), and the least of each where the light does not travel along it. Signs of differences: comparisons
// would be packed, and unpacked, on the way to one mask.
CLR_FN clr_mask clr_in_box_shadow(clr_u32 axial, CLR_GLOBAL const float* box, const clr_light_place* least,
                                  const clr_light_place* most) {
    clr_uint off = (clr_uint)(0u);
    CLR_UNROLL
    for (int k = 0; k < 3; ++k) {
        off = off | clr_bits(most->c[k] - (clr_real)(box[6 + 2 * k])) | clr_bits((clr_real)(box[7 + 2 * k]) - least->c[k]);
        off = off | clr_bits((clr_real)(box[12 + k]) - least->c[3 + k]);
    }
    if (axial)
        for (int k = 0; k < 3; ++k) off = off | clr_bits(most->c[3 + k] - (clr_real)(box[15 + k]));
    return (off >> 31) == (clr_uint)(0u);
}

// The distance from c to the interval of two ends.
CLR_FN clr_real clr_gap(clr_real a, clr_real b, float c) {
    const clr_real below = clr_least(a, b) - (clr_real)(c), above = clr_most(a, b) - (clr_real)(c);
    const clr_real zero = (clr_real)(0.0f);
    return below > zero ? below : above < zero ? above : zero;
}

CLR_FN clr_light_place clr_least_place(const clr_light_place* a, const clr_light_place* b) {
    clr_light_place p;
    for (int k = 0; k < CLR_BOX_COORDINATES; ++k) p.c[k] = clr_least(a->c[k], b->c[k]);
    return p;
}

CLR_FN clr_light_place clr_most_place(const clr_light_place* a, const clr_light_place* b) {
    clr_light_place p;
    for (int k = 0; k < CLR_BOX_COORDINATES; ++k) p.c[k] = clr_most(a->c[k], b->c[k]);
    return p;
}

CLR_FN void clr_light_coordinates(clr_medium s, const clr_medium_ray* ray, clr_shadows* shadows) {
    clr_real g[3], r[3];
    for (int k = 0; k < 3; ++k) {
        const float* axis = k < 2 ? s.across[k] : s.omega;
        shadows->base[k] = clr_dot_scalar(axis, ray->origin);
        shadows->rate[k] = clr_dot_scalar(axis, ray->direction);
        g[k] = ray->origin[k] * (clr_real)(s.skew[k]);
        r[k] = ray->direction[k] * (clr_real)(s.skew[k]);
        shadows->base[6 + k] = g[k];
        shadows->rate[6 + k] = r[k];
    }
    shadows->base[3] = g[0] - g[1];
    shadows->rate[3] = r[0] - r[1];
    shadows->base[4] = g[0] - g[2];
    shadows->rate[4] = r[0] - r[2];
    shadows->base[5] = g[1] - g[2];
    shadows->rate[5] = r[1] - r[2];
}

// Which occluders can shade some lane's ray. Coordinates are monotone along the ray, rounding included, and so are the
// tests: leaving out the others changes no bit.
CLR_FN void clr_find_shadows(clr_medium s, CLR_GLOBAL const float* occluders, const clr_medium_ray* ray,
                             clr_shadows* shadows) {
    const clr_mask hit = ray->length > (clr_real)(0.0f);
    clr_light_coordinates(s, ray, shadows);
    shadows->spheres = 0;
    shadows->boxes = 0;
    const clr_light_place a = clr_sphere_place(shadows, (clr_real)(0.0f)), b = clr_sphere_place(shadows, ray->length);
    for (clr_u32 i = 0; i < s.spheres; ++i) {
        CLR_GLOBAL const float* sphere = occluders + i * CLR_SPHERE_FLOATS;
        const clr_real nearest = clr_sphere_distance(clr_gap(a.c[0], b.c[0], sphere[4]), clr_gap(a.c[1], b.c[1], sphere[5]),
                                                     clr_least(a.c[2], b.c[2]) - (clr_real)(sphere[6]));
        const clr_mask shaded = hit & (nearest <= (clr_real)(sphere[3]));
        if (clr_any(shaded)) shadows->list[shadows->spheres++] = i * CLR_SPHERE_FLOATS;
    }
    const clr_light_place c = clr_box_place(shadows, (clr_real)(0.0f)), d = clr_box_place(shadows, ray->length);
    const clr_light_place least = clr_least_place(&c, &d), most = clr_most_place(&c, &d);
    for (clr_u32 i = 0; i < s.boxes; ++i) {
        const clr_u32 at = s.spheres * CLR_SPHERE_FLOATS + i * CLR_BOX_FLOATS;
        const clr_mask shaded = hit & clr_in_box_shadow(s.axial, occluders + at, &least, &most);
        if (clr_any(shaded)) shadows->list[CLR_MOST_OCCLUDERS + shadows->boxes++] = at;
    }
}

// 1 where the light reaches the place x on the ray, else 0. A number, not a mask: PoCL keeps masks in whole vectors.
CLR_FN clr_real clr_lit(clr_medium s, CLR_GLOBAL const float* occluders, const clr_shadows* shadows, clr_real x) {
    const clr_real zero = (clr_real)(0.0f);
    clr_real lit = (clr_real)(1.0f);
    if (shadows->spheres) {
        const clr_light_place p = clr_sphere_place(shadows, x);
        for (clr_u32 i = 0; i < shadows->spheres; ++i) {
            CLR_GLOBAL const float* sphere = occluders + shadows->list[i];
            const clr_real distance = clr_sphere_distance(p.c[0] - (clr_real)(sphere[4]), p.c[1] - (clr_real)(sphere[5]),
                                                          p.c[2] - (clr_real)(sphere[6]));
            lit = distance <= (clr_real)(sphere[3]) ? zero : lit;
        }
    }
    if (shadows->boxes) {
        const clr_light_place p = clr_box_place(shadows, x);
        for (clr_u32 i = 0; i < shadows->boxes; ++i)
            lit = clr_in_box_shadow(s.axial, occluders + shadows->list[CLR_MOST_OCCLUDERS + i], &p, &p) ? zero : lit;
    }
    return lit;
}

// Sums of samples, in radiance.
typedef struct {
    clr_real m[3], t[3];
} clr_medium_sums;

CLR_FN clr_medium_sums clr_no_samples(void) {
    clr_medium_sums sums;
    for (int c = 0; c < 3; ++c) {
        sums.m[c] = (clr_real)(0.0f);
        sums.t[c] = (clr_real)(0.0f);
    }
    return sums;
}

CLR_FN clr_medium_sums clr_add_sums(clr_medium_sums a, clr_medium_sums b) {
    for (int c = 0; c < 3; ++c) {
        a.m[c] = a.m[c] + b.m[c];
        a.t[c] = a.t[c] + b.t[c];
    }
    return a;
}

// The words of samples 4 quad .. 4 quad + 3 of pixels pixel, pixel + 1, ..
CLR_FN clr_words clr_quad(clr_u32 generator, clr_stream stream, clr_u32 pixel, clr_u32 quad) {
    return clr_draw(generator, stream, (clr_u64)quad << 32 | pixel);
}

// u below 1: (i + u) / n can round up to 1.
CLR_FN clr_real clr_sample_u(clr_sampler sampler, clr_u32 i, clr_uint word, clr_real first) {
    const clr_real u = clr_uniform(word);
    if (sampler.pattern == CLR_IID) return u;
    const clr_real within = sampler.pattern == CLR_OFFSET ? first : u;
    const clr_real spread = ((clr_real)((float)i) + within) * (clr_real)(sampler.inverse_samples);
    return clr_least(spread, (clr_real)(0.99999994f));
}

#define CLR_SUM_CHUNK 256u  // samples summed apart from the others, so that sums of many keep their digits

// Samples from .. to - 1 of pixels pixel, pixel + 1, ..; from and to lie in one chunk.
CLR_FN clr_medium_sums clr_add_samples(clr_u32 generator, clr_u32 sampling, clr_sampler sampler, clr_medium s,
                                       CLR_GLOBAL const float* occluders, const clr_medium_ray* ray,
                                       const clr_medium_plan* plan, const clr_shadows* shadows, clr_stream stream,
                                       clr_u32 pixel, clr_u32 from, clr_u32 to, clr_medium_sums sums) {
    clr_real first = (clr_real)(0.0f);
    if (sampler.pattern == CLR_OFFSET) first = clr_uniform(clr_quad(generator, stream, pixel, 0).w0);
    for (clr_u32 quad = from / 4; quad * 4 < to; ++quad) {
        clr_words w = clr_quad(generator, stream, pixel, quad);
        const clr_u32 begin = quad * 4 < from ? from : quad * 4, end = quad * 4 + 4 < to ? quad * 4 + 4 : to;
        for (clr_u32 skip = quad * 4; skip < begin; ++skip) {
            w.w0 = w.w1;
            w.w1 = w.w2;
            w.w2 = w.w3;
        }
        for (clr_u32 i = begin; i < end; ++i) {
            const clr_medium_sample one = clr_sample(sampling, s, ray, plan, clr_sample_u(sampler, i, w.w0, first));
            const clr_real lit = clr_lit(s, occluders, shadows, one.x);
            CLR_UNROLL
            for (int c = 0; c < 3; ++c) {
                sums.t[c] = sums.t[c] + one.t[c];
                sums.m[c] = clr_fma(one.t[c], lit, sums.m[c]);
            }
            w.w0 = w.w1;
            w.w1 = w.w2;
            w.w2 = w.w3;
        }
    }
    return sums;
}

// The order of sampling and adding. levels = 0: sampler.samples samples, in chunks summed apart. Else the sums of 1, 2, 4,
// .. samples, one level to a step: of one stream where the pattern is iid, each of its own where it is not.
typedef struct {
    clr_u32 from, to;
    clr_sampler sampler;
    clr_u32 fresh, apart;  // begin at 0; add the sums so far to those of this step
} clr_step;

CLR_FN clr_u32 clr_step_count(clr_sampler sampler, clr_u32 levels) {
    return levels ? levels : (sampler.samples + CLR_SUM_CHUNK - 1) / CLR_SUM_CHUNK;
}

CLR_FN clr_step clr_step_of(clr_sampler sampler, clr_u32 levels, clr_u32 k) {
    clr_step step;
    step.sampler = sampler;
    step.apart = !levels;
    step.fresh = !levels || sampler.pattern != CLR_IID;
    step.from = levels ? 0 : k * CLR_SUM_CHUNK;
    step.to = sampler.samples - step.from < CLR_SUM_CHUNK ? sampler.samples : step.from + CLR_SUM_CHUNK;
    if (levels) {
        step.to = 1u << k;
        step.from = !step.fresh && k > 0 ? step.to / 2 : 0;
        step.sampler.samples = step.to;
        step.sampler.inverse_samples = 1.0f / (float)step.to;
    }
    return step;
}

CLR_FN clr_medium_sums clr_do_step(clr_step step, clr_u32 generator, clr_u32 sampling, clr_medium s,
                                   CLR_GLOBAL const float* occluders, const clr_medium_ray* ray, const clr_medium_plan* plan,
                                   const clr_shadows* shadows, clr_stream stream, clr_u32 pixel, clr_medium_sums sums) {
    const clr_medium_sums start = step.fresh ? clr_no_samples() : sums;
    const clr_medium_sums part = clr_add_samples(generator, sampling, step.sampler, s, occluders, ray, plan, shadows, stream,
                                                 pixel, step.from, step.to, start);
    return step.apart ? clr_add_sums(sums, part) : part;
}

// Estimates of a value from sums, and their errors. share: mu / tau.
typedef struct {
    clr_real plain, ratio;
    clr_mask zero;  // no denominator
} clr_medium_errors;

CLR_FN clr_medium_errors clr_errors_of(clr_real m, clr_real t, float inverse_samples, clr_real tau, clr_real share) {
    const clr_real zero = (clr_real)(0.0f), reference = tau * share;
    clr_medium_errors e;
    e.zero = t == zero;
    e.plain = m * (clr_real)(inverse_samples)-reference;
    e.ratio = tau * (e.zero ? zero : m / (e.zero ? (clr_real)(1.0f) : t)) - reference;
    return e;
}

// An error as an integer multiple of a unit, at most 2^29 of them; 0 for NaN.
CLR_FN clr_int clr_error_units(clr_real e, float inverse_unit) {
    const clr_real most = (clr_real)(536870912.0f);
    const clr_real x = e == e ? e * (clr_real)(inverse_unit) : (clr_real)(0.0f);
    return clr_to_int(clr_floor(clr_clamp(x, -most, most) + (clr_real)(0.5f)));
}

#define CLR_ATOM 1e-6f  // errors up to this are counted apart

CLR_NAMESPACE_END

#endif
