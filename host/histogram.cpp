#include "clratio/histogram.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <type_traits>

#include "draws.hpp"
#include "edges.hpp"

namespace clratio {
namespace {

constexpr std::uint64_t samples_a_launch = std::uint64_t{1} << 28;  // 32-bit counters of a row cannot overflow
constexpr std::uint64_t least_samples_a_model = std::uint64_t{1} << 16;
constexpr std::uint64_t row_memory = std::uint64_t{16} << 20;  // bytes

template <class Real>
using DeviceBins = std::conditional_t<std::is_same_v<Real, float>, device::clr_bins, device::clr_bins_double>;

template <class Real> DeviceBins<Real> device_bins(const Bins& bins) {
    if (bins.count < 1 || bins.count > (1u << 23))
        throw InvalidArgument("bins", "1 to 2^23 bins", std::to_string(bins.count));
    const auto lo = static_cast<Real>(bins.lo), hi = static_cast<Real>(bins.hi);
    const Real inverse_width = static_cast<Real>(bins.count) / (hi - lo);
    if (!(lo < hi) || !std::isfinite(hi - lo) || !std::isfinite(inverse_width))
        throw InvalidArgument("bins", "lo < hi, both and the bins' width in the range of the numbers",
                              "[" + std::to_string(bins.lo) + ", " + std::to_string(bins.hi) + ")");
    return {lo, hi, inverse_width, bins.count};
}

std::uint64_t slots_of(const Bins& bins) { return std::uint64_t{bins.count} + CLR_OUTER_SLOTS; }

void check_result(const Engine& engine, std::uint64_t models, std::uint64_t slots) {
    const std::uint64_t largest = engine.info().largest_allocation / sizeof(std::uint64_t);
    if (largest && models > largest / slots)
        throw InvalidArgument("bins", "results of at most " + std::to_string(largest) + " counters on " + engine.info().name,
                              std::to_string(models) + " rows of " + std::to_string(slots));
}

void report(const Progress& progress, std::uint64_t done, std::uint64_t total) {
    if (progress && !progress(done, total)) throw Cancelled();
}

// 64-bit totals on the device, over the caller's memory where the device can reach it.
class Totals {
public:
    Totals(const Engine& engine, std::span<std::uint64_t> rows)
        : buffer_(Buffer::onto_host(engine, std::as_writable_bytes(rows))) {
        if (!engine.info().host_memory) buffer_.write(std::as_bytes(rows));
    }

    const Buffer& buffer() const { return buffer_; }
    void publish() const { buffer_.publish(); }

private:
    Buffer buffer_;
};

// How tasks run on this engine: see kernels/histogram.cl.
struct Tasks {
    Tasks(const Engine& engine, std::uint64_t slot_count)
        : grouped(engine.grouped()), group_size(grouped ? engine.work_items() : 1), slots(slot_count),
          wanted(grouped ? 16 * std::max(1u, engine.info().compute_units) : engine.work_items()) {
        cl_ulong local = 0;
        check(clGetDeviceInfo(engine.device(), CL_DEVICE_LOCAL_MEM_SIZE, sizeof local, &local, nullptr), "clGetDeviceInfo");
        local_rows = grouped && slots * sizeof(cl_uint) <= local;
    }

    std::string options(Generator generator) const {
        return generator_option(generator) + " -DCLR_LOCAL_ROWS=" + (local_rows ? "1" : "0");
    }
    std::size_t local_bytes() const { return local_rows ? slots * sizeof(cl_uint) : sizeof(cl_uint); }
    std::uint64_t most_rows() const { return std::max<std::uint64_t>(1, row_memory / (slots * sizeof(cl_uint))); }
    std::uint64_t parts(std::uint64_t models) const {
        return std::max<std::uint64_t>(1, std::min((wanted + models - 1) / models, most_rows() / models));
    }

    bool grouped;
    std::size_t group_size;
    std::uint64_t slots, wanted;
    bool local_rows = false;
};

std::uint64_t divide_up(std::uint64_t a, std::uint64_t b) { return (a + b - 1) / b; }

// One launch: the samples `range` of `models` laws from `first_model` on, into one row for each model and part.
struct ErrorLaunch {
    std::uint64_t first_model, models, parts;
    IndexRange range;
};

template <class Law, class Real> class ErrorCounter {
public:
    ErrorCounter(const Engine& engine, std::vector<Law> laws, const Stream& stream, const Bins& bins,
                 std::span<std::uint64_t> rows)
        : engine_(engine), laws_(std::move(laws)), law_buffer_(Buffer::from_host(engine, std::as_bytes(std::span(laws_)))),
          stream_(stream), bins_(device_bins<Real>(bins)), tasks_(engine, slots_of(bins)), totals_(engine, rows) {
        at_once_ = std::min({std::uint64_t{laws_.size()}, tasks_.most_rows(), samples_a_launch / least_samples_a_model});
        rows_ = Buffer(engine, at_once_ * tasks_.parts(at_once_) * tasks_.slots * sizeof(cl_uint));
    }

    void run(IndexRange range, const Progress& progress) {
        const std::uint64_t total = range.count * laws_.size();
        const std::uint64_t step = samples_a_launch / at_once_;
        std::uint64_t counted = 0;
        for (std::uint64_t model = 0; model < laws_.size(); model += at_once_) {
            const std::uint64_t models = std::min(at_once_, laws_.size() - model);
            for (std::uint64_t done = 0; done < range.count; done += step) {
                report(progress, counted, total);
                const IndexRange part{range.first + done, std::min(step, range.count - done)};
                launch({model, models, std::min(tasks_.parts(at_once_), tasks_.parts(models)), part});
                counted += models * part.count;
            }
        }
        totals_.publish();
        report(progress, counted, total);
    }

private:
    static constexpr bool doubles = sizeof(Real) == sizeof(double);

    void launch(const ErrorLaunch& l) {
        const auto blocks = blocks_of(l.range.first, l.range.count, doubles ? 1 : 2, engine_.width());
        const std::uint64_t vectors = blocks.count / static_cast<std::uint64_t>(engine_.width());
        Stream stream = stream_;
        stream.domain = Domain::error;
        stream.id += static_cast<std::uint32_t>(l.first_model);
        const Event counted = Launch(engine_, "histogram", doubles ? "clr_histogram_errors_double" : "clr_histogram_errors",
                                     tasks_.options(stream.generator))
                                  .arg(rows_)
                                  .arg(law_buffer_)
                                  .arg(cl_ulong{l.first_model})
                                  .arg(static_cast<cl_uint>(l.models))
                                  .arg(device_stream(stream))
                                  .arg(bins_)
                                  .arg(cl_ulong{l.range.first})
                                  .arg(cl_ulong{l.range.count})
                                  .arg(cl_ulong{blocks.first})
                                  .arg(cl_ulong{vectors})
                                  .arg(cl_ulong{divide_up(vectors, l.parts)})
                                  .local(tasks_.local_bytes())
                                  .run_groups(l.models * l.parts, tasks_.group_size);
        const cl_event after = counted.get();
        wait(Launch(engine_, "histogram", "clr_add_rows", tasks_.options(stream.generator))
                 .arg(totals_.buffer())
                 .arg(cl_ulong{l.first_model * tasks_.slots})
                 .arg(rows_)
                 .arg(static_cast<cl_uint>(l.parts))
                 .after({&after, 1})
                 .run_ranges(l.models * tasks_.slots));
    }

    const Engine& engine_;
    std::vector<Law> laws_;
    Buffer law_buffer_;
    Stream stream_;
    DeviceBins<Real> bins_;
    Tasks tasks_;
    Totals totals_;
    std::uint64_t at_once_ = 1;
    Buffer rows_;
};

// Takes one row of counters into h.
void take_row(Histogram& h, const Bins& bins, std::span<const std::uint64_t> row) {
    h.lo = bins.lo;
    h.hi = bins.hi;
    h.bins.assign(row.begin(), row.begin() + bins.count);
    h.underflow = row[bins.count + CLR_UNDERFLOW];
    h.overflow = row[bins.count + CLR_OVERFLOW];
    h.nonfinite = row[bins.count + CLR_NONFINITE];
}

std::vector<IndexRange> join(std::vector<IndexRange> ranges) {
    std::sort(ranges.begin(), ranges.end(), [](const IndexRange& a, const IndexRange& b) { return a.first < b.first; });
    std::vector<IndexRange> joined;
    for (const IndexRange& r : ranges) {
        const std::uint64_t end = joined.empty() ? 0 : joined.back().first + joined.back().count;
        if (!joined.empty() && r.first < end)
            throw InvalidArgument("histogram", "other samples than those it already holds",
                                  "sample " + std::to_string(r.first) + " twice");
        if (!joined.empty() && r.first == end)
            joined.back().count += r.count;
        else
            joined.push_back(r);
    }
    return joined;
}

bool same(const Canonical& a, const Canonical& b) { return a.s == b.s && a.a == b.a && a.b == b.b; }
bool same(const Stream& a, const Stream& b) { return a.seed == b.seed && a.id == b.id && a.generator == b.generator; }

}  // namespace

std::uint64_t Histogram::total() const {
    return std::accumulate(bins.begin(), bins.end(), underflow + overflow + nonfinite);
}

namespace {

/// Floats in order as integers.
std::int32_t rank_of(float x) {
    const auto bits = std::bit_cast<std::int32_t>(x);
    return bits < 0 ? std::numeric_limits<std::int32_t>::min() - bits : bits;
}
float float_of(std::int32_t rank) {
    return std::bit_cast<float>(rank < 0 ? std::numeric_limits<std::int32_t>::min() - rank : rank);
}

/// The least float in [lo, hi] that is not counted below bin i.
float least_in(const device::clr_bins& bins, std::uint32_t i) {
    std::int32_t low = rank_of(bins.lo), high = rank_of(bins.hi);
    while (low < high) {
        const auto middle = static_cast<std::int32_t>((std::int64_t{low} + high) >> 1);
        if (device::clr_slot(bins, float_of(middle)) < i)
            low = middle + 1;
        else
            high = middle;
    }
    return float_of(low);
}

}  // namespace

std::vector<double> Histogram::edges() const {
    const auto count = static_cast<std::uint32_t>(bins.size());
    if (count == 0) return {};
    const std::vector<double> nominal = equal_edges(lo, hi, count);
    if (precision == Precision::double_precision) return nominal;
    std::vector<double> counted;
    const auto b = device_bins<float>({lo, hi, count});
    for (std::uint32_t i = 0; i < count; ++i) counted.push_back(least_in(b, i));
    counted.push_back(b.hi);
    const bool all_hold_some = std::adjacent_find(counted.begin(), counted.end()) == counted.end();
    return all_hold_some ? counted : nominal;
}

Histogram& Histogram::operator+=(const Histogram& other) {
    if (precision != other.precision) throw InvalidArgument("histogram", "the same precision", "another");
    if (bins.size() != other.bins.size() || lo != other.lo || hi != other.hi)
        throw InvalidArgument("histogram", "the same bins",
                              std::to_string(other.bins.size()) + " bins on [" + std::to_string(other.lo) + ", " +
                                  std::to_string(other.hi) + ")");
    for (std::size_t i = 0; i < bins.size(); ++i) bins[i] += other.bins[i];
    underflow += other.underflow;
    overflow += other.overflow;
    nonfinite += other.nonfinite;
    return *this;
}

ErrorHistogram& ErrorHistogram::operator+=(const ErrorHistogram& other) {
    if (!same(law, other.law)) throw InvalidArgument("histogram", "the same law", "another");
    if (!same(stream, other.stream)) throw InvalidArgument("histogram", "the same stream", "another");
    auto all = ranges;
    all.insert(all.end(), other.ranges.begin(), other.ranges.end());
    all = join(std::move(all));
    Histogram::operator+=(other);
    ranges = std::move(all);
    return *this;
}

void add_error_counts(const Engine& engine, std::span<const Canonical> laws, const Stream& stream, IndexRange range,
                      Bins bins, std::span<std::uint64_t> rows, const HistogramOptions& options) {
    const bool doubles = options.precision == Precision::double_precision;
    if (laws.empty()) throw InvalidArgument("laws", "at least one", "none");
    for (const Canonical& law : laws) check_law(law);
    device_stream(stream);
    if (laws.size() - 1 > 0xffffffffu - stream.id)
        throw InvalidArgument("stream.id", "ids below 2^32 for all laws",
                              std::to_string(stream.id) + " + " + std::to_string(laws.size()));
    if (range.count == 0) throw InvalidArgument("range", "at least one sample", "an empty range");
    check_range(range.first, range.count);
    doubles ? void(device_bins<double>(bins)) : void(device_bins<float>(bins));
    check_result(engine, laws.size(), slots_of(bins));
    if (rows.size() != laws.size() * slots_of(bins))
        throw InvalidArgument("rows", std::to_string(laws.size() * slots_of(bins)) + " counters",
                              std::to_string(rows.size()));
    if (doubles) {
        require_fp64(engine, "double samples");
        ErrorCounter<Canonical, double>(engine, {laws.begin(), laws.end()}, stream, bins, rows).run(range, options.progress);
    } else {
        std::vector<device::clr_canonical> floats(laws.size());
        std::transform(laws.begin(), laws.end(), floats.begin(), to_float);
        ErrorCounter<device::clr_canonical, float>(engine, std::move(floats), stream, bins, rows)
            .run(range, options.progress);
    }
}

std::vector<ErrorHistogram> error_histograms(const Engine& engine, std::span<const Canonical> laws, const Stream& stream,
                                             IndexRange range, Bins bins, const HistogramOptions& options) {
    check_result(engine, laws.size(), slots_of(bins));
    const auto slots = static_cast<std::size_t>(slots_of(bins));
    std::vector<std::uint64_t> rows(laws.size() * slots);
    add_error_counts(engine, laws, stream, range, bins, rows, options);
    std::vector<ErrorHistogram> out(laws.size());
    for (std::size_t j = 0; j < out.size(); ++j) {
        take_row(out[j], bins, std::span(rows).subspan(j * slots, slots));
        out[j].law = laws[j];
        out[j].stream = stream;
        out[j].stream.id += static_cast<std::uint32_t>(j);
        out[j].stream.domain = Domain::error;
        out[j].precision = options.precision;
        out[j].ranges = {range};
    }
    return out;
}

ErrorHistogram error_histogram(const Engine& engine, const Canonical& law, const Stream& stream, IndexRange range, Bins bins,
                               const HistogramOptions& options) {
    return error_histograms(engine, {&law, 1}, stream, range, bins, options).front();
}

Histogram histogram(const Engine& engine, View values, Bins bins, std::span<const cl_event> wait_list) {
    const auto on_device = device_bins<float>(bins);
    check_result(engine, 1, slots_of(bins));
    check_view("values", values, values.count);
    const Tasks tasks(engine, slots_of(bins));
    const std::uint64_t parts = tasks.parts(1);
    std::vector<std::uint64_t> row(tasks.slots);
    const Buffer rows(engine, parts * tasks.slots * sizeof(cl_uint));
    const Totals totals(engine, row);
    for (std::uint64_t done = 0; done < values.count; done += samples_a_launch) {
        View part = values;
        part.count = std::min(samples_a_launch, values.count - done);
        const std::uint64_t vectors = divide_up(part.count, static_cast<std::uint64_t>(engine.width()));
        const Event counted = Launch(engine, "histogram", "clr_histogram_values", tasks.options(Generator::philox))
                                  .arg(rows)
                                  .view(part)
                                  .arg(on_device)
                                  .arg(cl_ulong{done})
                                  .arg(cl_ulong{done + part.count})
                                  .arg(cl_ulong{vectors})
                                  .arg(cl_ulong{divide_up(vectors, parts)})
                                  .local(tasks.local_bytes())
                                  .after(wait_list)
                                  .run_groups(parts, tasks.group_size);
        const cl_event after = counted.get();
        wait(Launch(engine, "histogram", "clr_add_rows", tasks.options(Generator::philox))
                 .arg(totals.buffer())
                 .arg(cl_ulong{0})
                 .arg(rows)
                 .arg(static_cast<cl_uint>(parts))
                 .after({&after, 1})
                 .run_ranges(tasks.slots));
    }
    totals.publish();
    Histogram h;
    take_row(h, bins, row);
    return h;
}

Histogram histogram(const Engine& engine, std::span<const float> values, Bins bins) {
    device_bins<float>(bins);
    Histogram all;
    take_row(all, bins, std::vector<std::uint64_t>(slots_of(bins)));
    const std::uint64_t largest = std::max<std::uint64_t>(1, engine.info().largest_allocation / sizeof(float));
    for (std::uint64_t done = 0; done < values.size(); done += largest) {
        const auto part = values.subspan(done, std::min<std::uint64_t>(largest, values.size() - done));
        const auto buffer = Buffer::from_host(engine, std::as_bytes(part));
        all += histogram(engine, View{buffer.mem(), 0, part.size()}, bins);
    }
    return all;
}

}  // namespace clratio
