#include "error_counts.hpp"

#include <fmt/format.h>

#include <chrono>
#include <limits>

#include "edges.hpp"

namespace tool {

using clratio::ErrorLaw;
using clratio::Law;

ErrorLaw ErrorCounts::exact() const { return {estimator == Estimator::mc ? Law::mc : Law::exact, model}; }

ErrorLaw ErrorCounts::published() const { return {estimator == Estimator::mc ? Law::mc : Law::published, model}; }

std::optional<clratio::Fit> ErrorCounts::fit(const ErrorLaw& law) const {
    try {
        return clratio::chi_square(histogram, law);
    } catch (const clratio::InvalidArgument& e) {
        if (e.name != "counts") throw;
        return std::nullopt;  // too few draws for two cells
    }
}

const char* name_of(Estimator estimator) { return estimator == Estimator::mc ? "mc" : "ratio"; }

clratio::Canonical canonical_of(Estimator estimator, const clratio::ErrorModel& model) {
    return estimator == Estimator::mc ? clratio::monte_carlo_canonical(model) : clratio::canonical(model);
}

ErrorCounts count_errors(const clratio::Engine& engine, Estimator estimator, const clratio::ErrorModel& model,
                         const Sampling& sampling, const clratio::Progress& progress) {
    ErrorCounts counts{.estimator = estimator, .model = model, .histogram = {}};
    const auto start = std::chrono::steady_clock::now();
    counts.histogram = clratio::error_histogram(engine, canonical_of(estimator, model), sampling.stream, sampling.range,
                                                sampling.bins, {.progress = progress});
    counts.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return counts;
}

const char* const csv_header = "estimator,n,lo,hi,count,density,exact,published\n";

void write_csv(OutputFile& out, const ErrorCounts& counts) {
    const auto& h = counts.histogram;
    const auto bins = static_cast<std::uint32_t>(h.bins.size());
    const auto exact = counts.exact().bin_densities(h.lo, h.hi, bins);
    const auto published = counts.published().bin_densities(h.lo, h.hi, bins);
    const double width = counts.bin_width(), samples = static_cast<double>(h.total());
    const std::string head = fmt::format("{},{},", name_of(counts.estimator), counts.model.n);
    const auto edges = clratio::equal_edges(h.lo, h.hi, bins);
    out.write(fmt::format("{}-inf,{},{},,,\n", head, h.lo, h.underflow));
    for (std::uint32_t i = 0; i < bins; ++i)
        out.write(fmt::format("{}{},{},{},{},{},{}\n", head, edges[i], edges[i + 1], h.bins[i],
                              static_cast<double>(h.bins[i]) / (samples * width), exact[i], published[i]));
    out.write(fmt::format("{}{},inf,{},,,\n", head, h.hi, h.overflow));
    out.write(fmt::format("{}nan,nan,{},,,\n", head, h.nonfinite));
}

std::vector<Curve::Point> density_points(const ErrorCounts& counts, std::size_t most) {
    const auto& bins = counts.histogram.bins;
    const std::size_t group = (bins.size() + most - 1) / most;
    const double samples = static_cast<double>(counts.histogram.total()), width = counts.bin_width();
    std::vector<Curve::Point> points;
    for (std::size_t first = 0; first < bins.size(); first += group) {
        const std::size_t last = std::min(first + group, bins.size());
        std::uint64_t count = 0;
        for (std::size_t i = first; i < last; ++i) count += bins[i];
        points.push_back({static_cast<double>(count) / (samples * width * static_cast<double>(last - first)),
                          counts.histogram.lo + width * static_cast<double>(first + last) / 2});
    }
    return points;
}

std::vector<Curve::Point> density_curve(const ErrorLaw& law, double lo, double hi) {
    constexpr int steps = 900;
    std::vector<Curve::Point> points;
    for (int i = 0; i <= steps; ++i) {
        const double x = lo + (hi - lo) * i / steps;
        points.push_back({law.pdf(x), x});
    }
    return points;
}

}  // namespace tool
