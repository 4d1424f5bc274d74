// From moments, or from a single pair of images, to the ratio estimate tau mean(m) / mean(t).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "clratio/device/ratio.h"
#include "clratio/engine.hpp"
#include "clratio/moments.hpp"
#include "clratio/view.hpp"

namespace clratio {

enum class Estimator {
    ratio,           ///< tau mean(m) / mean(t), eq. (10); consistent, bias O(1/N)
    mean,            ///< mean(m); unbiased, tau and t unused
    mean_of_ratios,  ///< mean of finished ratios, eq. (5): a bias that no number of batches removes. Needs
                     ///< MomentsOptions::ratios
};

/// What stands where the mean of t is 0 and tau is not.
enum class Zero { mc_mean, zero, one };

struct CombineOptions {
    Estimator estimator = Estimator::ratio;
    Zero zero = Zero::mc_mean;
    bool standard_error = false;  ///< also compute it (blocking form)
};

/// How many values carry each flag; the CLR_FLAG_* bits of device/ratio.h name them.
struct FlagCounts {
    std::uint64_t zero_denominator = 0, zero_tau = 0, skipped = 0, no_data = 0, no_error_bar = 0, nonfinite = 0;
    std::uint64_t any = 0;  ///< values with at least one of them
    std::uint64_t total() const { return any; }
};

struct Combined {
    std::vector<float> estimate;
    std::vector<float> standard_error;      ///< empty unless asked for
    std::vector<std::uint32_t> flag_image;  ///< a bit mask for each value
    FlagCounts flags;
};

/// tau: one number, one for each of `channels` interleaved channels, or one for each value.
struct Tau {
    Tau(float number) : numbers{number}, channels(1) {}
    Tau(std::vector<float> each_channel)
        : numbers(std::move(each_channel)), channels(static_cast<std::uint32_t>(numbers.size())) {}
    Tau(std::span<const float> each_value) : image(each_value) {}
    std::vector<float> numbers;
    std::uint32_t channels = 1;
    std::span<const float> image;
};

/// Device views of a read-out; null members are not written. Flags: uint32, contiguous.
struct CombineOutput {
    View estimate;
    View standard_error;
    cl_mem flags = nullptr;
};

/// Stateless: one launch, no state, for those who hold their means (or equal-weight sums) already.
/// Shapes: m, t, out of the same count; tau a View of that count, or one with stride 0. NaN in, NaN out, flagged.
/// Zero denominator: options.zero. Errors: InvalidArgument before anything is enqueued. Cost: 16 bytes a value.
/// Determinism: the same bits everywhere. Source: supplement eq. (10).
cl_event combine(const Engine& engine, View m, View t, View tau, const CombineOutput& out, CombineOptions options = {},
                 std::span<const cl_event> wait_list = {});
Combined combine(const Engine& engine, std::span<const float> m, std::span<const float> t, const Tau& tau,
                 CombineOptions options = {});

/// Reads the estimate out of moments. The standard error is the delta method's:
/// |(tau + i) / (mean t + i)| sqrt((M2 m - 2 r C + r^2 M2 t) / ((K - 1) W)), K - 1 degrees of freedom; +inf for K < 2.
cl_event combine(const Moments& moments, View tau, const CombineOutput& out, CombineOptions options = {},
                 std::span<const cl_event> wait_list = {});
Combined combine(const Moments& moments, const Tau& tau, CombineOptions options = {});

/// Adds batches and reads out, the last 8 of them in the same pass: for progressive display, and where all batches are
/// there.
Combined add_and_combine(Moments& moments, std::span<const HostBatch> batches, const Tau& tau, CombineOptions options = {});
/// At most 8 batches, one launch.
cl_event add_and_combine(Moments& moments, std::span<const Batch> batches, View tau, const CombineOutput& out,
                         CombineOptions options = {}, std::span<const cl_event> wait_list = {});

}  // namespace clratio
