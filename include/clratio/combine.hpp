// From moments, or from a single pair of images, to the ratio estimate tau mean(m) / mean(t).
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "clratio/engine.hpp"
#include "clratio/estimator.hpp"
#include "clratio/moments.hpp"
#include "clratio/view.hpp"

namespace clratio {

/// What stands where the mean of t is 0 and tau is not.
enum class Zero { mc_mean, zero, one };

struct CombineOptions {
    Estimator estimator = Estimator::ratio;
    Zero zero = Zero::mc_mean;
    // What a blocking call computes besides the estimate; an event form writes the views it is given.
    bool flag_image = true;
    bool standard_error = false;
    bool bias = false;      ///< of the ratio, estimated to first order
    bool interval = false;  ///< lower, upper and kind
    bool gain = false;      ///< predicted variance of the ratio over that of the plain mean, below 1 where it pays
    bool needed = false;    ///< batches still to come until the standard error meets the target
    double level = 0.95;    ///< of the interval, in (0, 1)
    IntervalMethod method = IntervalMethod::fieller;
    std::uint32_t counted = ~std::uint32_t{0};  ///< flags that make a value count in FlagCounts::any
    float target = 0, relative_target = 0;      ///< the larger of target and relative_target |estimate|
};

/// How many values carry each flag; the CLR_FLAG_* bits of device/ratio.h name them.
struct FlagCounts {
    std::uint64_t zero_denominator = 0, zero_tau = 0, skipped = 0, no_data = 0, no_error_bar = 0, nonfinite = 0,
                  fell_back = 0, no_spread = 0;
    std::uint64_t any = 0;  ///< values with at least one of those in CombineOptions::counted; stateless: with any at all
    std::uint64_t total() const { return any; }
    FlagCounts& operator+=(const FlagCounts& more);
};

/// Empty where not asked for.
struct Combined {
    std::vector<float> estimate;
    std::vector<float> standard_error;      ///< +inf where there is none
    std::vector<std::uint32_t> flag_image;  ///< a bit mask for each value
    FlagCounts flags;
    std::vector<float> bias;          ///< estimated E[ratio] - truth; +inf where it is not known
    std::vector<float> lower, upper;  ///< of the confidence interval
    std::vector<std::uint32_t> kind;  ///< IntervalKind of each value
    std::vector<float> gain;          ///< +inf where only t varies; 1 where the ratio does not either
    std::vector<float> needed;        ///< 0: the target is met; +inf where nothing is known
    std::uint64_t negatives = 0;      ///< negative inputs that combine_batches has read
};

/// tau: one number, one for each of `channels` interleaved channels, or one for each value. Numbers are copied; an image is
/// borrowed, and may hold NaN and infinities; one that is given away, as Tau::owning does and `Tau tau = read_image(..)`, is
/// kept. A std::vector is numbers, one a channel, also where it is as long as an image: a std::span is an image. Errors, of
/// the call that takes it: InvalidArgument for a number that is not finite, a count of values that is no multiple of
/// `channels`, an image of another count.
struct Tau {
    Tau(float number) : numbers{number}, channels(1) {}
    Tau(std::vector<float> each_channel)
        : numbers(std::move(each_channel)), channels(static_cast<std::uint32_t>(numbers.size())) {}
    Tau(std::span<const float> each_value) : image(each_value) {}
    static Tau owning(std::vector<float> each_value) {
        const auto kept = std::make_shared<const std::vector<float>>(std::move(each_value));
        Tau tau{std::span<const float>(*kept)};
        tau.kept = kept;
        return tau;
    }
    std::vector<float> numbers;
    std::uint32_t channels = 1;
    std::span<const float> image;
    std::shared_ptr<const std::vector<float>> kept;  ///< what image lies in, or nothing
};

/// Device views of a read-out; null members are not written. Flags: uint32, contiguous.
struct CombineOutput {
    View estimate{};
    View standard_error{};
    cl_mem flags = nullptr;
    View bias{}, lower{}, upper{}, gain{}, needed{};
    cl_mem kind = nullptr;  ///< uint32, contiguous
};

/// Stateless: one launch, no state, for those who hold their means (or equal-weight sums) already.
///
/// Shapes: m, t, tau and outputs of one count (a tau of stride 0 repeats). An output stands apart from other outputs, and
/// from the inputs or on the very elements of one: what lies between first and last element counts, gaps too. Units: the
/// estimate's are those of m; tau and t share theirs. Zero: t = 0 with tau != 0 gives options.zero, tau = 0 gives m / (t +
/// 1); both are flagged. NaN: one in m, t or tau makes the estimate NaN, flagged, unless t is 0 and what options.zero gives
/// does not use it. For finite m and tau, an infinite t gives 0, without a flag. Range: evaluated in float as (tau + i) (m /
/// (t + i)), the quotient first. Within 1.5 ulp of eq. (10) where quotient and estimate are 0 or in [2^-126, 2^128) in
/// magnitude; infinite or NaN, flagged, where either is above; less exact where either is below. m = t gives tau exactly, 0
/// <= m <= t an estimate in [0, tau]. Errors: InvalidArgument (views, estimators other than the ratio, more than estimate
/// and flags) before anything is enqueued; DeviceError, BuildError. Cost: one pass, 4 bytes a value of each array read or
/// written. Determinism: the same bits on every device with correctly rounded division, at every width and work size.
/// Source: supplement eq. (10).
cl_event combine(const Engine& engine, View m, View t, View tau, const CombineOutput& out, CombineOptions options = {},
                 std::span<const cl_event> wait_list = {});
Combined combine(const Engine& engine, std::span<const float> m, std::span<const float> t, const Tau& tau,
                 CombineOptions options = {});

/// Reads estimates out of moments: estimator.hpp says what each is, what it needs, and its error bar. Where the mean of t is
/// 0 or tau is 0, all but the two means and the regressions give what the ratio gives.
///
/// Shapes: tau and outputs of size() values (a tau of stride 0 repeats). An output stands apart from other outputs, and from
/// tau or on its very elements. Units: those of m; gain has none, needed counts batches, not whole ones.
/// NaN: in batches, by NonFinite; a value that all batches were left out of is 0, flagged no_data. A NaN or an infinity in
/// tau makes the estimate NaN or infinite, flagged, save for estimators that do not use tau there: the plain mean, the ratio
/// and its relatives where mean(t) is 0 (Zero::mc_mean, Zero::zero), regressions that fall back to the mean, as
/// crossfit_regression then always does.
/// Range: each formula as evaluated in float; where a product or quotient named here reaches 2^128 in magnitude, what it
/// enters is infinite or NaN; below 2^-126 it loses bits, and then is 0.
/// - ratio: differences of a batch from the mean; mean(m) / mean(t), then times tau. No square, so every m, t and tau up to
///   2^127 whose two results fit.
/// - error bars, intervals, gain, bias and the other estimators' corrections: weight times squares and products of
///   deviations of m and t, and 1 / mean(t), tau / mean(t). A NaN error bar has no flag; one of 0 has, with an interval or
///   needed, no_spread, also where squares vanished. Of second moments about the ratio what is below 2^-40 of m's and r t's
///   own is rounding, and counts as 0.
/// - regression: mean(m) and beta (mean(t) - tau), each rounded to float, are subtracted: a batch 10^6 times the others
///   costs both digits.
/// - beale besides: tau times the covariance of t and the residual, over mean(t)^2 + Var(mean(t)): that is third powers,
///   so all magnitudes within about 2^-42 to 2^42. NaN where all |t| are below 2^-75, as the divisor is 0 then.
///
/// Confidence intervals: IntervalMethod::delta is estimate -+ q error, fieller is exact for normal means and belongs to the
/// ratio whatever the estimator; q is Student's quantile at K - 1 degrees of freedom (regressions by delta: K - 2), where K
/// counts the value's own batches up to 1024 and the state's beyond; for the jackknife by delta K counts groups. Errors:
/// InvalidArgument for an estimator whose planes the state lacks (it says what to record), level, targets, tau, views,
/// before anything is enqueued; DeviceError, BuildError. Determinism: the same bits on every device with correctly rounded +
/// - * / sqrt and fma, at every width and work size. Cost: one pass over the planes read (state_bytes() at most) and what is
/// written, up to three over those of groups. Source: supplement eq. (10), eq. (5) for the mean of ratios; estimator.hpp for
/// all others; Fieller 1940.
cl_event combine(const Moments& moments, View tau, const CombineOutput& out, CombineOptions options = {},
                 std::span<const cl_event> wait_list = {});
/// The memory of `reuse` is taken for this result: that of an earlier one, or, as its estimate, of tau's own image, which
/// the estimate then takes the place of.
Combined combine(const Moments& moments, const Tau& tau, CombineOptions options = {}, Combined reuse = {});

/// Adds batches and reads out; ratio, mean and mean of ratios of a state without groups in the pass that adds the last 8
/// batches, if nothing but estimate, error and flags is asked for. For progressive display, and where all batches are there.
///
/// Shapes: every batch, tau and output of moments.size() values. Units, NaN, zero, range: those of Moments::add and of
/// combine(Moments). Errors: theirs too, and InvalidArgument for no batch at all; all found before the state changes. After
/// a DeviceError or a BuildError the state may hold some of the batches.
/// Cost: 8 bytes a value and batch, the state read and written once for each 8 batches of a group, and what is written;
/// where the pass is not shared, a read-out besides. Determinism: the bits of Moments::add, then combine(Moments).
Combined add_and_combine(Moments& moments, std::span<const HostBatch> batches, const Tau& tau, CombineOptions options = {},
                         Combined reuse = {});
/// 1 to 8 batches; enqueues and returns, the caller releases the event. All as above, but that NonFinite::fail is refused.
/// An output must not overlap the views of the batches, which is not checked.
cl_event add_and_combine(Moments& moments, std::span<const Batch> batches, View tau, const CombineOutput& out,
                         CombineOptions options = {}, std::span<const cl_event> wait_list = {});

struct BatchOptions {
    NonFinite nonfinite = NonFinite::skip;  ///< fail: blocking calls only
    Weights weights = Weights::samples;
};

/// 1 to 8 batches that are all there are: what they give when added to new Moments and read out, the same bits, in one pass
/// that keeps no state. Shapes, policies, errors: those of Moments::add and of combine(Moments). Estimators: all but those
/// over groups. Cost: 8 bytes a value and batch, tau, and what is written.
cl_event combine_batches(const Engine& engine, std::span<const Batch> batches, View tau, const CombineOutput& out,
                         CombineOptions options = {}, BatchOptions how = {}, std::span<const cl_event> wait_list = {});
/// Of any size: what does not fit into one allocation of the device is done in parts. `reuse` as above.
Combined combine_batches(const Engine& engine, std::span<const HostBatch> batches, const Tau& tau,
                         CombineOptions options = {}, BatchOptions how = {}, Combined reuse = {});

}  // namespace clratio
