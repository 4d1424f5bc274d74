#include "clratio/combine.hpp"

#include <cmath>

#include "moments_state.hpp"

namespace clratio {
namespace {

using device::clr_layout;

std::uint32_t zero_policy(Zero z) {
    return z == Zero::mc_mean ? CLR_ZERO_MC_MEAN : z == Zero::zero ? CLR_ZERO_ZERO : CLR_ZERO_ONE;
}

View words_view(cl_mem words, std::uint64_t count) { return {words, 0, count}; }

bool wants_interval(const CombineOutput& out) { return out.lower.mem || out.upper.mem || out.kind; }
bool wants_more(const CombineOutput& out) { return wants_interval(out) || out.bias.mem || out.gain.mem || out.needed.mem; }

bool regresses(Estimator e) { return device::clr_is_regression(static_cast<std::uint32_t>(e)); }

/// The interval's quantile for a value of so many batches.
double quantile_for(const CombineOptions& options, std::uint64_t batches) {
    const std::uint64_t lost = regresses(options.estimator) ? 2 : 1;
    return student_quantile(options.level, static_cast<double>(batches > lost ? batches - lost : 1));
}

constexpr std::uint64_t longest_table = 1024;

/// For states whose values may differ in their number of batches.
Buffer quantile_table(const Moments::State& s, const CombineOptions& options) {
    std::vector<float> table;
    for (std::uint64_t k = 0; k <= std::min(s.batches(), longest_table); ++k)
        table.push_back(static_cast<float>(quantile_for(options, k)));
    return Buffer::copy_of(s.engine, std::as_bytes(std::span(table)));
}

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
    HostOutput(const Engine& engine, std::uint64_t count, const CombineOptions& options, Combined reuse = {})
        : engine_(engine), count_(count), result_(std::move(reuse)),
          rows_(Buffer::zeroed(engine, most_work_items(engine) * CLR_TALLY_FLAGS * sizeof(std::uint64_t))) {
        const auto view = [&](std::vector<float>& values, bool wanted) { return View{place_if(wanted, values), 0, count}; };
        out_.estimate = view(result_.estimate, true);
        out_.flags = place_if(options.flag_image, result_.flag_image);
        out_.standard_error = view(result_.standard_error, options.standard_error);
        out_.bias = view(result_.bias, options.bias);
        out_.lower = view(result_.lower, options.interval);
        out_.upper = view(result_.upper, options.interval);
        out_.kind = place_if(options.interval, result_.kind);
        out_.gain = view(result_.gain, options.gain);
        out_.needed = view(result_.needed, options.needed);
    }

    const CombineOutput& output() const { return out_; }
    Reading reading(const View& tau, const CombineOptions& options) const { return {tau, out_, options, rows_.mem()}; }
    cl_mem rows() const { return rows_.mem(); }

    Combined take() {
        for (const Buffer& b : buffers_) b.publish();
        std::vector<std::uint64_t> rows(rows_.size() / sizeof(std::uint64_t));
        rows_.read(std::as_writable_bytes(std::span(rows)));
        std::array<std::uint64_t, CLR_TALLY_FLAGS> sum{};
        for (std::size_t i = 0; i < rows.size(); ++i) sum[i % sum.size()] += rows[i];
        result_.flags = {sum[0], sum[1], sum[2], sum[3], sum[4], sum[5], sum[6], sum[7], sum[8]};
        return std::move(result_);
    }

private:
    template <class T> cl_mem place_if(bool wanted, std::vector<T>& values) {
        values.resize(wanted ? count_ : 0);
        if (!wanted) return nullptr;
        buffers_.push_back(Buffer::onto_host(engine_, std::as_writable_bytes(std::span(values))));
        return buffers_.back().mem();
    }

    Engine engine_;
    std::uint64_t count_;
    Combined result_;
    CombineOutput out_;
    std::vector<Buffer> buffers_;
    Buffer rows_;
};

std::string program_options(const Moments::State& s, const Reading& reading) {
    const std::string groups = s.groups.size() > 1 ? "-DCLR_MANY_GROUPS" : "";
    if (wants_more(reading.out)) return groups;
    const auto define = [](const char* name, std::uint32_t value) {
        return std::string(" -D") + name + "=" + std::to_string(value) + "u";
    };
    return groups + define("CLR_ESTIMATOR", static_cast<std::uint32_t>(reading.options.estimator)) +
           define("CLR_ASKED", reading.asked()) + define("CLR_STATE_OPTIONS", s.all_groups().options);
}

Event read_moments(const Moments& moments, Reading reading, std::span<const cl_event> waits) {
    auto& s = moments.state();
    if (wants_interval(reading.out) && s.options.nonfinite == NonFinite::skip)
        reading.quantiles = quantile_table(s, reading.options);
    Launch launch(s.engine, "combine", "clr_combine_moments", program_options(s, reading), Lanes::wide);
    s.give_planes(launch).arg(s.all_groups());
    s.last = reading.give(launch, s, s.batches()).after(waits).after(std::array{s.last.get()}).run_ranges(s.values);
    return s.last;
}

Event read_means(const Engine& engine, const View& m, const View& t, const View& tau, const CombineOutput& out,
                 cl_mem flag_rows, Zero zero, std::span<const cl_event> waits) {
    Launch launch(engine, "combine", "clr_combine", "", Lanes::wide);
    launch.view(m).view(t).view(tau).view(out.estimate).arg(out.flags).arg(flag_rows).arg(zero_policy(zero));
    return launch.after(waits).run_ranges(m.count);
}

/// Whether the pass that adds can read out as well.
bool fuses(const Moments::State& s, const Reading& reading) {
    return s.groups.size() == 1 && !wants_more(reading.out) &&
           static_cast<std::uint32_t>(reading.options.estimator) <= CLR_ESTIMATOR_MEAN_OF_RATIOS;
}

void check_stateless(const CombineOptions& options) {
    if (options.estimator != Estimator::ratio)
        throw InvalidArgument("estimator", "ratio, for means without a history", "another; add the batches to Moments");
    if (options.standard_error || options.bias || options.interval || options.gain || options.needed)
        throw InvalidArgument("standard_error", "only the estimate, for means without a history",
                              "more; add the batches to Moments");
}

void check_outputs(const CombineOutput& out) {
    if (out.standard_error.mem || wants_more(out))
        throw InvalidArgument("out", "only estimate and flags, for means without a history", "more");
}

}  // namespace

void check_estimator(const CombineOptions& options, const MomentsOptions& state) {
    const Needs needs = needs_of(options.estimator);
    const auto refuse = [&](const char* how) {
        throw InvalidArgument("estimator", "one whose planes the state has",
                              name_of(options.estimator) + ": make the Moments with " + how);
    };
    if (needs.ratios && !state.ratios) refuse(".ratios = true");
    if (needs.groups && state.groups < 2) refuse(".groups of 2 to 16");
    if (options.standard_error && options.estimator == Estimator::mean_of_ratios)
        throw InvalidArgument("standard_error", "an estimator that has one", "mean-of-ratios, which has none");
    if (!(options.level > 0 && options.level < 1))
        throw InvalidArgument("level", "a number in (0, 1)", std::to_string(options.level));
    if (!(options.target >= 0) || !(options.relative_target >= 0))
        throw InvalidArgument("target", "a finite number of at least 0",
                              std::to_string(options.target) + " and relative " + std::to_string(options.relative_target));
}

void Reading::check(std::uint64_t count) const {
    check_view("tau", tau, count);
    std::vector<std::pair<const char*, View>> outputs;
    const auto output = [&](const char* name, const View& v) {
        if (!v.mem) return;
        check_view(name, v, count);
        if (v.stride < v.channels)
            throw InvalidArgument(name, "a stride of at least its channels", std::to_string(v.stride));
        check_overlap(name, v, "tau", tau);
        for (const auto& [other_name, other] : outputs) check_overlap(name, v, other_name, other);
        outputs.emplace_back(name, v);
    };
    output("estimate", out.estimate);
    output("standard_error", out.standard_error);
    output("bias", out.bias);
    output("lower", out.lower);
    output("upper", out.upper);
    output("kind", words_view(out.kind, count));
    output("gain", out.gain);
    output("needed", out.needed);
    output("flags", words_view(out.flags, count));
}

std::uint32_t Reading::asked() const {
    const auto bit_if = [](bool wanted, std::uint32_t bit) { return wanted ? bit : 0u; };
    return bit_if(out.estimate.mem, CLR_WRITE_ESTIMATE) | bit_if(out.standard_error.mem, CLR_WRITE_ERROR) |
           bit_if(out.flags, CLR_WRITE_FLAGS) | bit_if(flag_rows, CLR_COUNT_FLAGS) | bit_if(out.bias.mem, CLR_WRITE_BIAS) |
           bit_if(out.lower.mem, CLR_WRITE_LOWER) | bit_if(out.upper.mem, CLR_WRITE_UPPER) |
           bit_if(out.kind, CLR_WRITE_KIND) | bit_if(out.gain.mem, CLR_WRITE_GAIN) |
           bit_if(out.needed.mem, CLR_WRITE_NEEDED);
}

Launch& Reading::give(Launch& launch, const Moments::State& state, std::uint64_t added) const {
    device::clr_reading r{};
    r.tau = layout(tau);
    r.estimate = layout(out.estimate);
    r.error = layout(out.standard_error);
    r.bias = layout(out.bias);
    r.lower = layout(out.lower);
    r.upper = layout(out.upper);
    r.gain = layout(out.gain);
    r.needed = layout(out.needed);
    r.ask.estimator = static_cast<std::uint32_t>(options.estimator);
    r.ask.zero_policy = zero_policy(options.zero);
    r.ask.interval = static_cast<std::uint32_t>(options.method);
    r.ask.outputs = asked();
    r.ask.counted = options.counted;
    r.ask.target = options.target;
    r.ask.relative_target = options.relative_target;
    r.ask.reliability = state.options.weights == Weights::reliability ? 1 : 0;
    r.added = static_cast<std::uint32_t>(added);
    if (wants_interval(out)) r.quantile = static_cast<float>(quantile_for(options, added));
    r.quantiles = static_cast<std::uint32_t>(quantiles.size() / sizeof(float));
    for (cl_mem m : {tau.mem, out.estimate.mem, out.standard_error.mem, out.bias.mem, out.lower.mem, out.upper.mem, out.kind,
                     out.gain.mem, out.needed.mem, out.flags, flag_rows, quantiles.mem()})
        launch.arg(m);
    return launch.arg(r);
}

cl_event combine(const Engine& engine, View m, View t, View tau, const CombineOutput& out, CombineOptions options,
                 std::span<const cl_event> wait_list) {
    check_stateless(options);
    check_outputs(out);
    check_view("m", m, m.count);
    check_view("t", t, m.count);
    Reading{tau, out, options}.check(m.count);
    check_overlap("estimate", out.estimate, "m", m);
    check_overlap("estimate", out.estimate, "t", t);
    return read_means(engine, m, t, tau, out, nullptr, options.zero, wait_list).give();
}

Combined combine(const Engine& engine, std::span<const float> m, std::span<const float> t, const Tau& tau,
                 CombineOptions options) {
    check_stateless(options);
    if (t.size() != m.size()) throw InvalidArgument("t", std::to_string(m.size()) + " values", std::to_string(t.size()));
    if (m.empty()) return {};
    const DeviceTau control = put(engine, tau, m.size());
    const Buffer mb = Buffer::from_host(engine, std::as_bytes(m)), tb = Buffer::from_host(engine, std::as_bytes(t));
    HostOutput out(engine, m.size(), options);
    wait(read_means(engine, {mb.mem(), 0, m.size()}, {tb.mem(), 0, m.size()}, control.view, out.output(), out.rows(),
                    options.zero, {}));
    return out.take();
}

cl_event combine(const Moments& moments, View tau, const CombineOutput& out, CombineOptions options,
                 std::span<const cl_event> wait_list) {
    check_estimator(options, moments.options());
    const Reading reading{tau, out, options};
    reading.check(moments.size());
    return read_moments(moments, reading, wait_list).give();
}

Combined combine(const Moments& moments, const Tau& tau, CombineOptions options, Combined reuse) {
    check_estimator(options, moments.options());
    const DeviceTau control = put(moments.engine(), tau, moments.size());
    HostOutput out(moments.engine(), moments.size(), options, std::move(reuse));
    wait(read_moments(moments, out.reading(control.view, options), {}));
    return out.take();
}

Combined add_and_combine(Moments& moments, std::span<const HostBatch> batches, const Tau& tau, CombineOptions options,
                         Combined reuse) {
    auto& s = moments.state();
    check_estimator(options, s.options);
    if (batches.empty()) throw InvalidArgument("batches", "at least 1", "0");
    const DeviceTau control = put(s.engine, tau, s.values);
    const OnDevice in = put_on_device(s, batches);
    HostOutput out(s.engine, s.values, options, std::move(reuse));
    const Reading reading = out.reading(control.view, options);
    const auto all = std::span<const Batch>(in.batches);
    if (fuses(s, reading)) {
        const std::size_t fused = std::min<std::size_t>(all.size(), CLR_BATCHES_PER_LAUNCH);
        add_batches(s, all.first(all.size() - fused), {});
        wait(add_to_group(s, 0, all.last(fused), &reading, {}));
    } else {
        add_batches(s, all, {});
        wait(read_moments(moments, reading, {}));
    }
    return out.take();
}

cl_event add_and_combine(Moments& moments, std::span<const Batch> batches, View tau, const CombineOutput& out,
                         CombineOptions options, std::span<const cl_event> wait_list) {
    auto& s = moments.state();
    check_estimator(options, s.options);
    if (batches.empty() || batches.size() > CLR_BATCHES_PER_LAUNCH)
        throw InvalidArgument("batches", "1 to " + std::to_string(CLR_BATCHES_PER_LAUNCH), std::to_string(batches.size()));
    check_batches(s, batches);
    check_room(s.batches(), batches.size());
    const Reading reading{tau, out, options};
    reading.check(s.values);
    if (fuses(s, reading)) return add_to_group(s, 0, batches, &reading, wait_list).give();
    add_batches(s, batches, wait_list);
    return read_moments(moments, reading, {}).give();
}

}  // namespace clratio
