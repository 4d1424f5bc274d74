// The host twin of a state: the device's own formulas, one value at a time.
#pragma once

#include <bit>
#include <vector>

#include "clratio/device/ratio.h"

namespace clratio::test {

struct TwinValue {
    device::clr_moments moments{};
    device::clr_ratios ratios{};
    device::clr_two weight{};
    std::uint32_t batches = 0, offered = 0;

    void add(float m, float t, double w) {
        using namespace device;
        const std::uint32_t index = offered++;
        if (!clr_is_finite(m) || !clr_is_finite(t)) {
            if (clr_settles(index)) moments = clr_moments_settle(moments);
            return;
        }
        const auto hi = static_cast<float>(w);
        const clr_two added{hi, static_cast<float>(w - static_cast<double>(hi))};
        const clr_two sum = clr_two_add(weight, added);
        const clr_entry entry = clr_entry_make(weight, added, sum);
        moments = clr_moments_add(moments, m, t, entry, index);
        ratios = clr_ratios_add(ratios, m, t, entry);
        weight = sum;
        ++batches;
    }

    void merge(const TwinValue& b) {
        using namespace device;
        const clr_two sum = clr_two_add(weight, b.weight);
        const clr_entry entry = clr_entry_make(weight, b.weight, sum);
        moments = clr_moments_merge(moments, b.moments, entry);
        ratios = clr_ratios_merge(ratios, b.ratios, entry);
        weight = sum;
        batches += b.batches;
        offered += b.offered;
    }

    device::clr_estimate read(float tau, std::uint32_t added, std::uint32_t estimator = CLR_ESTIMATOR_RATIO,
                              std::uint32_t zero = CLR_ZERO_MC_MEAN) const {
        return device::clr_read_out(moments, ratios, {batches, weight.hi}, added, tau, estimator, zero, true);
    }
};

inline double value(device::clr_two x) { return static_cast<double>(x.hi) + static_cast<double>(x.lo); }

}  // namespace clratio::test
