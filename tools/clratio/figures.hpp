// The supplement's Figures 1 and 2 as data.
#pragma once

#include <vector>

#include "error_counts.hpp"
#include "plot.hpp"

namespace tool {

using Figure = std::vector<ErrorCounts>;  ///< those of mc, then those of the ratio; N = 1, 2, 4, .. 64 of each

/// `count` errors for each histogram, from the stream and the 13 ids behind it.
Figure sampled_figure(const clratio::Engine& engine, const clratio::Stream& stream, std::uint64_t count);

/// Monte Carlo, and the ratio. `samples`: dots beside thin lines (Figure 2), not lines alone (Figure 1).
std::vector<Panel> panels_of(const Figure& figure, bool samples);

}  // namespace tool
