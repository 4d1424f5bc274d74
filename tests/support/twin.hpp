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

/// All groups but one, `but` being one of them.
inline device::clr_rest rest_without(std::span<const TwinValue> groups, const TwinValue& but) {
    using namespace device;
    clr_rest rest = clr_rest_none();
    for (const auto& g : groups)
        if (&g != &but) rest = clr_rest_weigh(rest, g.record.moments, g.record.weight.hi);
    rest = clr_rest_center(rest);
    for (const auto& g : groups)
        if (&g != &but) rest = clr_rest_scatter(rest, g.record.moments, g.record.weight.hi);
    return rest;
}

/// What the kernels know of a value's groups together.
inline device::clr_joint join_twin(std::span<const TwinValue> groups, float tau, const device::clr_question& ask) {
    using namespace device;
    clr_record all = groups[0].record;
    for (const auto& g : groups.subspan(1)) {
        all.moments = clr_first_means(all, g.record);
        all.weight = clr_two_add(all.weight, g.record.weight);
        all.weight2 = clr_two_add(all.weight2, g.record.weight2);
        all.batches += g.record.batches;
    }
    const auto n = clr_evidence_of(all.batches, all.weight, all.weight2, ask.reliability);
    if (groups.size() == 1) return clr_joint_of(all, n, tau, ask.zero_policy);

    clr_whole whole = clr_whole_of(all.weight);
    const auto part = [&](const TwinValue& g) { return clr_part_of(g.record.weight, whole); };
    for (const auto& g : groups) whole = clr_count_part(whole, part(g));
    const bool about_first = clr_uses_groups(ask.estimator);
    const auto pool = about_first ? clr_pool_distances : clr_pool_means;
    all.moments = about_first ? clr_pool_begin(all.moments) : clr_moments_none();
    all.ratios = clr_ratios_none();
    for (const auto& g : groups) {
        if (g.record.batches == 0) continue;
        all.moments = clr_pool_within(pool(all.moments, g.record.moments, part(g).p), g.record.moments);
        all.ratios = clr_pool_ratios(all.ratios, g.record.ratios, part(g).p);
    }
    clr_joint j = clr_joint_means(all, whole, tau, ask.zero_policy);
    for (const auto& g : groups) j.folds = clr_fold(j.folds, j.all.moments, j.q, g.record.moments, part(g));
    j.spread = clr_spread_of_groups(j.all.moments, j.q.quotient, j.folds);
    const float slope = clr_slope_of_regression(j.spread.mt, j.spread.tt);
    j.cross = clr_cross_begin(j.folds, j.spread);
    for (const auto& g : groups) {
        j.folds = clr_fold_line(j.folds, j.all.moments, slope, g.record.moments, part(g));
        const clr_rest rest = rest_without(groups, g);
        const auto others = clr_settle_doubt(clr_others_than(j.cross, j.all.moments, g.record.moments, part(g)), rest);
        j.cross = clr_cross_add(j.cross, j.all.moments, others, g.record.moments, part(g));
        j.cross.untold = j.cross.untold || clr_is_untold(others, rest);
    }
    j.spread.line = clr_line_of_groups(j.all.moments, slope, j.folds);
    j.n = n;
    return j;
}

/// What a kernel reads out of the groups of a value.
inline device::clr_estimate read_twin(std::span<const TwinValue> groups, float tau, const device::clr_question& ask,
                                      float quantile = 0) {
    std::uint32_t offered = 0;
    for (const auto& g : groups) offered += g.offered;
    return device::clr_read_out(join_twin(groups, tau, ask), offered, tau, quantile, ask);
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
