// The host twin of a state: the device's own formulas, one value at a time.
#pragma once

#include <bit>
#include <span>
#include <vector>

#include "clratio/device/estimator.h"

namespace clratio::test {

struct TwinValue {
    device::clr_record record{};
    std::uint32_t offered = 0;

    void add(float m, float t, double w) {
        using namespace device;
        const std::uint32_t index = offered++;
        if (!clr_is_finite(m) || !clr_is_finite(t)) {
            if (clr_settles(index)) record.moments = clr_moments_settle(record.moments);
            return;
        }
        const auto hi = static_cast<float>(w);
        const clr_two added{hi, static_cast<float>(w - static_cast<double>(hi))};
        const clr_two sum = clr_two_add(record.weight, added);
        const clr_entry entry = clr_entry_make(record.weight, added, sum);
        record.moments = clr_moments_add(record.moments, m, t, entry, index);
        record.ratios = clr_ratios_add(record.ratios, m, t, entry);
        record.weight = sum;
        record.weight2 = clr_two_add(record.weight2, clr_two_square(added));
        ++record.batches;
    }

    void merge(const TwinValue& b) {
        record = device::clr_record_merge(record, b.record, true);
        offered += b.offered;
    }
};

/// What a kernel reads out of the groups of a value.
inline device::clr_estimate read_twin(std::span<const TwinValue> groups, float tau, const device::clr_question& ask,
                                      float quantile = 0) {
    using namespace device;
    clr_record all = groups[0].record;
    std::uint32_t offered = groups[0].offered;
    for (const auto& g : groups.subspan(1)) {
        all = clr_record_join(all, g.record, clr_uses_ratios(ask.estimator));
        offered += g.offered;
    }
    all.moments = clr_moments_settle(all.moments);
    const clr_quotient q = clr_divide_means(all.moments.m, all.moments.t, tau, ask.zero_policy);
    clr_folds folds = clr_folds_begin();
    if (clr_uses_groups(ask.estimator))
        for (const auto& g : groups)
            folds = clr_fold(folds, all.moments, q, g.record.moments, clr_part_of(g.record.weight, all.weight), tau,
                             ask.estimator);
    const clr_evidence n = clr_evidence_of(all.batches, all.weight, all.weight2, ask.reliability);
    const clr_residual d = clr_folds_residual(ask.estimator) ? folds.residual : clr_residual_of(all.moments, q.quotient);
    return clr_read_out(all, q, d, n, folds, offered, tau, quantile, ask);
}

inline device::clr_estimate read_twin(const TwinValue& value, float tau, std::uint32_t estimator = CLR_ESTIMATOR_RATIO,
                                      std::uint32_t zero = CLR_ZERO_MC_MEAN) {
    device::clr_question ask{};
    ask.estimator = estimator;
    ask.zero_policy = zero;
    ask.outputs = CLR_WRITE_ESTIMATE | CLR_WRITE_ERROR | CLR_WRITE_FLAGS;
    return read_twin(std::span(&value, 1), tau, ask);
}

inline double value(device::clr_two x) { return static_cast<double>(x.hi) + static_cast<double>(x.lo); }

}  // namespace clratio::test
