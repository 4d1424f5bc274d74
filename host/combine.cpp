#include "clratio/combine.hpp"

#include <cmath>

#include "large.hpp"
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

/// The interval's quantile for a value of so many trials: batches, or the groups of a jackknife.
double quantile_for(const CombineOptions& options, std::uint64_t trials) {
    const std::uint64_t lost = regresses(options.estimator) && options.method == IntervalMethod::delta ? 2 : 1;
    return student_quantile(options.level, static_cast<double>(trials > lost ? trials - lost : 1));
}

constexpr std::uint64_t longest_table = 1024;

/// Where values may differ in their number of trials.
Buffer quantile_table(const Engine& engine, std::uint64_t most, const CombineOptions& options) {
    std::vector<float> table;
    for (std::uint64_t k = 0; k <= std::min(most, longest_table); ++k)
        table.push_back(static_cast<float>(quantile_for(options, k)));
    return Buffer::copy_of(engine, std::as_bytes(std::span(table)));
}

void check_size(const char* name, std::uint64_t size, std::uint64_t expected) {
    if (size != expected) throw InvalidArgument(name, std::to_string(expected) + " values", std::to_string(size));
}

void check_tau(const Tau& tau, std::uint64_t count) {
    if (tau.numbers.empty()) return check_size("tau", tau.image.size(), count);
    for (float x : tau.numbers)
        if (!std::isfinite(x)) throw InvalidArgument("tau", "a finite number", std::to_string(x));
    if (tau.channels != tau.numbers.size())
        throw InvalidArgument("tau", std::to_string(tau.channels) + " numbers, one for each channel",
                              std::to_string(tau.numbers.size()));
    if (count % tau.channels != 0)
        throw InvalidArgument("tau", "as many numbers as channels",
                              std::to_string(tau.channels) + " for " + std::to_string(count) + " values");
}

std::vector<HostBatch> slices(std::span<const HostBatch> batches, std::uint64_t begin, std::uint64_t size) {
    std::vector<HostBatch> out;
    for (const HostBatch& b : batches)
        out.push_back({b.m.subspan(begin, size), b.t.subspan(begin, size), b.weight, b.index});
    return out;
}

/// As many as one allocation holds; whole pixels.
std::uint64_t values_in_a_part(const Engine& engine, const Tau& tau) {
    const std::uint64_t channels = std::max<std::uint64_t>(1, tau.channels);
    const std::uint64_t most = std::max<std::uint64_t>(engine.info().largest_allocation / sizeof(float), channels);
    return most / channels * channels;
}

/// A result of `count` values, with what the options ask for; its memory is that of `reuse`.
Combined sized(std::uint64_t count, const CombineOptions& options, Combined reuse) {
    const auto size_if = [&](bool wanted, auto& values) { resize_large(values, wanted ? count : 0); };
    size_if(true, reuse.estimate);
    size_if(options.flag_image, reuse.flag_image);
    size_if(options.standard_error, reuse.standard_error);
    size_if(options.bias, reuse.bias);
    size_if(options.interval, reuse.lower);
    size_if(options.interval, reuse.upper);
    size_if(options.interval, reuse.kind);
    size_if(options.gain, reuse.gain);
    size_if(options.needed, reuse.needed);
    reuse.flags = {};
    reuse.negatives = 0;
    return reuse;
}

/// Device buffers on `count` values of tau and of a result from `begin` on. The estimate may lie in tau's own memory.
class HostReading {
public:
    HostReading(const Engine& engine, Combined& result, const Tau& tau, std::uint64_t begin, std::uint64_t count)
        : engine_(engine), begin_(begin), count_(count), result_(result), rows_(zeroed_rows<CLR_TALLY_FLAGS>(engine)) {
        const auto view = [&](std::vector<float>& values) { return View{place(values), 0, count}; };
        const bool over_tau = tau.image.data() == result.estimate.data();
        out_.estimate = {place(result.estimate, over_tau ? Buffer::over_host : Buffer::onto_host), 0, count};
        tau_ = over_tau ? out_.estimate : put(tau);
        out_.flags = place(result.flag_image);
        out_.standard_error = view(result.standard_error);
        out_.bias = view(result.bias);
        out_.lower = view(result.lower);
        out_.upper = view(result.upper);
        out_.kind = place(result.kind);
        out_.gain = view(result.gain);
        out_.needed = view(result.needed);
    }
    HostReading(const Engine& engine, Combined& result, const Tau& tau)
        : HostReading(engine, result, tau, 0, result.estimate.size()) {}

    const View& tau() const { return tau_; }
    const CombineOutput& output() const { return out_; }
    cl_mem rows() const { return rows_.mem(); }
    Reading reading(const CombineOptions& options) const { return {tau_, out_, options, rows_.mem()}; }

    /// Once the kernels are done.
    void publish() {
        for (const Buffer& b : buffers_) b.publish();
        const auto n = sums_of_rows<CLR_TALLY_FLAGS>(rows_);
        result_.flags += {n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8]};
    }

private:
    View put(const Tau& tau) {
        if (tau.numbers.empty()) {
            tau_memory_ = Buffer::from_host(engine_, std::as_bytes(tau.image.subspan(begin_, count_)));
            return {tau_memory_.mem(), 0, count_};
        }
        tau_memory_ = Buffer::copy_of(engine_, std::as_bytes(std::span(tau.numbers)));
        return {tau_memory_.mem(), 0, count_, 0, tau.channels};
    }

    template <class T> cl_mem place(std::vector<T>& values, decltype(Buffer::onto_host)& on = Buffer::onto_host) {
        if (values.empty()) return nullptr;
        buffers_.push_back(on(engine_, std::as_writable_bytes(std::span(values).subspan(begin_, count_))));
        return buffers_.back().mem();
    }

    Engine engine_;
    std::uint64_t begin_, count_;
    Combined& result_;
    View tau_;
    CombineOutput out_;
    std::vector<Buffer> buffers_;
    Buffer tau_memory_, rows_;
};

/// A program for everything where more than estimate, error and flags is asked: else there would be too many.
std::string program_options(const Moments::State& s, const Reading& reading) {
    const std::string groups = s.groups.size() > 1 ? "-DCLR_MANY_GROUPS" : "";
    return wants_more(reading.out) ? groups : groups + reading.program_options(s.options);
}

Event read_moments(const Moments& moments, Reading reading, std::span<const cl_event> waits) {
    auto& s = moments.state();
    const bool counts_groups =
        reading.options.estimator == Estimator::jackknife && reading.options.method == IntervalMethod::delta;
    if (wants_interval(reading.out) && (counts_groups || s.options.nonfinite == NonFinite::skip))
        reading.quantiles = quantile_table(s.engine, s.batches(), reading.options);
    Launch launch(s.engine, "combine", "clr_combine_moments", program_options(s, reading), Lanes::wide);
    s.give_planes(launch).arg(s.all_groups());
    s.last = reading.give(launch, s.options.weights, s.batches())
                 .after(waits)
                 .after(std::array{s.last.get()})
                 .run_ranges(s.values);
    return s.last;
}

Event read_means(const Engine& engine, const View& m, const View& t, const View& tau, const CombineOutput& out,
                 cl_mem flag_rows, Zero zero, std::span<const cl_event> waits) {
    Launch launch(engine, "combine", "clr_combine", "", Lanes::wide);
    launch.view(m).view(t).view(tau).view(out.estimate).arg(out.flags).arg(flag_rows).arg(zero_policy(zero));
    return launch.after(waits).run_ranges(m.count);
}

/// The batches are all there are: no state is read or kept. `rows`: CLR_TALLY_ADD counters for each work-item.
Event read_batches(const Engine& engine, std::span<const Batch> batches, const MomentsOptions& state, Reading reading,
                   const Buffer& rows, std::span<const cl_event> waits) {
    if (wants_interval(reading.out) && state.nonfinite == NonFinite::skip)
        reading.quantiles = quantile_table(engine, batches.size(), reading.options);
    Launch launch(engine, "moments", "clr_combine_batches", "-DCLR_STATELESS" + reading.program_options(state), Lanes::wide);
    Moments::State::Group group;
    give_batches(launch, batches, group).arg(rows);
    return reading.give(launch, state.weights, batches.size()).after(waits).run_ranges(batches.front().m.count);
}

/// The state that these batches would be added to.
MomentsOptions state_for(const CombineOptions& options, const BatchOptions& batches) {
    const Needs needs = needs_of(options.estimator);
    if (needs.groups)
        throw InvalidArgument("estimator",
                              "one that needs no groups of batches; add these to Moments with .groups of 2 to 16",
                              name_of(options.estimator));
    return {.nonfinite = batches.nonfinite, .ratios = needs.ratios, .weights = batches.weights};
}

std::vector<std::pair<const char*, View>> views_of(std::span<const Batch> batches) {
    std::vector<std::pair<const char*, View>> all;
    for (const Batch& b : batches) all.insert(all.end(), {{"m", b.m}, {"t", b.t}});
    return all;
}

/// Whether the pass that adds can read out as well.
bool fuses(const Moments::State& s, const Reading& reading) {
    return s.groups.size() == 1 && !wants_more(reading.out) &&
           static_cast<std::uint32_t>(reading.options.estimator) <= CLR_ESTIMATOR_MEAN_OF_RATIOS;
}

void check_zero(Zero zero) {
    if (zero > Zero::one) throw InvalidArgument("zero", "a policy of Zero", std::to_string(static_cast<int>(zero)));
}

void check_stateless(const CombineOptions& options) {
    check_zero(options.zero);
    if (options.estimator != Estimator::ratio)
        throw InvalidArgument("estimator", "ratio, for means without a history", "another; add the batches to Moments");
    if (options.standard_error || options.bias || options.interval || options.gain || options.needed)
        throw InvalidArgument("standard_error", "only the estimate, for means without a history",
                              "more; add the batches to Moments");
}

void check_one_launch(std::size_t batches) {
    if (batches == 0 || batches > CLR_BATCHES_PER_LAUNCH)
        throw InvalidArgument("batches", "1 to " + std::to_string(CLR_BATCHES_PER_LAUNCH), std::to_string(batches));
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
    check_zero(options.zero);
    if (options.method > IntervalMethod::fieller)
        throw InvalidArgument("method", "one of IntervalMethod", std::to_string(static_cast<std::uint32_t>(options.method)));
    if (!(options.level > 0 && options.level < 1))
        throw InvalidArgument("level", "a number in (0, 1)", std::to_string(options.level));
    const auto is_target = [](float x) { return x >= 0 && std::isfinite(x); };
    if (!is_target(options.target) || !is_target(options.relative_target))
        throw InvalidArgument("target", "a finite number of at least 0",
                              std::to_string(options.target) + " and relative " + std::to_string(options.relative_target));
}

void Reading::check(std::uint64_t count, std::span<const std::pair<const char*, View>> inputs) const {
    check_view("tau", tau, count);
    std::vector<std::pair<const char*, View>> read(inputs.begin(), inputs.end()), written;
    read.emplace_back("tau", tau);
    const auto output = [&](const char* name, const View& v) {
        if (!v.mem) return;
        check_output(name, v, count);
        for (const auto& [other_name, other] : read) check_overlap(name, v, other_name, other);
        for (const auto& [other_name, other] : written) check_apart(name, v, other_name, other);
        written.emplace_back(name, v);
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

std::string Reading::program_options(const MomentsOptions& state) const {
    const auto define = [](const char* name, std::uint32_t value) {
        return std::string(" -D") + name + "=" + std::to_string(value) + "u";
    };
    return define("CLR_ESTIMATOR", static_cast<std::uint32_t>(options.estimator)) + define("CLR_ASKED", asked()) +
           define("CLR_STATE_OPTIONS", state_options(state));
}

Launch& Reading::give(Launch& launch, Weights weights, std::uint64_t added) const {
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
    r.ask.reliability = weights == Weights::reliability ? 1 : 0;
    r.added = static_cast<std::uint32_t>(added);
    if (wants_interval(out)) r.quantile = static_cast<float>(quantile_for(options, added));
    r.quantiles = static_cast<std::uint32_t>(quantiles.size() / sizeof(float));
    for (cl_mem m : {tau.mem, out.estimate.mem, out.standard_error.mem, out.bias.mem, out.lower.mem, out.upper.mem, out.kind,
                     out.gain.mem, out.needed.mem, out.flags, flag_rows, quantiles.mem()})
        launch.arg(m);
    return launch.arg(r);
}

FlagCounts& FlagCounts::operator+=(const FlagCounts& more) {
    zero_denominator += more.zero_denominator;
    zero_tau += more.zero_tau;
    skipped += more.skipped;
    no_data += more.no_data;
    no_error_bar += more.no_error_bar;
    nonfinite += more.nonfinite;
    fell_back += more.fell_back;
    no_spread += more.no_spread;
    any += more.any;
    return *this;
}

cl_event combine(const Engine& engine, View m, View t, View tau, const CombineOutput& out, CombineOptions options,
                 std::span<const cl_event> wait_list) {
    check_stateless(options);
    check_outputs(out);
    check_view("m", m, m.count);
    check_view("t", t, m.count);
    Reading{tau, out, options}.check(m.count, std::array{std::pair{"m", m}, std::pair{"t", t}});
    return read_means(engine, m, t, tau, out, nullptr, options.zero, wait_list).give();
}

Combined combine(const Engine& engine, std::span<const float> m, std::span<const float> t, const Tau& tau,
                 CombineOptions options) {
    check_stateless(options);
    if (t.size() != m.size()) throw InvalidArgument("t", std::to_string(m.size()) + " values", std::to_string(t.size()));
    if (m.empty()) return {};
    check_tau(tau, m.size());
    const Buffer mb = Buffer::from_host(engine, std::as_bytes(m)), tb = Buffer::from_host(engine, std::as_bytes(t));
    Combined result = sized(m.size(), options, {});
    HostReading out(engine, result, tau);
    wait(read_means(engine, {mb.mem(), 0, m.size()}, {tb.mem(), 0, m.size()}, out.tau(), out.output(), out.rows(),
                    options.zero, {}));
    out.publish();
    return result;
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
    check_tau(tau, moments.size());
    Combined result = sized(moments.size(), options, std::move(reuse));
    HostReading out(moments.engine(), result, tau);
    wait(read_moments(moments, out.reading(options), {}));
    out.publish();
    return result;
}

Combined add_and_combine(Moments& moments, std::span<const HostBatch> batches, const Tau& tau, CombineOptions options,
                         Combined reuse) {
    auto& s = moments.state();
    check_estimator(options, s.options);
    if (batches.empty()) throw InvalidArgument("batches", "at least 1", "0");
    check_tau(tau, s.values);
    const OnDevice in = put_on_device(s.engine, s.values, s.options.nonfinite, batches);
    check_room(s, batches.size(), sum_of_squares(batches));
    Combined result = sized(s.values, options, std::move(reuse));
    HostReading out(s.engine, result, tau);
    const Reading reading = out.reading(options);
    const auto all = std::span<const Batch>(in.batches);
    const Joined joined(s.last);
    if (fuses(s, reading)) {
        const std::size_t fused = std::min<std::size_t>(all.size(), CLR_BATCHES_PER_LAUNCH);
        add_batches(s, all.first(all.size() - fused), {});
        wait(add_to_group(s, 0, all.last(fused), &reading, {}));
    } else {
        add_batches(s, all, {});
        wait(read_moments(moments, reading, {}));
    }
    out.publish();
    return result;
}

cl_event add_and_combine(Moments& moments, std::span<const Batch> batches, View tau, const CombineOutput& out,
                         CombineOptions options, std::span<const cl_event> wait_list) {
    auto& s = moments.state();
    check_estimator(options, s.options);
    check_one_launch(batches.size());
    check_batches(s.values, s.options.nonfinite, batches);
    check_room(s, batches.size(), sum_of_squares(batches));
    const Reading reading{tau, out, options};
    reading.check(s.values);
    if (fuses(s, reading)) return add_to_group(s, 0, batches, &reading, wait_list).give();
    add_batches(s, batches, wait_list);
    return read_moments(moments, reading, {}).give();
}

cl_event combine_batches(const Engine& engine, std::span<const Batch> batches, View tau, const CombineOutput& out,
                         CombineOptions options, BatchOptions how, std::span<const cl_event> wait_list) {
    check_one_launch(batches.size());
    const MomentsOptions state = state_for(options, how);
    check_estimator(options, state);
    const std::uint64_t count = batches.front().m.count;
    check_batches(count, state.nonfinite, batches);
    const Reading reading{tau, out, options};
    reading.check(count, views_of(batches));
    return read_batches(engine, batches, state, reading, zeroed_rows<CLR_TALLY_ADD>(engine), wait_list).give();
}

Combined combine_batches(const Engine& engine, std::span<const HostBatch> batches, const Tau& tau, CombineOptions options,
                         BatchOptions how, Combined reuse) {
    check_one_launch(batches.size());
    const MomentsOptions state = state_for(options, how);
    check_estimator(options, state);
    const std::uint64_t count = batches.front().m.size();
    for (const HostBatch& b : batches) {
        check_size("m", b.m.size(), count);
        check_size("t", b.t.size(), count);
    }
    check_tau(tau, count);
    Combined result = sized(count, options, std::move(reuse));
    const std::uint64_t most = values_in_a_part(engine, tau);
    for (std::uint64_t begin = 0; begin < count; begin += most) {
        const std::uint64_t size = std::min(most, count - begin);
        const OnDevice in = put_on_device(engine, size, state.nonfinite, slices(batches, begin, size));
        HostReading out(engine, result, tau, begin, size);
        const Buffer rows = zeroed_rows<CLR_TALLY_ADD>(engine);
        wait(read_batches(engine, in.batches, state, out.reading(options), rows, {}));
        out.publish();
        result.negatives += sums_of_rows<CLR_TALLY_ADD>(rows)[CLR_TALLY_NEGATIVE];
    }
    return result;
}

}  // namespace clratio
