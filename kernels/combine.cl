// Reads estimates out of moments, or straight out of one pair of means.
#include "clratio/device/planes.h"

kernel void clr_combine(global const float* m, clr_layout m_layout, global const float* t, clr_layout t_layout,
                        CLR_READING_ARGUMENTS, clr_range range) {
    clr_flag_tally tally = {{(clr_uint)(0u)}};
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        const clr_real control = clr_load_view(tau, reading.tau, first, range.count);
        const clr_estimate e = clr_read_means(clr_load_view(m, m_layout, first, range.count),
                                              clr_load_view(t, t_layout, first, range.count), control, reading.zero_policy);
        clr_write_reading(e, reading, estimate, error, flags, &tally, first, range.count);
    }
    clr_store_flag_tally(&tally, flag_rows);
}

kernel void clr_combine_moments(CLR_PLANE_ARGUMENTS(s), CLR_READING_ARGUMENTS, clr_range range) {
    const clr_planes planes = CLR_PLANES(s);
    clr_flag_tally tally = {{(clr_uint)(0u)}};
    const clr_span span = clr_my_span(range);
    for (ulong v = span.begin; v < span.end; v += span.step) {
        const ulong first = v * CLR_WIDTH;
        const clr_record r = clr_load_record(planes, s_state, first);
        const clr_real control = clr_load_view(tau, reading.tau, first, range.count);
        const clr_estimate e = clr_read_record(r, s_state.batches, control, reading);
        clr_write_reading(e, reading, estimate, error, flags, &tally, first, range.count);
    }
    clr_store_flag_tally(&tally, flag_rows);
}
