// What clratio combine has to say at the end.
#pragma once

#include <array>
#include <optional>

#include "combine_options.hpp"
#include "difference.hpp"

namespace tool::combining {

struct Seconds {
    double decode = 0, device = 0, encode = 0;
};

struct Scores {
    Difference estimate, mean;
};

struct Intervals {
    std::array<std::uint64_t, 3> kinds{};       ///< bounded, exclusive, whole line
    std::uint64_t points = 0;                   ///< without width: the batches agree exactly
    std::optional<double> coverage;             ///< share of the reference's values that lie in theirs
    std::optional<double> coverage_with_width;  ///< the same among intervals that are no points
};

struct Report {
    std::string device;
    clratio::Image shape;  ///< of the first batch, without its values
    std::uint64_t batches = 0, negatives = 0;
    std::optional<std::uint64_t> outside;  ///< the range of --fixed, where sums are that
    std::uint64_t held = 0;                ///< of the batches, by the state that the run began with
    std::string ranges, nonfinite;
    clratio::FlagCounts flags;
    Seconds seconds;
    std::optional<Scores> scores;
    std::optional<Intervals> intervals;
};

Json json_of(const Options& options, const Report& report);
void print_text(const Options& options, const Report& report);

}  // namespace tool::combining
