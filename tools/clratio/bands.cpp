#include "bands.hpp"

#include <algorithm>

namespace tool {
namespace {

using clratio::Combined, clratio::CombineOptions, clratio::FixedMoments, clratio::HostBatch, clratio::Moments, clratio::Tau;

constexpr std::uint64_t values_in_a_band = 1 << 19;  // of 2^16 .. 2^20 the fastest

Tau slice(const Tau& tau, std::uint64_t begin, std::uint64_t size) {
    return tau.numbers.empty() ? Tau(tau.image.subspan(begin, size)) : tau;
}

void reserve(Combined& to, const Combined& band, std::uint64_t values) {
    const auto like = [values](auto& all, const auto& part) {
        if (!part.empty()) all.reserve(values);
    };
    like(to.estimate, band.estimate);
    like(to.standard_error, band.standard_error);
    like(to.bias, band.bias);
    like(to.lower, band.lower);
    like(to.upper, band.upper);
    like(to.kind, band.kind);
    like(to.gain, band.gain);
    like(to.needed, band.needed);
    like(to.flag_image, band.flag_image);
}

template <class T> void append(std::vector<T>& to, const std::vector<T>& more) {
    to.insert(to.end(), more.begin(), more.end());
}

void append(Combined& to, const Combined& more) {
    append(to.estimate, more.estimate);
    append(to.standard_error, more.standard_error);
    append(to.bias, more.bias);
    append(to.lower, more.lower);
    append(to.upper, more.upper);
    append(to.kind, more.kind);
    append(to.gain, more.gain);
    append(to.needed, more.needed);
    append(to.flag_image, more.flag_image);
    to.flags += more.flags;
}

CombineOptions plain_mean(const CombineOptions& options) {
    return {.estimator = clratio::Estimator::mean, .zero = options.zero, .flag_image = false};
}

/// The state itself, or what is made of it.
const Moments& moments_of(const Bands::State& state, std::optional<Moments>& made) {
    const auto* moments = std::get_if<Moments>(&state);
    return moments ? *moments : made.emplace(std::get<FixedMoments>(state).moments());
}

}  // namespace

Sums sums_of(const clratio::Snapshot& snapshot) {
    if (snapshot.kind != "fixed") return {clratio::moments_options(snapshot), {}};
    const auto fixed = clratio::fixed_options(snapshot);
    return {{.nonfinite = fixed.nonfinite}, fixed};
}

Bands::Bands(const clratio::Engine& engine, std::uint64_t values, std::uint64_t channels, const Sums& sums)
    : engine_(engine), values_(values), band_(std::max(values_in_a_band / channels, std::uint64_t{1}) * channels),
      sums_(sums) {}

Bands::Bands(const clratio::Engine& engine, const clratio::Snapshot& sums, std::uint64_t channels)
    : Bands(engine, sums.values, channels, sums_of(sums)) {
    for (std::uint64_t band = 0; band < bands(); ++band) {
        auto part = clratio::slice(sums, begin(band), size(band));
        if (band == 0) {
            part.negatives = sums.negatives;
            part.skipped = sums.skipped;
        }
        if (sums_.fixed)
            states_.emplace_back(FixedMoments(engine_, part));
        else
            states_.emplace_back(Moments(engine_, part));
    }
}

Bands::State Bands::make(std::uint64_t band) const {
    if (sums_.fixed) return FixedMoments(engine_, size(band), *sums_.fixed);
    return Moments(engine_, size(band), sums_.moments);
}

clratio::Snapshot Bands::snapshot() const {
    const auto taken = [](const State& state) { return std::visit([](const auto& s) { return s.snapshot(); }, state); };
    clratio::Snapshot all = taken(states_.front());
    for (auto& plane : all.planes) plane.words.reserve(values_);
    for (std::uint64_t band = 1; band < bands(); ++band) clratio::append(all, taken(states_[band]));
    return all;
}

std::uint64_t Bands::whole_weight() const {
    const auto* fixed = states_.empty() ? nullptr : std::get_if<FixedMoments>(&states_.front());
    return fixed ? fixed->weight() : 0;
}

std::uint64_t Bands::outside() const {
    std::uint64_t sum = 0;
    for (const State& state : states_)
        if (const auto* fixed = std::get_if<FixedMoments>(&state)) sum += fixed->outside();
    return sum;
}

std::vector<HostBatch> Bands::slices(std::uint64_t band, std::span<const HostBatch> batches) const {
    std::vector<HostBatch> out;
    for (const auto& b : batches)
        out.push_back({b.m.subspan(begin(band), size(band)), b.t.subspan(begin(band), size(band)), b.weight, b.index});
    return out;
}

void Bands::add(std::span<const HostBatch> batches) {
    for (std::uint64_t band = 0; band < bands(); ++band) {
        if (band == states_.size()) states_.push_back(make(band));
        std::visit([&](auto& state) { state.add(slices(band, batches)); }, states_[band]);
    }
}

ReadOut Bands::read_out(const Tau& tau, const Wanted& wanted) const {
    ReadOut out;
    Combined chosen, mean;
    for (std::uint64_t band = 0; band < bands(); ++band) {
        const Tau part = slice(tau, begin(band), size(band));
        std::optional<Moments> made;
        const Moments& state = moments_of(states_[band], made);
        chosen = clratio::combine(state, part, wanted.options, std::move(chosen));
        reserve(out.chosen, chosen, values_);
        append(out.chosen, chosen);
        if (wanted.mean) {
            mean = clratio::combine(state, part, plain_mean(wanted.options), std::move(mean));
            reserve(out.mean, mean, values_);
            append(out.mean, mean);
        }
        out.chosen.negatives += std::visit([](const auto& s) { return s.negatives(); }, states_[band]);
    }
    return out;
}

ReadOut read_at_once(const clratio::Engine& engine, std::span<const HostBatch> batches, const Tau& tau, const Wanted& wanted,
                     const clratio::BatchOptions& how, std::vector<float> place) {
    ReadOut out;
    if (wanted.mean) out.mean = clratio::combine_batches(engine, batches, tau, plain_mean(wanted.options), how);
    out.chosen.estimate = std::move(place);
    out.chosen = clratio::combine_batches(engine, batches, tau, wanted.options, how, std::move(out.chosen));
    return out;
}

}  // namespace tool
