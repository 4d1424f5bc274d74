// Snapshot: a state of any kind as plain host data, to be kept, sent or merged elsewhere.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "clratio/engine.hpp"

namespace clratio {

struct MomentsOptions;

/// What a state holds, bit for bit: from Moments::snapshot() and back by Moments(engine, snapshot).
///
/// Shapes: each plane holds `values` words. Every group has planes of its own, those of groups after the first called
/// "g1.m.hi" and so on, group by group. Words are float32 bits in planes whose name ends in .hi or .lo, unsigned integers in
/// all others. NaN: kept with its bits. Units: as the state's planes, see StatePlanes.
struct Snapshot {
    std::string kind;                                           ///< "moments" for Moments, "fixed" for FixedMoments
    std::uint64_t values = 0;                                   ///< pixels x channels
    std::vector<std::pair<std::string, std::string>> settings;  ///< what two states must share to be merged

    /// The batches of one group; the sum of their weights is weight + weight_low, exact as the two floats it came from.
    struct Group {
        std::uint64_t batches = 0;
        double weight = 0, weight_low = 0;
        double weight2 = 0, weight2_low = 0;  ///< the same of the squared weights
        bool operator==(const Group&) const = default;
    };
    std::vector<Group> groups;
    std::uint64_t negatives = 0, skipped = 0;

    struct Plane {
        std::string name;
        std::vector<std::uint32_t> words;
        bool operator==(const Plane&) const = default;
    };
    std::vector<Plane> planes;

    std::uint64_t batches() const;  ///< of all groups
    bool operator==(const Snapshot&) const = default;
};

/// The options that a Moments with these settings has. Errors: InvalidArgument for another kind, a setting that is missing,
/// unknown, or has an unknown value.
MomentsOptions moments_options(const Snapshot& snapshot);

/// Values [begin, begin + count) of a snapshot, with none of its negatives and skipped: a state of its own.
/// Errors: InvalidArgument for a range past the end, or a plane that does not hold `values` words.
Snapshot slice(const Snapshot& snapshot, std::uint64_t begin, std::uint64_t count);
/// The reverse: more values after those that are there, their negatives and skipped added. An empty one takes all of `more`.
/// Errors: InvalidArgument where kind, settings, groups or planes differ.
void append(Snapshot& to, const Snapshot& more);

/// As Moments::merge: the batches of `more` after those that are there. Works in slices, so that the device holds little.
/// Errors: InvalidArgument where values, kind, settings or planes differ, with nothing changed.
void merge(const Engine& engine, Snapshot& into, const Snapshot& more);

}  // namespace clratio
