// Which occluders can shade a ray, and whether they shade a place on it. Source of the formulas: docs/medium.md.
#ifndef CLRATIO_DEVICE_MEDIUM_SHADOW_H
#define CLRATIO_DEVICE_MEDIUM_SHADOW_H

#include "clratio/device/medium_ray.h"

CLR_NAMESPACE_BEGIN

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

CLR_NAMESPACE_END

#endif
