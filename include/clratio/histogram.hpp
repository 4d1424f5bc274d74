// Histograms: of error samples that are drawn and counted in one go, and of values already in memory.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "clratio/device/histogram.h"
#include "clratio/engine.hpp"
#include "clratio/error.hpp"
#include "clratio/stream.hpp"
#include "clratio/view.hpp"

namespace clratio {

/// `count` half-open bins on [lo, hi). Ranges: lo < hi, both and count / (hi - lo) finite as float (as double for double
/// samples), 1 <= count <= 2^23. A value x is in the bin of device::clr_slot.
struct Bins {
    double lo = -1, hi = 1;
    std::uint32_t count = 1024;
    bool operator==(const Bins&) const = default;
};

/// Sample indices first .. first + count - 1.
struct IndexRange {
    std::uint64_t first = 0, count = 0;
    bool operator==(const IndexRange&) const = default;
};

enum class Precision { single_precision, double_precision };

/// Counts always add up to the number of values: what no bin holds is counted apart.
struct Histogram {
    std::vector<std::uint64_t> bins;
    std::uint64_t underflow = 0;  ///< x < lo, -inf too
    std::uint64_t overflow = 0;   ///< x >= hi, +inf too
    std::uint64_t nonfinite = 0;  ///< NaN
    double lo = 0, hi = 0;
    Precision precision = Precision::single_precision;  ///< of the values that were counted

    std::uint64_t total() const;
    /// The count + 1 edges as the counting sees them: the least number of each bin, up to 2^-22 (hi - lo) beside the edges
    /// of bins of equal width; those where bins are so narrow that some hold no number, and in double precision.
    std::vector<double> edges() const;
    /// Errors: InvalidArgument for other bins or another precision.
    Histogram& operator+=(const Histogram& other);
};

/// The histogram of some samples of one law and stream: parts computed anywhere can be added.
struct ErrorHistogram : Histogram {
    Canonical law{};
    Stream stream{};                   ///< the one drawn from, in the domain `error`
    std::vector<IndexRange> ranges{};  ///< the samples in it, in order, neighbours joined

    /// Errors: InvalidArgument for another law, stream, precision or other bins, and where both hold the same sample.
    ErrorHistogram& operator+=(const ErrorHistogram& other);
};

struct HistogramOptions {
    Precision precision = Precision::single_precision;
    Progress progress =
        {};  ///< called between launches with samples done and to do; Cancelled is thrown where it returns false
};

/// Histograms of the samples `range` of each law, as error_samples() gives them; law j draws from stream id stream.id + j.
/// Blocking. Any 64-bit count: the library splits it into launches of at most 2^28 samples. Memory: 4 bytes for each counter
/// of at most 16 MiB of partial rows, 8 bytes for each counter of the result; it does not grow with the number of samples.
/// NaN and infinities: see Histogram. Errors: InvalidArgument, before anything is enqueued, for a law, bins, stream, an
/// empty range, one that ends after 2^60, stream ids beyond 2^32, results that no allocation holds. Determinism: the same
/// counts at every width, path, work size and split into ranges. Source: supplement eq. (14); bins: docs/streams.md.
ErrorHistogram error_histogram(const Engine& engine, const Canonical& law, const Stream& stream, IndexRange range, Bins bins,
                               const HistogramOptions& options = {});
std::vector<ErrorHistogram> error_histograms(const Engine& engine, std::span<const Canonical> laws, const Stream& stream,
                                             IndexRange range, Bins bins, const HistogramOptions& options = {});

/// The same, added to the caller's counters: a row of bins.count + 3 for each law, the bins, then underflow, overflow,
/// nonfinite. After an exception the counters hold a part of the samples.
void add_error_counts(const Engine& engine, std::span<const Canonical> laws, const Stream& stream, IndexRange range,
                      Bins bins, std::span<std::uint64_t> rows, const HistogramOptions& options = {});

/// The histogram of values. Blocking; the device form starts after wait_list. Errors: InvalidArgument for bins or a view.
Histogram histogram(const Engine& engine, std::span<const float> values, Bins bins);
Histogram histogram(const Engine& engine, View values, Bins bins, std::span<const cl_event> wait_list = {});

}  // namespace clratio
