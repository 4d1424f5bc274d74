// The state that clratio combine keeps on disk: which batches it holds, and when it is saved.
#pragma once

#include <chrono>

#include "clratio/state.hpp"
#include "combine_input.hpp"
#include "file_lock.hpp"

namespace tool::combining {

/// Follows the batches of a run and keeps them in --state; without that option it only follows them.
class StateKeeper {
public:
    /// Reads the state to go on with, if there is one, and keeps other processes off it while batches are added. UsageError
    /// where options contradict it, IoError.
    explicit StateKeeper(const Options& options);

    /// The sums to go on with, once: they are given away. Nothing where a state is begun.
    std::optional<clratio::Snapshot> take_sums();
    /// Of the first batch by index, values left out: channels are empty before there is one.
    const clratio::Image& shape() const { return state_.shape; }
    const clratio::BatchRanges& ranges() const { return state_.ranges; }

    /// IoError, InvalidArgument where the pair is none for these sums. The first pair gives a new state its shape.
    void fit(const Pair& pair);
    void added(const Pair& pair);

    bool due() const;  ///< the last save, or the start, is --checkpoint seconds ago
    /// What was added since the last time, if anything.
    void save(const Bands& bands);

private:
    const Options& options_;
    std::optional<FileLock> lock_;
    clratio::StateFile state_;
    bool changed_ = false;
    std::chrono::steady_clock::time_point saved_ = std::chrono::steady_clock::now();
};

}  // namespace tool::combining
