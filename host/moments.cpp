#include "clratio/moments.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "moments_state.hpp"

namespace clratio {
namespace {

using device::clr_two;

static_assert(most_groups == CLR_MOST_GROUPS);

clr_two two_float(double x) {
    const auto hi = static_cast<float>(x);
    return {hi, static_cast<float>(x - static_cast<double>(hi))};
}

using Group = Moments::State::Group;

/// How `more`, a batch or a whole state, enters a group.
device::clr_batch describe(const View& m, const View& t, const Group& before, const Group& more) {
    const clr_two sum = device::clr_two_add(before.weight, more.weight);
    const clr_two sum2 = device::clr_two_add(before.weight2, more.weight2);
    const auto e = device::clr_entry_make(before.weight, more.weight, sum);
    return {layout(m), layout(t), more.weight.hi, more.weight.lo, e.share.hi, e.share.lo,
            e.spread,  sum.hi,    sum.lo,         sum2.hi,        sum2.lo};
}

Group group_of(const Batch& b) {
    const clr_two weight = two_float(b.weight);
    return {1, weight, device::clr_two_square(weight)};
}

Group grown(const Group& before, const device::clr_batch& entry, std::uint64_t batches) {
    return {before.batches + batches, {entry.sum_hi, entry.sum_lo}, {entry.sum2_hi, entry.sum2_lo}};
}

bool packed(const View& v) { return v.stride == v.channels; }

void check_weight(double weight) {
    if (weight >= least_weight && weight <= most_weight) return;
    std::ostringstream got;
    got << weight;
    throw InvalidArgument("weight", "a sample count from 2^-60 to 2^60", got.str());
}

std::uint64_t count_nonfinite(const Engine& engine, const View& m, const View& t) {
    const Buffer rows = zeroed_rows<1>(engine);
    wait(Launch(engine, "moments", "clr_scan").view(m).view(t).arg(rows).run_ranges(m.count));
    return sums_of_rows<1>(rows)[0];
}

void refuse_nonfinite(const Engine& engine, std::span<const Batch> batches) {
    for (std::size_t k = 0; k < batches.size(); ++k)
        if (const auto bad = count_nonfinite(engine, batches[k].m, batches[k].t))
            throw InvalidArgument("batch " + std::to_string(k), "finite values",
                                  std::to_string(bad) + " NaN or infinite ones");
}

/// Of m or t, where there are several.
std::string name_in(const char* name, std::size_t batch, std::size_t batches) {
    return batches == 1 ? name : std::string(name) + " of batch " + std::to_string(batch);
}

std::uint64_t tally(const Moments::State& s, std::size_t which) {
    wait(s.last);
    return sums_of_rows<CLR_TALLY_ADD>(s.add_rows)[which];
}

std::vector<cl_mem StatePlanes::*> planes_of(MomentsOptions o) {
    using P = StatePlanes;
    std::vector<cl_mem P::*> all{&P::m, &P::t, &P::mm, &P::tt, &P::mt};
    if (o.nonfinite == NonFinite::skip) all.insert(all.end(), {&P::weight, &P::batches});
    if (o.nonfinite == NonFinite::skip && o.weights == Weights::reliability) all.push_back(&P::weight2);
    if (o.ratios) all.insert(all.end(), {&P::quotient, &P::zero_m, &P::zero_share});
    return all;
}

std::uint64_t bytes_of(cl_mem StatePlanes::*plane, std::uint64_t values, const MomentsOptions& o) {
    return o.groups * Moments::plane_bytes(values) / (plane == &StatePlanes::batches ? 2 : 1);
}

std::shared_ptr<Moments::State> make_state(const Engine& engine, std::uint64_t values, MomentsOptions options) {
    check_values(values);
    if (options.groups < 1 || options.groups > CLR_MOST_GROUPS)
        throw InvalidArgument("groups", "1 to " + std::to_string(CLR_MOST_GROUPS), std::to_string(options.groups));
    auto s = std::make_shared<Moments::State>(engine, values, options);
    s->add_rows = zeroed_rows<CLR_TALLY_ADD>(engine);
    return s;
}

/// What the kernel would work out for each vector.
void describe_members(device::clr_groups& all) {
    using namespace device;
    const auto weight_of = [&](std::uint32_t g) { return clr_two{all.of[g].weight_hi, all.of[g].weight_lo}; };
    clr_two sum = weight_of(0);
    for (std::uint32_t g = 1; g < all.count; ++g) sum = clr_two_add(sum, weight_of(g));
    const clr_whole whole = clr_whole_of(sum);
    for (std::uint32_t g = 0; g < all.count; ++g) {
        const clr_part part = clr_part_of(weight_of(g), whole);
        all.member[g] = {part.p.hi, part.p.lo, part.a, part.apart};
    }
}

}  // namespace

std::uint64_t Moments::State::batches() const {
    std::uint64_t sum = 0;
    for (const Group& g : groups) sum += g.batches;
    return sum;
}

std::uint32_t state_options(const MomentsOptions& o) {
    return (o.nonfinite == NonFinite::skip ? CLR_STATE_PER_VALUE : 0u) | (o.ratios ? CLR_STATE_RATIOS : 0u) |
           (o.weights == Weights::reliability ? CLR_STATE_RELIABILITY : 0u);
}

device::clr_groups Moments::State::all_groups() const {
    device::clr_groups all{};
    all.options = state_options(options);
    all.count = options.groups;
    for (std::size_t g = 0; g < groups.size(); ++g)
        all.of[g] = {static_cast<std::uint32_t>(groups[g].batches), groups[g].weight.hi, groups[g].weight.lo,
                     groups[g].weight2.hi, groups[g].weight2.lo};
    all.held = static_cast<std::uint32_t>(
        std::count_if(groups.begin(), groups.end(), [](const Group& g) { return g.batches != 0; }));
    describe_members(all);
    return all;
}

device::clr_state Moments::State::state_of(std::size_t group) const {
    const auto all = all_groups();
    return {static_cast<std::uint32_t>(group), all.count, all.of[group], all.options};
}

namespace {

/// A plane's tiles as the rows of a rectangle on the device.
struct Rectangle {
    Rectangle(const PlanePart& part, std::uint64_t values, std::size_t groups)
        : origin{part.number * row, 0, 0}, region{row, (values + CLR_TILE - 1) / CLR_TILE, 1},
          pitch(part.parts * groups * row) {}
    static constexpr std::size_t row = CLR_TILE * sizeof(float);
    std::array<std::size_t, 3> origin, region, host_origin{};
    std::size_t pitch;
};

}  // namespace

std::vector<std::uint32_t> Moments::State::read_plane(const PlanePart& part) const {
    const Rectangle r(part, values, groups.size());
    std::vector<std::uint32_t> words(plane_stride(values));
    check(clEnqueueReadBufferRect(engine.queue(), part.plane, CL_TRUE, r.origin.data(), r.host_origin.data(),
                                  r.region.data(), r.pitch, 0, r.row, 0, words.data(), 0, nullptr, nullptr),
          "clEnqueueReadBufferRect");
    words.resize(values);
    return words;
}

void Moments::State::write_plane(const PlanePart& part, std::span<const std::uint32_t> words) const {
    const Rectangle r(part, values, groups.size());
    std::vector<std::uint32_t> tiles(plane_stride(values));
    std::copy(words.begin(), words.end(), tiles.begin());
    check(clEnqueueWriteBufferRect(engine.queue(), part.plane, CL_TRUE, r.origin.data(), r.host_origin.data(),
                                   r.region.data(), r.pitch, 0, r.row, 0, tiles.data(), 0, nullptr, nullptr),
          "clEnqueueWriteBufferRect");
}

Launch& Moments::State::give_planes(Launch& launch) const {
    for (cl_mem p : {planes.m, planes.t, planes.mm, planes.tt, planes.mt, planes.weight, planes.weight2, planes.batches,
                     planes.quotient, planes.zero_m, planes.zero_share})
        launch.arg(p);
    return launch;
}

Launch& give_batches(Launch& launch, std::span<const Batch> batches, Group& group) {
    device::clr_batches table{};
    table.count = static_cast<std::uint32_t>(batches.size());
    table.packed = std::all_of(batches.begin(), batches.end(), [](const Batch& b) { return packed(b.m) && packed(b.t); });
    for (std::size_t k = 0; k < CLR_BATCHES_PER_LAUNCH; ++k) {
        const Batch& b = batches[std::min(k, batches.size() - 1)];
        launch.arg(b.m.mem).arg(b.t.mem);
        if (k >= batches.size()) continue;
        table.of[k] = describe(b.m, b.t, group, group_of(b));
        group = grown(group, table.of[k], 1);
    }
    return launch.arg(table);
}

Event add_to_group(Moments::State& s, std::size_t group, std::span<const Batch> batches, const Reading* reading,
                   std::span<const cl_event> waits) {
    Group sum = s.groups[group];
    Launch launch(s.engine, "moments", reading ? "clr_add_and_combine" : "clr_add",
                  reading ? reading->program_options(s.options) : "", reading ? Lanes::wide : Lanes::engine);
    s.give_planes(give_batches(launch, batches, sum)).arg(s.state_of(group)).arg(s.add_rows);
    if (reading) reading->give(launch, s.options.weights, s.batches() + batches.size());
    s.last = launch.after(waits).after(std::array{s.last.get()}).run_ranges(s.values);
    s.groups[group] = sum;
    return s.last;
}

void check_values(std::uint64_t values) {
    constexpr std::uint64_t most = std::uint64_t{1} << 50;  // bytes of planes and ends of views stay below 2^64
    if (values == 0 || values > most) throw InvalidArgument("values", "1 to 2^50", std::to_string(values));
}

void check_room(std::uint64_t batches, std::uint64_t more) {
    constexpr std::uint64_t most = std::numeric_limits<std::uint32_t>::max();
    if (more > most - batches)
        throw InvalidArgument("batches", "at most 2^32 - 1 in one state", std::to_string(batches + more));
}

void check_room(const Moments::State& s, std::uint64_t more, double squares) {
    check_room(s.batches(), more);
    for (const auto& g : s.groups) squares += static_cast<double>(g.weight2.hi);
    if (squares < 0x1.fffffp127) return;
    std::ostringstream got;
    got << squares;
    throw InvalidArgument("weight", "weights whose squares sum to less than 2^128", got.str());
}

void check_batches(std::uint64_t values, NonFinite nonfinite, std::span<const Batch> batches) {
    if (nonfinite == NonFinite::fail)
        throw InvalidArgument("NonFinite::fail", "a blocking call, which can look at the batch first", "the event form");
    for (std::size_t k = 0; k < batches.size(); ++k) {
        check_weight(batches[k].weight);
        check_view(name_in("m", k, batches.size()).c_str(), batches[k].m, values);
        check_view(name_in("t", k, batches.size()).c_str(), batches[k].t, values);
    }
}

Moments::Moments(const Engine& engine, std::uint64_t values, MomentsOptions options)
    : state_(make_state(engine, values, options)) {
    for (auto plane : planes_of(options)) {
        const Buffer b(engine, bytes_of(plane, values, options));
        state_->planes.*plane = b.mem();
        state_->owned.push_back(Memory::share(b.mem()));
    }
}

Moments::Moments(const Engine& engine, std::uint64_t values, MomentsOptions options, const StatePlanes& planes)
    : state_(make_state(engine, values, options)) {
    for (auto plane : planes_of(options)) {
        const std::uint64_t floats = bytes_of(plane, values, options) / sizeof(float);
        check_view("state plane", {planes.*plane, 0, floats}, floats);
        state_->planes.*plane = planes.*plane;
        state_->owned.push_back(Memory::share(planes.*plane));
    }
}

std::uint64_t Moments::plane_stride(std::uint64_t values) { return (values + CLR_TILE - 1) / CLR_TILE * CLR_TILE; }
std::uint64_t Moments::plane_bytes(std::uint64_t values) { return plane_stride(values) * 2 * sizeof(float); }

std::uint64_t Moments::state_bytes(std::uint64_t values, MomentsOptions options) {
    std::uint64_t sum = 0;
    for (auto plane : planes_of(options)) sum += bytes_of(plane, values, options);
    return sum;
}

void Moments::add(std::span<const float> m, std::span<const float> t, double weight) {
    const HostBatch batch{m, t, weight};
    add(std::span(&batch, 1));
}

OnDevice put_on_device(const Engine& engine, std::uint64_t count, NonFinite nonfinite, std::span<const HostBatch> batches) {
    OnDevice out;
    const auto put = [&](const char* name, std::size_t k, std::span<const float> values) -> View {
        if (values.size() != count)
            throw InvalidArgument(name_in(name, k, batches.size()), std::to_string(count) + " values",
                                  std::to_string(values.size()));
        out.memory.push_back(Buffer::from_host(engine, std::as_bytes(values)));
        return {out.memory.back().mem(), 0, count};
    };
    for (std::size_t k = 0; k < batches.size(); ++k) {
        const HostBatch& b = batches[k];
        check_weight(b.weight);
        const View m = put("m", k, b.m), t = put("t", k, b.t);
        out.batches.push_back({m, t, b.weight, b.index});
    }
    if (nonfinite == NonFinite::fail) refuse_nonfinite(engine, out.batches);
    return out;
}

Event add_batches(Moments::State& s, std::span<const Batch> batches, std::span<const cl_event> waits) {
    std::vector<std::vector<Batch>> of_group(s.groups.size());
    const std::uint64_t before = s.batches();
    for (std::size_t k = 0; k < batches.size(); ++k)
        of_group[batches[k].index.value_or(before + k) % s.groups.size()].push_back(batches[k]);
    Event done;
    for (std::size_t g = 0; g < of_group.size(); ++g)
        for (std::span<const Batch> left = of_group[g]; !left.empty();) {
            const auto now = left.first(std::min<std::size_t>(left.size(), CLR_BATCHES_PER_LAUNCH));
            done = add_to_group(s, g, now, nullptr, waits);
            left = left.subspan(now.size());
        }
    return done;
}

void Moments::add(std::span<const HostBatch> batches) {
    auto& s = *state_;
    const OnDevice put = put_on_device(s.engine, s.values, s.options.nonfinite, batches);
    check_room(s, batches.size(), sum_of_squares(batches));
    const Joined joined(s.last);
    wait(add_batches(s, put.batches, {}));
}

cl_event Moments::add(std::span<const Batch> batches, std::span<const cl_event> wait_list) {
    auto& s = *state_;
    if (batches.empty()) throw InvalidArgument("batches", "at least one", "none");
    check_batches(s.values, s.options.nonfinite, batches);
    check_room(s, batches.size(), sum_of_squares(batches));
    return add_batches(s, batches, wait_list).give();
}

cl_event Moments::merge(const Moments& other, std::span<const cl_event> wait_list) {
    auto& a = *state_;
    const auto& b = *other.state_;
    if (a.values != b.values) throw InvalidArgument("merge", std::to_string(a.values) + " values", std::to_string(b.values));
    if (&a.engine.state() != &b.engine.state()) throw InvalidArgument("merge", "a state on the same Engine", "another's");
    if (a.options != b.options) throw InvalidArgument("merge", "a state with the same options", "others");
    double squares = 0;
    for (const auto& g : b.groups) squares += static_cast<double>(g.weight2.hi);
    check_room(a, b.batches(), squares);
    for (std::size_t g = 0; g < a.groups.size(); ++g) {
        if (b.groups[g].batches == 0 && g > 0) continue;
        const auto entry = describe({}, {}, a.groups[g], b.groups[g]);
        const std::uint64_t row_words = g == 0 ? a.add_rows.size() / sizeof(std::uint64_t) : 0;
        Launch launch(a.engine, "moments", "clr_merge");
        a.give_planes(launch).arg(a.state_of(g));
        b.give_planes(launch).arg(b.state_of(g)).arg(entry).arg(a.add_rows).arg(b.add_rows).arg(row_words);
        a.last = launch.after(wait_list).after(std::array{a.last.get(), b.last.get()}).run_ranges(a.values);
        a.groups[g] = grown(a.groups[g], entry, b.groups[g].batches);
    }
    other.state_->last = a.last;
    return Event(a.last).give();
}

void Moments::merge(const Moments& other) { wait(Event(merge(other, {}))); }

void Moments::clear() {
    auto& s = *state_;
    wait_quietly(s.last);
    s.last = {};
    s.add_rows.write(std::vector<std::byte>(s.add_rows.size()));
    s.groups.assign(s.groups.size(), {});
}

std::uint64_t Moments::size() const { return state_->values; }
std::uint64_t Moments::batches() const { return state_->batches(); }
double Moments::weight() const {
    double sum = 0;
    for (const auto& g : state_->groups) sum += static_cast<double>(g.weight.hi) + static_cast<double>(g.weight.lo);
    return sum;
}
MomentsOptions Moments::options() const { return state_->options; }
const Engine& Moments::engine() const { return state_->engine; }
StatePlanes Moments::planes() const { return state_->planes; }
std::uint64_t Moments::negatives() const { return tally(*state_, CLR_TALLY_NEGATIVE); }
std::uint64_t Moments::skipped() const { return tally(*state_, CLR_TALLY_SKIPPED); }

std::vector<std::uint32_t> Moments::bits(cl_mem StatePlanes::*plane) const {
    const auto& s = *state_;
    const cl_mem mem = s.planes.*plane;
    if (!mem) return {};
    const std::size_t parts = plane == &StatePlanes::batches ? 1 : 2;
    std::vector<std::uint32_t> out(parts * s.groups.size() * s.values);
    wait(s.last);
    for (std::size_t p = 0; p < parts * s.groups.size(); ++p)
        if (s.groups[p / parts].batches != 0)
            std::ranges::copy(s.read_plane({mem, parts, p}), out.begin() + static_cast<std::ptrdiff_t>(p * s.values));
    return out;
}

}  // namespace clratio
