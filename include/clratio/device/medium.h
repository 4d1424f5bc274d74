// Single scattering of collimated light in a box of fog: sums of samples, and the errors of what they estimate.
// medium_ray.h sets up a ray, medium_sample.h draws on it, medium_shadow.h says where the light reaches it.
#ifndef CLRATIO_DEVICE_MEDIUM_H
#define CLRATIO_DEVICE_MEDIUM_H

#include "clratio/device/histogram.h"
#include "clratio/device/medium_sample.h"
#include "clratio/device/medium_shadow.h"
#include "clratio/device/stream.h"

CLR_NAMESPACE_BEGIN

// A row of counters of errors: the bins and what lies outside, then these.
#define CLR_ATOM_SLOT (CLR_OUTER_SLOTS + 0u)
#define CLR_ZERO_SLOT (CLR_OUTER_SLOTS + 1u)
#define CLR_UNUSED_SLOT (CLR_OUTER_SLOTS + 2u)  // of lanes without a value
#define CLR_ERROR_SLOTS (CLR_OUTER_SLOTS + 3u)
#define CLR_LEVEL_VALUES 6u  // plain and ratio, three channels each

typedef struct {
    clr_bins bins;
    float inverse_unit;
    clr_u32 levels;
} clr_tally;

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
