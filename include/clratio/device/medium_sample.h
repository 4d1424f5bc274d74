// Where a sample of a ray lies, and what it is worth without occluders: + - * fma, comparisons and at most one division,
// without branches. What all samples of a ray share is its plan. Source of the formulas: docs/medium.md.
#ifndef CLRATIO_DEVICE_MEDIUM_SAMPLE_H
#define CLRATIO_DEVICE_MEDIUM_SAMPLE_H

#include "clratio/device/medium_ray.h"

CLR_NAMESPACE_BEGIN

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

CLR_NAMESPACE_END

#endif
