// FixedMoments: a state of whole numbers, with the same bits for any grouping and any order of the batches.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "clratio/moments.hpp"

namespace clratio {

struct Snapshot;

struct FixedOptions {
    /// Of resolution + range: 16, so that Moments hold the weight exactly, to 48.
    static constexpr int least_bits = 16, most_bits = 48;
    /// What a value does that fixed point cannot hold: NaN, infinite, or outside the range. skip or fail, as with Moments.
    NonFinite nonfinite = NonFinite::skip;
    /// Values are kept to the nearest multiple of 2^-resolution, ties to even: 0 to 48. 24 keeps every float16, and every
    /// float32 from 0.5 on, as it is, and moves smaller ones by at most 3e-8.
    int resolution = 24;
    /// The largest magnitude is 2^range, itself allowed: 0 to 48. 16 holds every finite float16.
    int range = 16;

    /// The largest sum of weights, 2^(63 - resolution - range) - 1: up to it, no sum of values within range can overflow. 0
    /// for options that no state can have.
    std::uint64_t most_weight() const {
        const int bits = 63 - resolution - range;
        return bits > 0 && bits < 64 ? (std::uint64_t{1} << bits) - 1 : 0;
    }
};

/// The options of a FixedMoments that the snapshot was taken of. Errors: InvalidArgument for another kind, a setting that is
/// missing, unknown, or has an unknown value.
FixedOptions fixed_options(const Snapshot& snapshot);

/// The device buffers of a state, all of whole numbers, one after the other in plane_stride() of Moments. Of 64 bits: m and
/// t (sums, in units of 2^-resolution), weight; mm, tt and mt (sums of products) low limbs, then high limbs, two's
/// complement. Of 32 bits: batches. weight and batches exist with NonFinite::skip and are null otherwise.
struct FixedPlanes {
    cl_mem m = nullptr, t = nullptr;
    cl_mem mm = nullptr, tt = nullptr, mt = nullptr;
    cl_mem weight = nullptr, batches = nullptr;
};

/// Exact sums of (m, t) and of their products, in 64 and 128 bits, over values quantised to 2^-resolution.
///
/// Shapes: every batch has size() values. Units: those of m and t.
/// Values: nearest multiple of 2^-resolution, ties to even. NaN, infinity and magnitudes above 2^range: skip leaves that
/// value's batch out and counts it (skipped(), outside()); fail refuses the batch by name. NonFinite::propagate is refused.
/// Zero t: accepted. Negative values: accepted, counted by negatives().
/// Weights: whole numbers from 1 on, else InvalidArgument.
/// Overflow: a call that would bring the sum of weights above FixedOptions::most_weight() is refused by name, and nothing is
/// enqueued; below it no sum can overflow, whatever the order.
/// Determinism: the same batches give the same bits at every width and work size, in any order and merged in any grouping.
/// Not here: K groups, finished ratios and reliability weights, which Moments record.
/// Cost: state_bytes() on the device: 76 bytes a value, 64 with fail; 8 batches of one weight a launch, which reads and
/// writes the state once. Not for concurrent use of one object; several objects may share an Engine across threads.
class FixedMoments {
public:
    FixedMoments(const Engine& engine, std::uint64_t values, FixedOptions options = {});
    /// The state that the snapshot was taken of, bit for bit. Errors: InvalidArgument where it does not fit together.
    FixedMoments(const Engine& engine, const Snapshot& snapshot);

    /// Moves only, as a copy would be a second state or a second name of one: merge() into a new state, or a Snapshot,
    /// copies.
    FixedMoments(FixedMoments&&) noexcept = default;
    FixedMoments& operator=(FixedMoments&&) noexcept = default;

    static std::uint64_t state_bytes(std::uint64_t values, FixedOptions options = {});

    /// Blocking. Spans of size() floats on the host.
    void add(std::span<const float> m, std::span<const float> t, double weight = 1);
    void add(std::span<const HostBatch> batches);
    /// Event form: enqueues and returns; the caller releases the event. NonFinite::fail is not possible here.
    cl_event add(std::span<const Batch> batches, std::span<const cl_event> wait_list);

    /// As if other's batches had been added here. Errors: another size, options or Engine; too much weight.
    void merge(const FixedMoments& other);
    cl_event merge(const FixedMoments& other, std::span<const cl_event> wait_list);

    /// Forgets all batches and counts; the memory stays. Blocking.
    void clear();

    /// The state as Moments, which every estimator and error bar reads: means, and second moments about the means, each
    /// exact before it is rounded once to two floats (hi the nearest float, lo the nearest to what it leaves, 0 below
    /// 2^-126). Its skipped() includes outside(). A Moments of another size, Engine or policy, with groups, or with planes
    /// that a fixed state lacks, is refused.
    Moments moments() const;
    cl_event moments(Moments& into, std::span<const cl_event> wait_list) const;

    std::uint64_t size() const;     ///< values
    std::uint64_t batches() const;  ///< added so far, skipped ones included
    std::uint64_t weight() const;   ///< their sum
    FixedOptions options() const;
    const Engine& engine() const;

    /// Blocking, over all batches: negative inputs; values that a batch lost to NonFinite::skip; those of them that were
    /// finite, but outside the range.
    std::uint64_t negatives() const;
    std::uint64_t skipped() const;
    std::uint64_t outside() const;

    /// The numbers of a plane in its own order, low limbs then high limbs without padding; empty where the state lacks it.
    std::vector<std::uint64_t> limbs(cl_mem FixedPlanes::*plane) const;
    FixedPlanes planes() const;

    /// Blocking. As plain host data: kind "fixed", planes of 32-bit words "m.0" (low), "m.1", "t.0" .. "mm.0" to "mm.3" and
    /// so on. It has one count of skipped values: outside() starts again at 0 in a state made from it.
    Snapshot snapshot() const;

    struct State;
    State& state() const { return *state_; }

private:
    std::shared_ptr<State> state_;
};

}  // namespace clratio
