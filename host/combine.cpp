#include "clratio/combine.hpp"

#include <cmath>

#include "moments_state.hpp"

namespace clratio {
namespace {

using device::clr_layout;

std::uint32_t zero_policy(Zero z) {
    return z == Zero::mc_mean ? CLR_ZERO_MC_MEAN : z == Zero::zero ? CLR_ZERO_ZERO : CLR_ZERO_ONE;
}

std::uint32_t estimator_code(Estimator e) {
    if (e == Estimator::mean) return CLR_ESTIMATOR_MEAN;
    return e == Estimator::ratio ? CLR_ESTIMATOR_RATIO : CLR_ESTIMATOR_MEAN_OF_RATIOS;
}

View flags_view(const CombineOutput& out, std::uint64_t count) { return {out.flags, 0, count}; }

/// tau on the device, as long as the call needs it.
struct DeviceTau {
    Buffer buffer;
    View view;
};

DeviceTau put(const Engine& engine, const Tau& tau, std::uint64_t count) {
    if (tau.numbers.empty()) {
        if (tau.image.size() != count)
            throw InvalidArgument("tau", std::to_string(count) + " values", std::to_string(tau.image.size()));
        Buffer b = Buffer::from_host(engine, std::as_bytes(tau.image));
        return {b, {b.mem(), 0, count}};
    }
    for (float x : tau.numbers)
        if (!std::isfinite(x)) throw InvalidArgument("tau", "a finite number", std::to_string(x));
    if (count % tau.channels != 0)
        throw InvalidArgument("tau", "as many numbers as channels",
                              std::to_string(tau.channels) + " for " + std::to_string(count) + " values");
    Buffer b(engine, tau.numbers.size() * sizeof(float));
    b.write(std::as_bytes(std::span(tau.numbers)));
    return {b, {b.mem(), 0, count, 0, tau.channels}};
}

/// Host results of a blocking read-out, with the buffers that stand on them.
class HostOutput {
public:
    HostOutput(const Engine& engine, std::uint64_t count, const CombineOptions& options)
        : rows_(Buffer::zeroed(engine, most_work_items(engine) * CLR_TALLY_FLAGS * sizeof(std::uint64_t))) {
        result_.estimate.resize(count);
        result_.flag_image.resize(count);
        if (options.standard_error) result_.standard_error.resize(count);
        estimate_ = Buffer::onto_host(engine, std::as_writable_bytes(std::span(result_.estimate)));
        flags_ = Buffer::onto_host(engine, std::as_writable_bytes(std::span(result_.flag_image)));
        error_ = Buffer::onto_host(engine, std::as_writable_bytes(std::span(result_.standard_error)));
    }

    Reading reading(const View& tau, const CombineOptions& options) const {
        const std::uint64_t n = result_.estimate.size();
        Reading r{tau, {{estimate_.mem(), 0, n}, {}, flags_.mem()}, options, rows_.mem()};
        if (options.standard_error) r.out.standard_error = {error_.mem(), 0, n};
        return r;
    }

    Combined take() {
        estimate_.publish();
        flags_.publish();
        error_.publish();
        std::vector<std::uint64_t> rows(rows_.size() / sizeof(std::uint64_t));
        rows_.read(std::as_writable_bytes(std::span(rows)));
        std::array<std::uint64_t, CLR_TALLY_FLAGS> sum{};
        for (std::size_t i = 0; i < rows.size(); ++i) sum[i % sum.size()] += rows[i];
        result_.flags = {sum[0], sum[1], sum[2], sum[3], sum[4], sum[5], sum[6]};
        return std::move(result_);
    }

private:
    Combined result_;
    Buffer estimate_, flags_, error_, rows_;
};

Event read_moments(const Moments& moments, const Reading& reading, std::span<const cl_event> waits) {
    auto& s = moments.state();
    Launch launch(s.engine, "combine", "clr_combine_moments");
    reading.give(s.give_planes(launch));
    s.last = launch.after(waits).after(std::array{s.last.get()}).run_ranges(s.values);
    return s.last;
}

Event read_means(const Engine& engine, const View& m, const View& t, const Reading& reading,
                 std::span<const cl_event> waits) {
    Launch launch(engine, "combine", "clr_combine");
    return reading.give(launch.view(m).view(t)).after(waits).run_ranges(m.count);
}

void check_stateless(const CombineOptions& options) {
    if (options.estimator != Estimator::ratio)
        throw InvalidArgument("estimator", "ratio, for means without a history", "another; add the batches to Moments");
    if (options.standard_error)
        throw InvalidArgument("standard_error", "false, for means without a history", "true; add the batches to Moments");
}

}  // namespace

void check_estimator(const CombineOptions& options, const MomentsOptions& state) {
    if (options.estimator != Estimator::mean_of_ratios) return;
    if (!state.ratios)
        throw InvalidArgument("estimator", "one whose planes the state has",
                              "mean_of_ratios: make the Moments with .ratios = true");
    if (options.standard_error)
        throw InvalidArgument("standard_error", "an estimator that has one: ratio or mean", "mean_of_ratios");
}

void Reading::check(std::uint64_t count) const {
    check_view("tau", tau, count);
    const auto output = [&](const char* name, const View& v) {
        if (!v.mem) return;
        check_view(name, v, count);
        if (v.stride < v.channels)
            throw InvalidArgument(name, "a stride of at least its channels", std::to_string(v.stride));
        check_overlap(name, v, "tau", tau);
    };
    output("estimate", out.estimate);
    output("standard_error", out.standard_error);
    output("flags", flags_view(out, count));
    if (out.estimate.mem && out.standard_error.mem)
        check_overlap("standard_error", out.standard_error, "estimate", out.estimate);
}

Launch& Reading::give(Launch& launch) const {
    const std::uint32_t outputs = (out.estimate.mem ? CLR_WRITE_ESTIMATE : 0u) |
                                  (out.standard_error.mem ? CLR_WRITE_ERROR : 0u) | (out.flags ? CLR_WRITE_FLAGS : 0u);
    const device::clr_reading r{layout(tau),
                                layout(out.estimate),
                                layout(out.standard_error),
                                estimator_code(options.estimator),
                                zero_policy(options.zero),
                                outputs,
                                0};
    return launch.arg(tau.mem).arg(out.estimate.mem).arg(out.standard_error.mem).arg(out.flags).arg(flag_rows).arg(r);
}

cl_event combine(const Engine& engine, View m, View t, View tau, const CombineOutput& out, CombineOptions options,
                 std::span<const cl_event> wait_list) {
    check_stateless(options);
    check_view("m", m, m.count);
    check_view("t", t, m.count);
    const Reading reading{tau, out, options};
    reading.check(m.count);
    check_overlap("estimate", out.estimate, "m", m);
    check_overlap("estimate", out.estimate, "t", t);
    return read_means(engine, m, t, reading, wait_list).give();
}

Combined combine(const Engine& engine, std::span<const float> m, std::span<const float> t, const Tau& tau,
                 CombineOptions options) {
    check_stateless(options);
    if (t.size() != m.size()) throw InvalidArgument("t", std::to_string(m.size()) + " values", std::to_string(t.size()));
    if (m.empty()) return {};
    const DeviceTau control = put(engine, tau, m.size());
    const Buffer mb = Buffer::from_host(engine, std::as_bytes(m)), tb = Buffer::from_host(engine, std::as_bytes(t));
    HostOutput out(engine, m.size(), options);
    wait(read_means(engine, {mb.mem(), 0, m.size()}, {tb.mem(), 0, m.size()}, out.reading(control.view, options), {}));
    return out.take();
}

cl_event combine(const Moments& moments, View tau, const CombineOutput& out, CombineOptions options,
                 std::span<const cl_event> wait_list) {
    check_estimator(options, moments.options());
    const Reading reading{tau, out, options};
    reading.check(moments.size());
    return read_moments(moments, reading, wait_list).give();
}

Combined combine(const Moments& moments, const Tau& tau, CombineOptions options) {
    check_estimator(options, moments.options());
    const DeviceTau control = put(moments.engine(), tau, moments.size());
    HostOutput out(moments.engine(), moments.size(), options);
    wait(read_moments(moments, out.reading(control.view, options), {}));
    return out.take();
}

Combined add_and_combine(Moments& moments, std::span<const HostBatch> batches, const Tau& tau, CombineOptions options) {
    auto& s = moments.state();
    check_estimator(options, s.options);
    if (batches.empty()) throw InvalidArgument("batches", "at least 1", "0");
    const DeviceTau control = put(s.engine, tau, s.values);
    const OnDevice in = put_on_device(s, batches);
    HostOutput out(s.engine, s.values, options);
    const Reading reading = out.reading(control.view, options);
    const std::size_t fused = std::min<std::size_t>(batches.size(), CLR_BATCHES_PER_LAUNCH);
    const auto all = std::span<const Batch>(in.batches);
    add_batches(s, all.first(all.size() - fused), {});
    wait(add_batches(s, all.last(fused), &reading, {}));
    return out.take();
}

cl_event add_and_combine(Moments& moments, std::span<const Batch> batches, View tau, const CombineOutput& out,
                         CombineOptions options, std::span<const cl_event> wait_list) {
    auto& s = moments.state();
    check_estimator(options, s.options);
    if (batches.empty() || batches.size() > CLR_BATCHES_PER_LAUNCH)
        throw InvalidArgument("batches", "1 to " + std::to_string(CLR_BATCHES_PER_LAUNCH), std::to_string(batches.size()));
    check_batches(s, batches);
    const Reading reading{tau, out, options};
    reading.check(s.values);
    return add_batches(s, batches, &reading, wait_list).give();
}

}  // namespace clratio
