// Images read out of batches: through moments, in bands of values that fit the device and its caches, or at once.
#pragma once

#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "clratio/combine.hpp"
#include "clratio/fixed.hpp"

namespace tool {

struct Wanted {
    clratio::CombineOptions options;
    bool mean = false;  ///< the plain mean too
};

struct ReadOut {
    clratio::Combined chosen, mean;
};

/// What is kept of the batches. Whole numbers, where `fixed` says so, know neither groups nor ratios nor reliability.
struct Sums {
    clratio::MomentsOptions moments;
    std::optional<clratio::FixedOptions> fixed;
};

/// Of a state that was kept.
Sums sums_of(const clratio::Snapshot& snapshot);

/// Of 1 to 8 batches that are all there are, without moments: the same bits. The estimate takes the memory of `place`, which
/// may be tau's own image.
ReadOut read_at_once(const clratio::Engine& engine, std::span<const clratio::HostBatch> batches, const clratio::Tau& tau,
                     const Wanted& wanted, const clratio::BatchOptions& how, std::vector<float> place = {});

class Bands {
public:
    using State = std::variant<clratio::Moments, clratio::FixedMoments>;

    Bands(const clratio::Engine& engine, std::uint64_t values, std::uint64_t channels, const Sums& sums);

    /// Goes on with the sums of a whole image.
    Bands(const clratio::Engine& engine, const clratio::Snapshot& sums, std::uint64_t channels);

    void add(std::span<const clratio::HostBatch> batches);
    /// Of what was added.
    ReadOut read_out(const clratio::Tau& tau, const Wanted& wanted) const;
    /// Of all batches in sums of whole numbers; 0 in others, which have room for any.
    std::uint64_t whole_weight() const;
    /// Finite values, of batches added since the sums were begun or taken up, that fixed point could not hold.
    std::uint64_t outside() const;
    /// What was added, as one state of the whole image.
    clratio::Snapshot snapshot() const;

private:
    std::uint64_t bands() const { return (values_ + band_ - 1) / band_; }
    std::uint64_t begin(std::uint64_t band) const { return band * band_; }
    std::uint64_t size(std::uint64_t band) const { return std::min(band_, values_ - begin(band)); }
    State make(std::uint64_t band) const;
    std::vector<clratio::HostBatch> slices(std::uint64_t band, std::span<const clratio::HostBatch> batches) const;

    clratio::Engine engine_;
    std::uint64_t values_, band_;  ///< band_: a multiple of the channels, so that each band starts with the first
    Sums sums_;
    std::vector<State> states_;
};

}  // namespace tool
