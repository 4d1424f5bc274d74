// What a Moments holds, and how its kernels see it. Private to the library.
#pragma once

#include <array>

#include "clratio/combine.hpp"
#include "clratio/device/planes.h"
#include "clratio/moments.hpp"
#include "launch.hpp"

namespace clratio {

/// Part `number` of the parts x groups in each tile of a plane.
struct PlanePart {
    cl_mem plane;
    std::size_t parts, number;
};

struct Moments::State {
    State(const Engine& e, std::uint64_t count, MomentsOptions o) : engine(e), values(count), options(o) {}

    Engine engine;
    std::uint64_t values;
    MomentsOptions options;
    struct Group {
        std::uint64_t batches = 0;
        device::clr_two weight{0, 0}, weight2{0, 0};
    };
    std::vector<Group> groups = std::vector<Group>(options.groups);
    std::vector<Memory> owned;
    StatePlanes planes;
    Buffer add_rows;
    Event last;  ///< the last launch that touched the planes

    std::uint64_t batches() const;
    device::clr_state state_of(std::size_t group) const;
    device::clr_groups all_groups() const;
    std::vector<std::uint32_t> read_plane(const PlanePart& part) const;  ///< blocking
    void write_plane(const PlanePart& part, std::span<const std::uint32_t> words) const;
    Launch& give_planes(Launch& launch) const;  ///< the CLR_PLANE_ARGUMENTS
};

/// A read-out as the kernels take it: the CLR_READING_ARGUMENTS.
struct Reading {
    View tau;
    CombineOutput out;
    CombineOptions options;
    cl_mem flag_rows = nullptr;
    Buffer quantiles{};  ///< of the interval, where values differ in their number of batches

    /// Sizes of views, and overlaps of outputs with each other, tau and `inputs`.
    void check(std::uint64_t count, std::span<const std::pair<const char*, View>> inputs = {}) const;
    std::uint32_t asked() const;  ///< CLR_WRITE and CLR_COUNT bits
    /// Of a program for this reading of such states alone.
    std::string program_options(const MomentsOptions& state) const;
    Launch& give(Launch& launch, Weights weights, std::uint64_t added) const;
};

/// Weights, sizes and the nonfinite policy of batches that come as views.
void check_batches(std::uint64_t values, NonFinite nonfinite, std::span<const Batch> batches);

/// Throws InvalidArgument for a state of no values, or of more than sizes can tell.
void check_values(std::uint64_t values);

/// Throws InvalidArgument where a state would hold more batches than it can count.
void check_room(std::uint64_t batches, std::uint64_t more);
/// The same, and where the sum of squares of all weights would be no float.
void check_room(const Moments::State& state, std::uint64_t more, double squares);

/// Of the weights of batches.
template <class Batches> double sum_of_squares(const Batches& batches) {
    double sum = 0;
    for (const auto& b : batches) sum += b.weight * b.weight;
    return sum;
}

/// Host batches as views, with the buffers under them. Checks what Moments::add promises to check.
struct OnDevice {
    std::vector<Buffer> memory;
    std::vector<Batch> batches;
};
OnDevice put_on_device(const Engine& engine, std::uint64_t values, NonFinite nonfinite, std::span<const HostBatch> batches);

/// Two arguments for each batch that a launch can take, and their clr_batches. The group grows by them.
Launch& give_batches(Launch& launch, std::span<const Batch> batches, Moments::State::Group& group);

std::uint32_t state_options(const MomentsOptions& options);  ///< CLR_STATE bits

/// Adds 1 to 8 batches to one group in one launch, and reads out in the same pass where asked.
Event add_to_group(Moments::State& state, std::size_t group, std::span<const Batch> batches, const Reading* reading,
                   std::span<const cl_event> waits);
/// Adds any number of batches, 8 of a group in a launch; the event of the last.
Event add_batches(Moments::State& state, std::span<const Batch> batches, std::span<const cl_event> waits);

/// Names what the estimator needs and the state lacks, and options out of range.
void check_estimator(const CombineOptions& options, const MomentsOptions& state);

}  // namespace clratio
