#include "audit_samples.hpp"

#include <algorithm>
#include <numeric>

#include "quadrature.hpp"

namespace tool::audit {

using clratio::ErrorLaw;
using clratio::ErrorModel;
using clratio::Law;

double farthest(std::uint64_t n) { return std::sqrt(std::log(2 / 5e-7) / 2 / static_cast<double>(n)); }

Counts::Counts(const Work& work, const ErrorModel& model, std::uint32_t stream_id)
    : model_(model), window_(12 * ErrorLaw(Law::exact, model).scale()),
      counts_(clratio::error_histogram(work.engine, clratio::canonical(model), {1, stream_id}, {0, work.samples},
                                       {-window_, window_, bins})) {}

std::vector<double> Counts::cumulated(Law law) const {
    auto cells = ErrorLaw(law, model_).bin_probabilities(-window_, window_, bins);
    std::partial_sum(cells.begin(), cells.end(), cells.begin());
    return cells;
}

double Counts::distance(Law law) const {
    const auto below = cumulated(law);
    const auto total = static_cast<double>(counts_.total());
    double seen = static_cast<double>(counts_.underflow), worst = std::abs(seen / total - below[0]);
    for (std::uint32_t i = 0; i < bins; ++i) {
        seen += static_cast<double>(counts_.bins[i]);
        worst = std::max(worst, std::abs(seen / total - below[i + 1]));
    }
    return worst;
}

double Counts::distance(Law one, Law other) const {
    const auto a = cumulated(one), b = cumulated(other);
    double worst = 0;
    for (std::size_t i = 0; i < a.size(); ++i) worst = std::max(worst, std::abs(a[i] - b[i]));
    return worst;
}

Average share_between(const Work& work, const ErrorModel& model, std::uint32_t stream_id, double lo, double hi) {
    const auto counts =
        clratio::error_histogram(work.engine, clratio::canonical(model), {1, stream_id}, {0, work.samples}, {lo, hi, 1});
    const double n = static_cast<double>(work.samples), p = static_cast<double>(counts.bins[0]) / n;
    return {p, std::sqrt(p * (1 - p) / n)};
}

double mass(const ErrorLaw& law, double window) {
    const double far = std::asinh(window / law.scale());
    const auto stretched = [&](double y) { return law.pdf(law.scale() * std::sinh(y)) * law.scale() * std::cosh(y); };
    return simpson(stretched, -far, far, 8000);
}

}  // namespace tool::audit
