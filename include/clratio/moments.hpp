// Moments: the state of a progressive combination. One state a value (a pixel's channel), any number of batches.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "clratio/engine.hpp"
#include "clratio/view.hpp"

namespace clratio {

/// What a NaN or an infinity in a batch does.
enum class NonFinite {
    skip,       ///< that value's batch does not count: its weight and batch count are per value
    propagate,  ///< the value becomes NaN for ever
    fail,       ///< the whole batch is refused with InvalidArgument, the state stays as it was (blocking calls only)
};

struct MomentsOptions {
    NonFinite nonfinite = NonFinite::skip;
    bool ratios = false;  ///< record what the mean of ratios needs: 6 more planes
};

/// One batch: m and t hold `count` values, each the mean of `weight` samples.
struct Batch {
    View m, t;
    double weight = 1;
};
struct HostBatch {
    std::span<const float> m, t;
    double weight = 1;
};

/// Planes of float32, each of plane_stride() elements, one after the other from `offset` on in `mem`:
/// mean m, mean t, M2 m, M2 t, C mt, each as hi then lo; with NonFinite::skip then weight hi, lo and batches (uint32);
/// with ratios then mean of m/t, mean of m where t = 0, share of weight where t = 0, each as hi then lo.
struct StateView {
    cl_mem mem = nullptr;
    std::uint64_t offset = 0;  ///< elements
};

/// Two-float difference-form Welford/Chan moments of (m, t), theory: Chan, Golub, LeVeque 1979, with sample counts as weights.
///
/// Shapes: every batch has size() values. Units: those of m and t.
/// NaN and infinity: by NonFinite. Zero t: accepted. Negative values: accepted, counted by negatives().
/// Weights: finite and positive, else InvalidArgument; the sum is exact for integers below 2^48.
/// Determinism: the same batches in the same order give the same bits at every width and work size, and however
/// many are added in one call; another grouping, merged, agrees within 2 ulp of the estimate.
/// Cost: state_bytes() on the device; a batch moves 8 bytes a value in and the state in and out once a call of up to 8.
/// Not for concurrent use of one object; several objects may share an Engine across threads.
class Moments {
public:
    Moments(const Engine& engine, std::uint64_t values, MomentsOptions options = {});
    /// On the caller's memory of state_bytes(), zeroed, which must outlive this.
    Moments(const Engine& engine, std::uint64_t values, MomentsOptions options, StateView memory);

    static std::uint64_t state_bytes(std::uint64_t values, MomentsOptions options = {});
    static std::uint64_t plane_stride(std::uint64_t values);  ///< elements

    /// Blocking. Spans of size() floats on the host.
    void add(std::span<const float> m, std::span<const float> t, double weight = 1);
    void add(std::span<const HostBatch> batches);
    /// Event form: enqueues and returns; the caller releases the event. NonFinite::fail is not possible here.
    cl_event add(std::span<const Batch> batches, std::span<const cl_event> wait_list);

    /// Chan's merge: as if other's batches had been added after these. Errors: another size, options or context.
    void merge(const Moments& other);
    cl_event merge(const Moments& other, std::span<const cl_event> wait_list);

    std::uint64_t size() const;     ///< values
    std::uint64_t batches() const;  ///< added so far, skipped ones included
    double weight() const;          ///< their sum
    MomentsOptions options() const;
    const Engine& engine() const;

    /// Blocking. Negative inputs, and values a batch lost to NonFinite::skip, over all batches.
    std::uint64_t negatives() const;
    std::uint64_t skipped() const;

    /// The planes as they are on the device, for tests and for saving.
    std::vector<std::uint32_t> bits() const;

    struct State;
    State& state() const { return *state_; }

private:
    std::shared_ptr<State> state_;
};

}  // namespace clratio
