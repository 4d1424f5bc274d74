// clratio::io: a state on disk, which batches it holds, and the merging of such files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "clratio/image.hpp"
#include "clratio/snapshot.hpp"

namespace clratio {

/// A set of batch indices as half-open intervals: sorted, joined where they touch.
class BatchRanges {
public:
    struct Range {
        std::uint64_t begin = 0, end = 0;
        bool operator==(const Range&) const = default;
    };

    /// Errors: InvalidArgument where the range is empty or some of it is there already.
    void add(Range range);
    bool contains(std::uint64_t index) const;
    std::uint64_t count() const;
    std::uint64_t count(std::uint64_t group, std::uint64_t groups) const;  ///< of the indices k with k mod groups = group
    std::optional<Range> overlap(const BatchRanges& other) const;          ///< the first stretch that both hold
    std::optional<std::uint64_t> first_beyond(const BatchRanges& other) const;  ///< the first index that the other lacks
    const std::vector<Range>& ranges() const { return ranges_; }
    bool empty() const { return ranges_.empty(); }

    std::string text() const;  ///< "[0,4) [8,12)"
    /// Errors: InvalidArgument unless it is what text() gives.
    static BatchRanges parse(const std::string& text);

    bool operator==(const BatchRanges&) const = default;

private:
    std::vector<Range> ranges_;
};

/// What a state file holds. docs/state.md describes its channels and attributes.
struct StateFile {
    Snapshot sums;
    Image shape;                                                ///< channels, windows, alpha, metadata; no values
    std::vector<std::pair<std::string, std::string>> settings;  ///< beyond those of the sums: "layer.m", ...
    BatchRanges ranges;                                         ///< whose count is sums.batches(), in each group too
};

/// Writes a float EXR, with UINT channels for what is not float, in the way of write_image: beside its place, synced, read
/// back and compared, renamed. Until the rename the old file stands there whole. The same state gives the same bytes.
/// Cost: the bytes of the state (52 a value with NonFinite::skip), written and read once; little memory beside it.
/// Errors: InvalidArgument where shape, ranges and sums do not fit together, IoError.
void write_state(const std::filesystem::path& path, const StateFile& state);

/// Reads and checks everything: version, attributes, channels, ranges against batch counts, and a checksum over the header
/// and every word. A damaged file is never read as another state. Errors: IoError that names what is wrong.
StateFile read_state(const std::filesystem::path& path);

/// The header alone: sums.planes are empty, alpha is missing, and damage may go unseen. For size, settings and ranges.
StateFile inspect_state(const std::filesystem::path& path);

/// Where a.shape, settings and sums cannot be merged with b's: what differs, in words; empty where nothing does.
/// Overlapping ranges are such a thing.
std::string mismatch(const StateFile& a, const StateFile& b);

/// Merges files in the order of the first batch each one holds, so that the order of `paths` has no influence.
/// Memory: two states on the host. Errors: IoError, before anything is merged, that names the two files and what differs.
StateFile merge_states(const Engine& engine, std::span<const std::filesystem::path> paths);

}  // namespace clratio
