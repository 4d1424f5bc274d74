// The moments of an image in bands of values. A band's state stays in the processor's cache between adding and reading
// out, and where all batches are at hand there is never more than one: of 3840x2160 RGB and 2 batches, .4 s instead of 2.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "clratio/combine.hpp"

namespace tool {

struct Wanted {
    clratio::CombineOptions options;
    bool mean = false;  ///< the plain mean too
};

struct ReadOut {
    clratio::Combined chosen, mean;
    std::uint64_t negatives = 0;
};

class Bands {
public:
    Bands(const clratio::Engine& engine, std::uint64_t values, std::uint64_t channels, clratio::MomentsOptions options);

    /// Goes on with the sums of a whole image.
    Bands(const clratio::Engine& engine, const clratio::Snapshot& sums, std::uint64_t channels);

    void add(std::span<const clratio::HostBatch> batches);
    /// Of what was added.
    ReadOut read_out(const clratio::Tau& tau, const Wanted& wanted) const;
    /// What was added, as one state of the whole image.
    clratio::Snapshot snapshot() const;
    /// Of these batches alone, the same bits as adding them; keeps no state.
    ReadOut at_once(std::span<const clratio::HostBatch> batches, const clratio::Tau& tau, const Wanted& wanted) const;

private:
    std::uint64_t bands() const { return (values_ + band_ - 1) / band_; }
    std::uint64_t begin(std::uint64_t band) const { return band * band_; }
    std::uint64_t size(std::uint64_t band) const { return std::min(band_, values_ - begin(band)); }
    clratio::Moments make(std::uint64_t band) const { return {engine_, size(band), options_}; }
    std::vector<clratio::HostBatch> slices(std::uint64_t band, std::span<const clratio::HostBatch> batches) const;
    template <class Read> ReadOut read(Read read_band, const clratio::Tau& tau, const Wanted& wanted) const;

    clratio::Engine engine_;
    std::uint64_t values_, band_;  ///< band_: a multiple of the channels, so that each band starts with the first
    clratio::MomentsOptions options_;
    std::vector<clratio::Moments> states_;
};

}  // namespace tool
