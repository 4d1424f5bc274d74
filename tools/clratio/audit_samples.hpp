// Error samples beside the laws: distances that have a proven bound, shares, and the masses of densities.
#pragma once

#include <span>
#include <vector>

#include "audit.hpp"
#include "clratio/histogram.hpp"
#include "clratio/law.hpp"

namespace tool::audit {

/// By sampling alone the distribution function of n samples is nowhere further from its law: 5e-7 by chance (Massart 1990).
double farthest(std::uint64_t n);

/// Samples of a model's error drawn from seed 1, counted in 1024 bins over 12 deviations to each side, and laws beside them.
class Counts {
public:
    static constexpr std::uint32_t bins = 1024;

    Counts(const Work& work, const clratio::ErrorModel& model, std::uint32_t stream_id);

    /// The largest distance at a bin's edge between the samples' distribution function and a law's.
    double distance(clratio::Law law) const;
    /// The same between two laws.
    double distance(clratio::Law one, clratio::Law other) const;
    double window() const { return window_; }

private:
    std::vector<double> cumulated(clratio::Law law) const;

    clratio::ErrorModel model_;
    double window_;
    clratio::Histogram counts_;
};

/// The share of samples in [lo, hi).
Average share_between(const Work& work, const clratio::ErrorModel& model, std::uint32_t stream_id, double lo, double hi);

/// The integral of a law's density from -window to window, both far beyond the body: 1e-9 relative.
double mass(const clratio::ErrorLaw& law, double window);

}  // namespace tool::audit
