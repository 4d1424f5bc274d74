// Densities and probabilities of the error's law: `points` values of x for each of a batch of models.
#include "clratio/device/law.h"
#include "clratio/device/layout.h"

CLR_FN clr_law_lanes clr_same_model(clr_law m) {
    clr_law_lanes r;
    r.s = (clr_real)(m.s);
    r.a = (clr_real)(m.a);
    r.b = (clr_real)(m.b);
    r.inverse_sd = (clr_real)(m.inverse_sd);
    r.half_turn = (clr_real)(m.half_turn);
    return r;
}

// The models of values first .. first + CLR_WIDTH - 1; lanes past the end repeat the last one.
CLR_FN clr_law_lanes clr_load_models(global const clr_law* models, ulong first, ulong count, ulong points) {
    const ulong begin = first / points;
    if (begin == (first + CLR_WIDTH - 1) / points) return clr_same_model(models[begin]);
    float s[CLR_WIDTH], a[CLR_WIDTH], b[CLR_WIDTH], inverse_sd[CLR_WIDTH], half_turn[CLR_WIDTH];
    for (int i = 0; i < CLR_WIDTH; ++i) {
        const clr_law m = models[min(first + i, count - 1) / points];
        s[i] = m.s;
        a[i] = m.a;
        b[i] = m.b;
        inverse_sd[i] = m.inverse_sd;
        half_turn[i] = m.half_turn;
    }
    clr_law_lanes r;
    r.s = clr_load(s);
    r.a = clr_load(a);
    r.b = clr_load(b);
    r.inverse_sd = clr_load(inverse_sd);
    r.half_turn = clr_load(half_turn);
    return r;
}

CLR_FN clr_real clr_load_points(global const float* x, clr_law_task task, ulong first, ulong count) {
    if (!task.shared_x) return clr_load_view(x, task.x, first, count);
    const ulong begin = first - first / task.points * task.points;
    if (begin + CLR_WIDTH <= task.points) return clr_load_view(x, task.x, begin, task.points);
    float lane[CLR_WIDTH];
    for (int i = 0; i < CLR_WIDTH; ++i) {
        const ulong value = first + i - (first + i) / task.points * task.points;
        const ulong pixel = value / task.x.channels;
        lane[i] = x[task.x.offset + pixel * task.x.stride + (value - pixel * task.x.channels)];
    }
    return clr_load(lane);
}

#define CLR_LAW_KERNEL(word, formula)                                                                                       \
    kernel void word(global const clr_law* models, global const float* x, global float* out, clr_law_task task,             \
                     clr_range range) {                                                                                     \
        const clr_span span = clr_my_span(range);                                                                           \
        for (ulong v = span.begin; v < span.end; v += span.step) {                                                          \
            const ulong first = v * CLR_WIDTH;                                                                              \
            const clr_law_lanes m = clr_load_models(models, first, range.count, task.points);                               \
            const clr_real y = formula(m, clr_load_points(x, task, first, range.count));                                    \
            clr_store_view(y, out, task.out, first, range.count);                                                           \
        }                                                                                                                   \
    }

CLR_LAW_KERNEL(clr_each_law_pdf, clr_law_pdf)
CLR_LAW_KERNEL(clr_each_law_log_pdf, clr_law_log_pdf)
CLR_LAW_KERNEL(clr_each_law_cdf, clr_law_cdf)
CLR_LAW_KERNEL(clr_each_law_sf, clr_law_sf)
CLR_LAW_KERNEL(clr_each_law_published_pdf, clr_law_published_pdf)
CLR_LAW_KERNEL(clr_each_law_published_log_pdf, clr_law_published_log_pdf)
