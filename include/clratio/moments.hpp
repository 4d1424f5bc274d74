// Moments: the state of a progressive combination. One state a value (a pixel's channel), any number of batches.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "clratio/engine.hpp"
#include "clratio/snapshot.hpp"
#include "clratio/view.hpp"

namespace clratio {

/// What a NaN or an infinity in a batch does.
enum class NonFinite {
    skip,       ///< that value's batch does not count: its weight and batch count are per value
    propagate,  ///< the value becomes NaN for ever
    fail,       ///< the whole batch is refused with InvalidArgument, the state stays as it was (blocking calls only)
};

/// The range of a batch's weight: its square is a float, as the sum of a state's squares must be, which is below 2^128.
inline constexpr double least_weight = 0x1p-60, most_weight = 0x1p60;

/// What a batch's weight says. Only error bars differ, and the corrections of estimators that use them.
enum class Weights {
    samples,      ///< how many samples the batch is the mean of: its variance goes with 1/weight
    reliability,  ///< how much it is trusted; all batches have the same variance. Records one more plane
};

inline constexpr std::uint32_t most_groups = 16;

struct MomentsOptions {
    NonFinite nonfinite = NonFinite::skip;
    bool ratios = false;       ///< record what the mean of ratios and Hartley-Ross need: 6 more planes
    std::uint32_t groups = 1;  ///< 1 to most_groups; batch k goes to group k mod groups, each a state of its own
    Weights weights = Weights::samples;
    bool operator==(const MomentsOptions&) const = default;
};

/// One batch: m and t hold `count` values, each the mean of `weight` samples. Its index chooses its group: by default the
/// number of batches added before it; where several machines share the work, its number among all batches.
struct Batch {
    View m, t;
    double weight = 1;
    std::optional<std::uint64_t> index{};
};
struct HostBatch {
    std::span<const float> m, t;
    double weight = 1;
    std::optional<std::uint64_t> index{};
};

/// The device buffers of a state. Each lies in tiles of 32 values: for each group 32 float32 hi parts, then 32 lo parts; a
/// value is hi + lo. hi need not be the nearest float: between the batches that settle, every eighth, lo may be several
/// percent of it. `batches` has 32 uint32 for each group instead. weight
/// and batches exist with NonFinite::skip, weight2 if Weights::reliability is set besides, the last three with `ratios`;
/// they are null otherwise.
struct StatePlanes {
    cl_mem m = nullptr, t = nullptr;                                    ///< means
    cl_mem mm = nullptr, tt = nullptr, mt = nullptr;                    ///< second moments about the means
    cl_mem weight = nullptr, batches = nullptr;                         ///< of each value
    cl_mem quotient = nullptr, zero_m = nullptr, zero_share = nullptr;  ///< means of m/t; of m, and of 1, where t = 0
    cl_mem weight2 = nullptr;                                           ///< sums of squared weights
};

/// Two-float difference-form Welford/Chan moments of (m, t), theory: Chan, Golub, LeVeque 1979, with sample counts as
/// weights.
///
/// Shapes: every batch has size() values. Units: those of m and t.
/// NaN and infinity: by NonFinite. Zero t: accepted. Negative values: accepted, counted by negatives().
/// Weights: from 2^-60 to 2^60, the sum of their squares below 2^128, else InvalidArgument; the sum is exact for integers
/// below 2^48. Determinism: the same batches in the same order give the same bits at every width and work size, and however
/// many are added in one call, on every device with correctly rounded + - * / and fma; another grouping, merged, agrees
/// within 2 ulp of the estimate. What is NaN is so everywhere, with whatever bits. After a failed command the sums are void:
/// calls throw its DeviceError until clear(). Cost: state_bytes() on the device (40 bytes a value, 52 with skip; times
/// groups); 8 batches a launch, or the batches of one group, which reads and writes the state of the group once. Not for
/// concurrent use of one object; several objects may share an Engine across threads.
class Moments {
public:
    Moments(const Engine& engine, std::uint64_t values, MomentsOptions options = {});
    /// On the caller's buffers, of groups * plane_bytes() each (`batches`: half of it), of any content; they are retained.
    Moments(const Engine& engine, std::uint64_t values, MomentsOptions options, const StatePlanes& planes);

    /// The state that the snapshot was taken of, bit for bit. Errors: InvalidArgument where it does not fit together.
    Moments(const Engine& engine, const Snapshot& snapshot);

    /// Moves only, as a copy would be a second state or a second name of one: merge() into a new state, or a Snapshot,
    /// copies.
    Moments(Moments&&) noexcept = default;
    Moments& operator=(Moments&&) noexcept = default;

    static std::uint64_t plane_stride(std::uint64_t values);  ///< values rounded up to whole tiles
    static std::uint64_t plane_bytes(std::uint64_t values);
    static std::uint64_t state_bytes(std::uint64_t values, MomentsOptions options = {});  ///< of all planes

    /// Blocking. Spans of size() floats on the host.
    void add(std::span<const float> m, std::span<const float> t, double weight = 1);
    void add(std::span<const HostBatch> batches);
    /// Event form: enqueues and returns; the caller releases the event. Errors: InvalidArgument before anything is enqueued:
    /// no batch, NonFinite::fail, a weight out of range, a view that is null, without channels, of another count than size()
    /// or past its buffer's end, more than 2^32 - 1 batches in the state. DeviceError, BuildError: the state may then hold
    /// some of the batches.
    cl_event add(std::span<const Batch> batches, std::span<const cl_event> wait_list);

    /// Chan's merge: as if other's batches had been added after these. Errors: InvalidArgument for another size, options or
    /// Engine, more than 2^32 - 1 batches together. Cost: reads both states and writes this one, 3 state_bytes() at most, in
    /// a launch for the first group and for each other one in which `other` has batches.
    void merge(const Moments& other);
    cl_event merge(const Moments& other, std::span<const cl_event> wait_list);

    /// Forgets all batches and counts; the memory stays. Blocking.
    void clear();

    std::uint64_t size() const;     ///< values
    std::uint64_t batches() const;  ///< added so far, skipped ones included
    double weight() const;          ///< their sum
    MomentsOptions options() const;
    const Engine& engine() const;

    /// Blocking. Negative inputs, and values a batch lost to NonFinite::skip, over all batches.
    std::uint64_t negatives() const;
    std::uint64_t skipped() const;

    /// The values of a plane in its own order, group by group hi parts then lo parts without padding, as bits; empty where
    /// the state lacks it.
    std::vector<std::uint32_t> bits(cl_mem StatePlanes::*plane) const;
    StatePlanes planes() const;

    /// Blocking. Everything but the memory's place, as plain host data; see clratio/state.hpp for files.
    Snapshot snapshot() const;

    struct State;
    State& state() const { return *state_; }

private:
    std::shared_ptr<State> state_;
};

}  // namespace clratio
