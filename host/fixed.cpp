#include "clratio/fixed.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>

#include "clratio/device/fixed.h"
#include "clratio/snapshot.hpp"
#include "moments_state.hpp"
#include "settings.hpp"

namespace clratio {

struct FixedMoments::State {
    State(const Engine& e, std::uint64_t count, FixedOptions o) : engine(e), values(count), options(o) {}

    Engine engine;
    std::uint64_t values;
    FixedOptions options;
    std::uint64_t batches = 0, weight = 0;
    std::vector<Buffer> memory;
    FixedPlanes planes;
    Buffer rows;  ///< CLR_FIXED_TALLY counters for each work-item
    Event last;   ///< the last launch that touched the planes

    device::clr_fixed_state header() const;
    Launch& give_planes(Launch& launch) const;
};

namespace {

using Plane = cl_mem FixedPlanes::*;
using State = FixedMoments::State;
using Counts = std::array<std::uint64_t, CLR_FIXED_TALLY>;

float power(int exponent) { return std::ldexp(1.0f, exponent); }

struct Shape {
    const char* name;
    Plane plane;
    std::uint64_t limbs, bytes;  ///< of a value, and of a limb
};

std::vector<Shape> shapes_of(FixedOptions o) {
    using P = FixedPlanes;
    std::vector<Shape> all{
        {"m", &P::m, 1, 8}, {"t", &P::t, 1, 8}, {"mm", &P::mm, 2, 8}, {"tt", &P::tt, 2, 8}, {"mt", &P::mt, 2, 8}};
    if (o.nonfinite == NonFinite::skip)
        all.insert(all.end(), {{"weight", &P::weight, 1, 8}, {"batches", &P::batches, 1, 4}});
    return all;
}

std::uint64_t bytes_of(const Shape& shape, std::uint64_t values) {
    return Moments::plane_stride(values) * shape.limbs * shape.bytes;
}

std::string bits_between(int least) {
    return std::to_string(least) + " to " + std::to_string(FixedOptions::most_bits) + " bits";
}

void check_bits(const char* name, int bits) {
    if (bits < 0 || bits > FixedOptions::most_bits) throw InvalidArgument(name, bits_between(0), std::to_string(bits));
}

void check_options(FixedOptions o) {
    if (o.nonfinite == NonFinite::propagate)
        throw InvalidArgument("nonfinite", "skip or fail, for a state of whole numbers", "propagate");
    check_bits("resolution", o.resolution);
    check_bits("range", o.range);
    const int bits = o.resolution + o.range;
    if (bits < FixedOptions::least_bits || bits > FixedOptions::most_bits)
        throw InvalidArgument("resolution + range", bits_between(FixedOptions::least_bits), std::to_string(bits));
}

std::uint64_t whole_weight(double weight) {
    if (!(weight >= 1) || weight >= 0x1p63 || weight != std::floor(weight))
        throw InvalidArgument("weight", "a whole sample count from 1 on", std::to_string(weight));
    return static_cast<std::uint64_t>(weight);
}

void check_room(const State& s, std::uint64_t batches, std::uint64_t weight) {
    constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max();
    if (batches > most - s.batches)
        throw InvalidArgument("batches", "at most 2^32 - 1 in one state", std::to_string(s.batches + batches));
    if (weight > s.options.most_weight() - s.weight)
        throw InvalidArgument("weight",
                              "a sum of at most " + std::to_string(s.options.most_weight()) +
                                  ", up to which no sum of values within 2^" + std::to_string(s.options.range) +
                                  " overflows",
                              std::to_string(s.weight) + " + " + std::to_string(weight));
}

/// Checks weights and room; one batch after the other, so that no sum of weights wraps.
template <class Batches> void check_weights(const State& s, const Batches& batches) {
    std::uint64_t sum = 0;
    for (const auto& b : batches) {
        const std::uint64_t weight = whole_weight(b.weight);
        check_room(s, 0, weight);
        sum += weight;
        check_room(s, batches.size(), sum);
    }
}

void refuse_what_does_not_fit(const State& s, std::span<const Batch> batches) {
    for (std::size_t k = 0; k < batches.size(); ++k) {
        const Buffer rows = zeroed_rows<CLR_FIXED_TALLY>(s.engine);
        Launch launch(s.engine, "fixed", "clr_scan_fixed");
        launch.view(batches[k].m).view(batches[k].t).arg(power(s.options.range)).arg(rows);
        wait(launch.run_ranges(s.values));
        const Counts found = sums_of_rows<CLR_FIXED_TALLY>(rows);
        const std::string which = "batch " + std::to_string(k);
        if (const auto bad = found[CLR_FIXED_TALLY_SKIPPED] - found[CLR_FIXED_TALLY_OUTSIDE])
            throw InvalidArgument(which, "finite values", std::to_string(bad) + " NaN or infinite ones");
        if (const auto bad = found[CLR_FIXED_TALLY_OUTSIDE])
            throw InvalidArgument(which, "magnitudes up to 2^" + std::to_string(s.options.range),
                                  std::to_string(bad) + " larger ones");
    }
}

/// 1 to 8 batches of one weight in one launch.
Event add_some(State& s, std::span<const Batch> batches, std::span<const cl_event> waits) {
    device::clr_fixed_batches table{};
    table.weight = whole_weight(batches.front().weight);
    table.count = batches.size();
    Launch launch(s.engine, "fixed", "clr_add_fixed");
    for (std::size_t k = 0; k < CLR_FIXED_BATCHES_PER_LAUNCH; ++k) {
        const Batch& b = batches[std::min(k, batches.size() - 1)];
        launch.arg(b.m.mem).arg(b.t.mem);
        table.of[k] = {layout(b.m), layout(b.t)};
    }
    s.give_planes(launch.arg(table)).arg(s.rows);
    s.last = launch.after(waits).after(std::array{s.last.get()}).run_ranges(s.values);
    s.batches += table.count;
    s.weight += table.count * table.weight;
    return s.last;
}

/// Order does not show in the sums, so batches of one weight go together.
Event add_all(State& s, std::vector<Batch> batches, std::span<const cl_event> waits) {
    std::sort(batches.begin(), batches.end(), [](const Batch& a, const Batch& b) { return a.weight < b.weight; });
    Event done;
    for (auto first = batches.begin(); first != batches.end();) {
        const auto most = std::min<std::ptrdiff_t>(CLR_FIXED_BATCHES_PER_LAUNCH, batches.end() - first);
        const auto end = std::find_if(first, first + most, [&](const Batch& b) { return b.weight != first->weight; });
        done = add_some(s, {first, end}, waits);
        first = end;
    }
    return done;
}

std::uint64_t tally(const State& s, std::size_t which) {
    wait(s.last);
    return sums_of_rows<CLR_FIXED_TALLY>(s.rows)[which];
}

// ---- snapshots

Settings settings_of(FixedOptions o) {
    return {{"nonfinite", o.nonfinite == NonFinite::skip ? "skip" : "fail"},
            {"resolution", std::to_string(o.resolution)},
            {"range", std::to_string(o.range)}};
}

int number(const std::string& text) {
    int n = -1;
    std::from_chars(text.data(), text.data() + text.size(), n);
    return n;
}

std::uint64_t words_of(const Shape& shape) { return shape.limbs * shape.bytes / sizeof(std::uint32_t); }

std::string word_name(const Shape& shape, std::uint64_t word) {
    return words_of(shape) == 1 ? shape.name : std::string(shape.name) + "." + std::to_string(word);
}

std::uint64_t weight_of(const Snapshot& snapshot, FixedOptions o) {
    if (snapshot.groups.size() != 1) throw InvalidArgument("snapshot", "1 group", std::to_string(snapshot.groups.size()));
    const auto& group = snapshot.groups.front();
    const double weight = group.weight + group.weight_low;
    const auto most = static_cast<double>(o.most_weight());
    if (!(weight >= static_cast<double>(group.batches)) || weight > most || weight != std::floor(weight))
        throw InvalidArgument("snapshot", "a whole weight from its batches up to " + std::to_string(o.most_weight()),
                              std::to_string(weight));
    return static_cast<std::uint64_t>(weight);
}

/// The words of the shape's planes, as they lie on the device: limb by limb, padded with zeros.
std::vector<std::uint32_t> device_words(const Shape& shape, const Snapshot& snapshot, std::size_t first_plane) {
    const std::uint64_t stride = Moments::plane_stride(snapshot.values), in_limb = words_of(shape) / shape.limbs;
    std::vector<std::uint32_t> all(stride * words_of(shape));
    for (std::uint64_t k = 0; k < words_of(shape); ++k) {
        const auto& plane = snapshot.planes[first_plane + k];
        if (plane.name != word_name(shape, k)) throw InvalidArgument("snapshot", "plane " + word_name(shape, k), plane.name);
        if (plane.words.size() != snapshot.values)
            throw InvalidArgument("snapshot plane " + plane.name, std::to_string(snapshot.values) + " values",
                                  std::to_string(plane.words.size()));
        for (std::uint64_t i = 0; i < snapshot.values; ++i)
            all[(k / in_limb * stride + i) * in_limb + k % in_limb] = plane.words[i];
    }
    return all;
}

void check_target(const State& s, const Moments& into) {
    if (into.size() != s.values)
        throw InvalidArgument("moments", std::to_string(s.values) + " values", std::to_string(into.size()));
    if (&into.engine().state() != &s.engine.state())
        throw InvalidArgument("moments", "a state on the same Engine", "another's");
    if (into.options() != MomentsOptions{.nonfinite = s.options.nonfinite})
        throw InvalidArgument("moments", "the fixed state's nonfinite policy, no ratios, one group, sample counts",
                              "other options");
}

}  // namespace

FixedOptions fixed_options(const Snapshot& snapshot) {
    if (snapshot.kind != "fixed") throw InvalidArgument("snapshot", "kind fixed", snapshot.kind);
    FixedOptions o;
    for (const auto& [name, value] : snapshot.settings) {
        if (name == "nonfinite" && value == "fail") o.nonfinite = NonFinite::fail;
        if (name == "resolution") o.resolution = number(value);
        if (name == "range") o.range = number(value);
    }
    if (settings_of(o) != snapshot.settings)
        throw InvalidArgument("snapshot", "settings of a fixed state, as " + text_of(settings_of({})),
                              text_of(snapshot.settings));
    return o;
}

device::clr_fixed_state State::header() const {
    return {power(options.resolution),
            power(options.range),
            static_cast<std::uint32_t>(options.resolution),
            options.nonfinite == NonFinite::skip,
            Moments::plane_stride(values),
            weight,
            static_cast<std::uint32_t>(batches),
            0};
}

Launch& State::give_planes(Launch& launch) const {
    for (cl_mem p : {planes.m, planes.t, planes.mm, planes.tt, planes.mt, planes.weight, planes.batches}) launch.arg(p);
    return launch.arg(header());
}

FixedMoments::FixedMoments(const Engine& engine, std::uint64_t values, FixedOptions options) {
    check_options(options);
    check_values(values);
    state_ = std::make_shared<State>(engine, values, options);
    state_->rows = zeroed_rows<CLR_FIXED_TALLY>(engine);
    for (const Shape& shape : shapes_of(options)) {
        state_->memory.emplace_back(engine, bytes_of(shape, values));
        state_->planes.*shape.plane = state_->memory.back().mem();
    }
}

std::uint64_t FixedMoments::state_bytes(std::uint64_t values, FixedOptions options) {
    std::uint64_t sum = 0;
    for (const Shape& shape : shapes_of(options)) sum += bytes_of(shape, values);
    return sum;
}

void FixedMoments::add(std::span<const float> m, std::span<const float> t, double weight) {
    const HostBatch batch{m, t, weight};
    add(std::span(&batch, 1));
}

void FixedMoments::add(std::span<const HostBatch> batches) {
    State& s = *state_;
    check_weights(s, batches);
    std::vector<Buffer> memory;
    const auto put = [&](const char* name, std::span<const float> values) -> View {
        if (values.size() != s.values)
            throw InvalidArgument(name, std::to_string(s.values) + " values", std::to_string(values.size()));
        memory.push_back(Buffer::from_host(s.engine, std::as_bytes(values)));
        return {memory.back().mem(), 0, s.values};
    };
    std::vector<Batch> views;
    for (const auto& b : batches) {
        const View m = put("m", b.m), t = put("t", b.t);
        views.push_back({m, t, b.weight});
    }
    if (s.options.nonfinite == NonFinite::fail) refuse_what_does_not_fit(s, views);
    const Joined joined(s.last);
    wait(add_all(s, std::move(views), {}));
}

cl_event FixedMoments::add(std::span<const Batch> batches, std::span<const cl_event> wait_list) {
    State& s = *state_;
    if (batches.empty()) throw InvalidArgument("batches", "at least one", "none");
    if (s.options.nonfinite == NonFinite::fail)
        throw InvalidArgument("NonFinite::fail", "a blocking add, which can look at the batch first", "the event form");
    check_weights(s, batches);
    for (const auto& b : batches) {
        check_view("m", b.m, s.values);
        check_view("t", b.t, s.values);
    }
    return add_all(s, {batches.begin(), batches.end()}, wait_list).give();
}

cl_event FixedMoments::merge(const FixedMoments& other, std::span<const cl_event> wait_list) {
    State &a = *state_, &b = *other.state_;
    if (a.values != b.values) throw InvalidArgument("merge", std::to_string(a.values) + " values", std::to_string(b.values));
    if (&a.engine.state() != &b.engine.state()) throw InvalidArgument("merge", "a state on the same Engine", "another's");
    if (settings_of(a.options) != settings_of(b.options))
        throw InvalidArgument("merge", text_of(settings_of(a.options)), text_of(settings_of(b.options)));
    check_room(a, b.batches, b.weight);
    Launch launch(a.engine, "fixed", "clr_merge_fixed");
    b.give_planes(a.give_planes(launch)).arg(a.rows).arg(b.rows).arg(a.rows.size() / sizeof(std::uint64_t));
    a.last = launch.after(wait_list).after(std::array{a.last.get(), b.last.get()}).run_ranges(a.values);
    b.last = a.last;
    a.batches += b.batches;
    a.weight += b.weight;
    return Event(a.last).give();
}

void FixedMoments::merge(const FixedMoments& other) { wait(Event(merge(other, {}))); }

void FixedMoments::clear() {
    State& s = *state_;
    wait_quietly(s.last);
    s.last = {};
    s.rows.write(std::vector<std::byte>(s.rows.size()));
    s.batches = s.weight = 0;
}

cl_event FixedMoments::moments(Moments& into, std::span<const cl_event> wait_list) const {
    State& s = *state_;
    check_target(s, into);
    Moments::State& to = into.state();
    Launch launch(s.engine, "fixed", "clr_read_fixed");
    s.give_planes(launch).arg(s.rows);
    to.give_planes(launch).arg(to.state_of(0)).arg(to.add_rows).arg(most_work_items(s.engine));
    s.last = launch.after(wait_list).after(std::array{s.last.get(), to.last.get()}).run_ranges(s.values);
    to.last = s.last;
    to.groups.front() = {s.batches, device::clr_fixed_weight(s.weight)};
    return Event(s.last).give();
}

Moments FixedMoments::moments() const {
    Moments out(engine(), size(), {.nonfinite = options().nonfinite});
    wait(Event(moments(out, {})));
    return out;
}

std::uint64_t FixedMoments::size() const { return state_->values; }
std::uint64_t FixedMoments::batches() const { return state_->batches; }
std::uint64_t FixedMoments::weight() const { return state_->weight; }
FixedOptions FixedMoments::options() const { return state_->options; }
const Engine& FixedMoments::engine() const { return state_->engine; }
FixedPlanes FixedMoments::planes() const { return state_->planes; }
std::uint64_t FixedMoments::negatives() const { return tally(*state_, CLR_FIXED_TALLY_NEGATIVE); }
std::uint64_t FixedMoments::skipped() const { return tally(*state_, CLR_FIXED_TALLY_SKIPPED); }
std::uint64_t FixedMoments::outside() const { return tally(*state_, CLR_FIXED_TALLY_OUTSIDE); }

std::vector<std::uint64_t> FixedMoments::limbs(Plane plane) const {
    const State& s = *state_;
    const auto shapes = shapes_of(s.options);
    const auto shape = std::find_if(shapes.begin(), shapes.end(), [&](const Shape& x) { return x.plane == plane; });
    if (shape == shapes.end()) return {};
    std::vector<std::uint64_t> out(shape->limbs * s.values);
    if (s.batches == 0) return out;
    wait(s.last);
    const auto read = [&](void* to, std::uint64_t limb) {
        check(clEnqueueReadBuffer(s.engine.queue(), s.planes.*plane, CL_TRUE,
                                  limb * Moments::plane_stride(s.values) * shape->bytes, s.values * shape->bytes, to, 0,
                                  nullptr, nullptr),
              "clEnqueueReadBuffer");
    };
    if (shape->bytes == 4) {
        std::vector<std::uint32_t> words(s.values);
        read(words.data(), 0);
        out.assign(words.begin(), words.end());
        return out;
    }
    for (std::uint64_t limb = 0; limb < shape->limbs; ++limb) read(out.data() + limb * s.values, limb);
    return out;
}

Snapshot FixedMoments::snapshot() const {
    const State& s = *state_;
    Snapshot out{"fixed", s.values, settings_of(s.options), {}, negatives(), skipped(), {}};
    const auto weight = device::clr_fixed_weight(s.weight);
    out.groups.push_back({s.batches, weight.hi, weight.lo});
    for (const Shape& shape : shapes_of(s.options)) {
        const auto numbers = limbs(shape.plane);
        for (std::uint64_t k = 0; k < words_of(shape); ++k) {
            auto& words = out.planes.emplace_back(Snapshot::Plane{word_name(shape, k), {}}).words;
            const auto* limb = numbers.data() + k / 2 * s.values;
            for (std::uint64_t i = 0; i < s.values; ++i)
                words.push_back(static_cast<std::uint32_t>(limb[i] >> (k % 2 * 32)));
        }
    }
    return out;
}

FixedMoments::FixedMoments(const Engine& engine, const Snapshot& snapshot)
    : FixedMoments(engine, snapshot.values, fixed_options(snapshot)) {
    State& s = *state_;
    s.weight = weight_of(snapshot, s.options);
    s.batches = snapshot.groups.front().batches;
    clratio::check_room(0, s.batches);
    const auto shapes = shapes_of(s.options);
    std::size_t planes = 0;
    for (const Shape& shape : shapes) planes += words_of(shape);
    if (snapshot.planes.size() != planes)
        throw InvalidArgument("snapshot", std::to_string(planes) + " planes", std::to_string(snapshot.planes.size()));
    planes = 0;
    for (std::size_t i = 0; i < shapes.size(); ++i) {
        const auto words = device_words(shapes[i], snapshot, planes);
        s.memory[i].write(std::as_bytes(std::span(words)));
        planes += words_of(shapes[i]);
    }
    Counts counts{};
    counts[CLR_FIXED_TALLY_NEGATIVE] = snapshot.negatives;
    counts[CLR_FIXED_TALLY_SKIPPED] = snapshot.skipped;
    s.rows.write(std::as_bytes(std::span(counts)));
}

}  // namespace clratio
