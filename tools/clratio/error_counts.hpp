// Error samples of one model, counted, beside what the laws say about the same cells.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "clratio/fit.hpp"
#include "clratio/histogram.hpp"
#include "clratio/law.hpp"
#include "output_file.hpp"
#include "plot.hpp"

namespace tool {

enum class Estimator { ratio, mc };

struct Sampling {
    clratio::Stream stream;
    clratio::IndexRange range;
    clratio::Bins bins;
};

struct ErrorCounts {
    Estimator estimator = Estimator::ratio;
    clratio::ErrorModel model;
    clratio::ErrorHistogram histogram;
    double seconds = 0;

    /// The law of the estimator, and the one the supplement prints: eq. (22), or for mc eq. (23), which is the exact one.
    clratio::ErrorLaw exact() const;
    clratio::ErrorLaw published() const;
    /// Chi-square; none where there are too few samples for two cells.
    std::optional<clratio::Fit> fit(const clratio::ErrorLaw& law) const;
    double bin_width() const { return (histogram.hi - histogram.lo) / static_cast<double>(histogram.bins.size()); }
};

const char* name_of(Estimator estimator);

/// The law and model of an estimator, as error_histogram() takes it.
clratio::Canonical canonical_of(Estimator estimator, const clratio::ErrorModel& model);

ErrorCounts count_errors(const clratio::Engine& engine, Estimator estimator, const clratio::ErrorModel& model,
                         const Sampling& sampling, const clratio::Progress& progress);

/// The CSV's columns, and the rows of one histogram: underflow, each bin, overflow, NaN.
extern const char* const csv_header;
void write_csv(OutputFile& out, const ErrorCounts& counts);

/// Density estimates over at most `most` groups of bins, at their centres.
std::vector<Curve::Point> density_points(const ErrorCounts& counts, std::size_t most);
/// A law's density over [lo, hi].
std::vector<Curve::Point> density_curve(const clratio::ErrorLaw& law, double lo, double hi);

}  // namespace tool
