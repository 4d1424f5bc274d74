#include "clratio/histogram.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "embedded.hpp"
#include "support/oclgrind.hpp"
#include "support/raw_kernel.hpp"
#include "support/refused.hpp"
#include "support/shapes.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

constexpr float infinity = std::numeric_limits<float>::infinity(), nan_value = std::numeric_limits<float>::quiet_NaN();
const Bins bins{-1.5, 1.5, 1024};
const Canonical wide = canonical({.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35});
const Canonical impulse = canonical({.mu = 1, .tau = 0, .sigma_m = .3, .sigma_t = .2});

using Row = std::vector<std::uint64_t>;

// The bin contract, written once more from its words: theory of half-open bins, in float, one case after the other.
std::size_t slot(const Bins& b, float x) {
    const auto lo = static_cast<float>(b.lo), hi = static_cast<float>(b.hi);
    if (std::isnan(x)) return b.count + 2;
    if (x < lo) return b.count;
    if (x >= hi) return b.count + 1;
    const float width = hi - lo, inverse = static_cast<float>(b.count) / width, offset = x - lo;
    return std::min<std::size_t>(b.count - 1, static_cast<std::size_t>(std::floor(offset * inverse)));
}

Row host_row(const Canonical& law, const Stream& stream, IndexRange range, const Bins& b) {
    Row row(b.count + 3);
    for (std::uint64_t i = 0; i < range.count; ++i) ++row[slot(b, error_sample(law, stream, range.first + i))];
    return row;
}

Row row_of(const Histogram& h) {
    Row row = h.bins;
    row.insert(row.end(), {h.underflow, h.overflow, h.nonfinite});
    return row;
}

std::vector<float> edge_values(const Bins& b) {
    const auto lo = static_cast<float>(b.lo), hi = static_cast<float>(b.hi);
    std::vector<float> v{lo,
                         hi,
                         -infinity,
                         infinity,
                         nan_value,
                         0.0f,
                         -0.0f,
                         1e-45f,
                         -3.4e38f,
                         3.4e38f,
                         std::nextafter(lo, -infinity),
                         std::nextafter(lo, infinity),
                         std::nextafter(hi, -infinity),
                         std::nextafter(hi, infinity)};
    for (std::uint32_t k = 0; k < b.count; ++k) {
        const float edge = lo + static_cast<float>(k) * ((hi - lo) / static_cast<float>(b.count));
        for (const float x : {std::nextafter(edge, -infinity), edge, std::nextafter(edge, infinity)}) v.push_back(x);
    }
    return v;
}

std::uint64_t peak_memory_kb() {
    std::ifstream status("/proc/self/status");
    for (std::string line; std::getline(status, line);)
        if (line.rfind("VmHWM:", 0) == 0) return std::stoull(line.substr(6));
    return 0;
}

}  // namespace

TEST(Histogram, slots_follow_the_contract_at_every_edge) {
    for (const Bins& b : {bins, Bins{-1.5, 1.5, 1000}, Bins{0, 1, 3}, Bins{-3, 0, 7}, Bins{1e-3, 1e3, 50}, Bins{-2, 4, 1}}) {
        const auto lo = static_cast<float>(b.lo), hi = static_cast<float>(b.hi);
        const device::clr_bins on_device{lo, hi, static_cast<float>(b.count) / (hi - lo), b.count};
        for (const float x : edge_values(b))
            EXPECT_EQ(device::clr_slot(on_device, x), slot(b, x)) << x << " in " << b.count << " bins";
    }
    EXPECT_EQ(slot(bins, std::nextafter(1.5f, 0.0f)), 1023u);
    EXPECT_EQ(std::floor((std::nextafter(1.5f, 0.0f) + 1.5f) * (1024 / 3.0f)), 1024);  // what the min is for
}

TEST(Histogram, of_values_in_memory) {
    for (const auto& shape : all_shapes()) {
        const Engine engine(shape.options);
        for (const Bins& b : {bins, Bins{0, 1, 3}}) {
            const auto values = edge_values(b);
            Row want(b.count + 3);
            for (const float x : values) ++want[slot(b, x)];
            const Histogram h = histogram(engine, values, b);
            EXPECT_EQ(row_of(h), want) << shape.name;
            EXPECT_EQ(h.total(), values.size());
        }
    }
}

TEST(Histogram, of_a_view_counts_what_the_view_holds) {
    const Engine engine;
    const auto values = edge_values(bins);
    const auto buffer = Buffer::from_host(engine, std::as_bytes(std::span(values)));
    Row want(bins.count + 3);
    std::uint64_t count = 0;
    for (std::size_t pixel = 0; 3 + 4 * pixel + 2 < values.size(); ++pixel, count += 3)
        for (std::size_t c = 0; c < 3; ++c) ++want[slot(bins, values[3 + 4 * pixel + c])];
    EXPECT_EQ(row_of(histogram(engine, View{buffer.mem(), 3, count, 4, 3}, bins)), want);
    EXPECT_EQ(histogram(engine, View{buffer.mem(), 0, 0}, bins).total(), 0u);
}

TEST(Histogram, is_the_hosts_count_for_count_in_every_shape_and_range) {
    const std::vector<std::uint64_t> starts{0, 7, (1ull << 32) - 4001, (1ull << 33) - 3333, end_of_stream - 20011};
    for (const auto generator : {Generator::philox, Generator::pcg4d3x}) {
        const Stream stream{1, 3, generator};
        std::vector<Row> want;
        for (const std::uint64_t first : starts) want.push_back(host_row(wide, stream, {first, 20011}, bins));
        for (const auto& shape : all_shapes()) {
            const Engine engine(shape.options);
            for (std::size_t i = 0; i < starts.size(); ++i)
                ASSERT_EQ(row_of(error_histogram(engine, wide, stream, {starts[i], 20011}, bins)), want[i])
                    << shape.name << " from " << starts[i];
        }
    }
}

TEST(Histogram, parts_add_up_in_any_order) {
    const Engine engine;
    const Stream stream{2};
    const auto whole = error_histogram(engine, wide, stream, {100, 50000}, bins);
    auto sum = error_histogram(engine, wide, stream, {20100, 29999}, bins);
    sum += error_histogram(engine, wide, stream, {50099, 1}, bins);
    EXPECT_EQ(sum.ranges, (std::vector<IndexRange>{{20100, 30000}}));
    sum += error_histogram(engine, wide, stream, {100, 333}, bins);
    sum += error_histogram(engine, wide, stream, {433, 19667}, bins);
    EXPECT_EQ(row_of(sum), row_of(whole));
    EXPECT_EQ(sum.ranges, whole.ranges);
    EXPECT_EQ(sum.total(), 50000u);
    EXPECT_EQ(sum.stream.domain, Domain::error);
}

TEST(Histogram, parts_that_do_not_belong_are_refused) {
    const Engine engine;
    const auto part = [&](const Canonical& law, const Stream& stream, IndexRange range, Bins b,
                          Precision p = Precision::single_precision) {
        return error_histogram(engine, law, stream, range, b, {.precision = p});
    };
    auto sum = part(wide, {1}, {0, 100}, bins);
    const auto before = row_of(sum);
    refused([&] { sum += part(wide, {1}, {99, 5}, bins); }, "twice");
    refused([&] { sum += part(impulse, {1}, {100, 5}, bins); }, "histogram: expected the same law");
    refused([&] { sum += part(wide, {2}, {100, 5}, bins); }, "histogram: expected the same stream");
    refused([&] { sum += part(wide, {1}, {100, 5}, {-1.5, 1.5, 1000}); }, "histogram: expected the same bins");
    refused([&] { sum += part(wide, {1}, {100, 5}, {-1.5, 2, 1024}); }, "histogram: expected the same bins");
    refused(
        [&] {
            sum += part(wide, {1}, {100, 5}, bins, Precision::double_precision);
        },
        "histogram: expected the same precision");
    EXPECT_EQ(row_of(sum), before);
    EXPECT_EQ(sum.ranges, (std::vector<IndexRange>{{0, 100}}));
}

TEST(Histogram, a_batch_is_its_models_one_by_one) {
    std::vector<Canonical> laws;
    for (std::uint64_t n = 1; n <= 300; ++n)
        laws.push_back(canonical({.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35, .n = n}));
    for (const Shape& shape : some_shapes()) {
        const Engine engine(shape.options);
        const auto batch = error_histograms(engine, laws, {3, 10}, {5, 999}, bins);
        ASSERT_EQ(batch.size(), laws.size());
        for (std::size_t j = 0; j < laws.size(); ++j) {
            ASSERT_EQ(batch[j].total(), 999u);
            ASSERT_EQ(batch[j].stream.id, 10 + j);
            if (j % 50 == 0) {
                ASSERT_EQ(row_of(batch[j]), host_row(laws[j], {3, static_cast<std::uint32_t>(10 + j)}, {5, 999}, bins))
                    << shape.name;
            }
        }
    }
}

TEST(Histogram, many_models_in_several_launches) {
    const Engine engine;
    const Bins few{-1, 1, 5};
    const std::vector<Canonical> laws(10000, wide);
    const auto batch = error_histograms(engine, laws, {1}, {0, 64}, few);
    for (std::size_t j : {std::size_t{0}, std::size_t{4095}, std::size_t{4096}, std::size_t{9999}})
        EXPECT_EQ(row_of(batch[j]), host_row(wide, {1, static_cast<std::uint32_t>(j)}, {0, 64}, few)) << j;
    for (const auto& h : batch) ASSERT_EQ(h.total(), 64u);
}

TEST(Histogram, counters_in_global_memory_where_local_memory_is_too_small) {
    const Bins many{-1.5, 1.5, 1u << 19};
    const Engine groups({.path = EngineOptions::Path::groups, .work_items = 5}), ranges;
    EXPECT_EQ(row_of(error_histogram(groups, impulse, {1}, {3, 40000}, many)), host_row(impulse, {1}, {3, 40000}, many));
    EXPECT_EQ(row_of(error_histogram(ranges, impulse, {1}, {3, 40000}, many)), host_row(impulse, {1}, {3, 40000}, many));
}

TEST(Histogram, doubles_are_the_hosts) {
    Row want(bins.count + 3);
    for (std::uint64_t i = 0; i < 20000; ++i) {
        const double x = error_sample_double(wide, {1}, 9 + i);
        ++want[x < -1.5 ? 1024u : x >= 1.5 ? 1025u : std::min(1023u, static_cast<unsigned>((x + 1.5) * (1024 / 3.0)))];
    }
    for (const Shape& shape : some_shapes())
        EXPECT_EQ(row_of(error_histogram(Engine(shape.options), wide, {1}, {9, 20000}, bins,
                                         {.precision = Precision::double_precision})),
                  want)
            << shape.name;
}

TEST(Histogram, adds_to_the_callers_counters) {
    const Engine engine;
    const std::vector<Canonical> laws{wide, impulse};
    Row rows(2 * (bins.count + 3), 7);
    add_error_counts(engine, laws, {1}, {0, 1000}, bins, rows);
    Row want = host_row(wide, {1}, {0, 1000}, bins);
    const Row second = host_row(impulse, {1, 1}, {0, 1000}, bins);
    want.insert(want.end(), second.begin(), second.end());
    for (auto& w : want) w += 7;
    EXPECT_EQ(rows, want);
}

TEST(Histogram, progress_is_told_and_can_cancel) {
    const Engine engine;
    const Stream stream{1, 0, Generator::pcg4d3x};
    std::vector<std::uint64_t> seen;
    const std::uint64_t count = (std::uint64_t{1} << 28) + 5;
    const auto note = [&](std::uint64_t done, std::uint64_t total) {
        EXPECT_EQ(total, count);
        seen.push_back(done);
        return true;
    };
    EXPECT_EQ(error_histogram(engine, wide, stream, {0, count}, {-2, 4, 64}, {.progress = note}).total(), count);
    EXPECT_EQ(seen, (std::vector<std::uint64_t>{0, std::uint64_t{1} << 28, count}));
    const auto stop = [](std::uint64_t done, std::uint64_t) { return done == 0; };
    EXPECT_THROW(error_histogram(engine, wide, stream, {0, std::uint64_t{1} << 40}, {-2, 4, 64}, {.progress = stop}),
                 Cancelled);
}

TEST(Histogram, bad_parameters_are_refused_by_name) {
    const Engine engine;
    const auto call = [&](IndexRange range, Bins b, Stream stream = {1}) {
        error_histogram(engine, wide, stream, range, b);
    };
    refused([&] { call({0, 0}, bins); }, "range: expected");
    refused([&] { call({end_of_stream - 1, 2}, bins); }, "range: expected");
    refused([&] { call({0, 1}, {1, 1, 10}); }, "bins: expected");
    refused([&] { call({0, 1}, {0, std::nan(""), 10}); }, "bins: expected");
    refused([&] { call({0, 1}, {-3e38, 3e38, 10}); }, "bins: expected");
    refused([&] { call({0, 1}, {0, 1, 0}); }, "bins: expected");
    refused([&] { call({0, 1}, {0, 1, (1u << 23) + 1}); }, "bins: expected");
    refused(
        [&] {
            error_histograms(engine, std::vector<Canonical>(100000, wide), {1}, {0, 1}, {0, 1, 1u << 23});
        },
        "bins: expected");
    refused(
        [&] {
            error_histograms(engine, std::vector<Canonical>(2, wide), {1, ~0u}, {0, 1}, bins);
        },
        "stream.id: expected");
    refused([&] { error_histograms(engine, {}, {1}, {0, 1}, bins); }, "laws: expected");
    Row rows(3);
    refused([&] { add_error_counts(engine, {&wide, 1}, {1}, {0, 1}, bins, rows); }, "rows: expected");
}

// Faults planted into the device's source, each to be seen in the counts.
TEST(Histogram, counts_catch_planted_faults) {
    const Engine engine({.path = EngineOptions::Path::ranges});
    const auto equal = [&](std::string_view from, std::string_view to) {
        constexpr std::uint64_t count = 40000, first = 3;
        const Buffer rows(engine, (bins.count + 3) * sizeof(cl_uint));
        const device::clr_canonical law = to_float(wide);
        const auto laws = Buffer::from_host(engine, std::as_bytes(std::span(&law, 1)));
        const auto width = static_cast<std::uint64_t>(engine.width()), vectors = (first + count) / 2 / width + 1;
        RawKernel(engine, replaced(flatten_kernel("histogram"), from, to), "clr_histogram_errors",
                  "-DCLR_GENERATOR=CLR_PHILOX -DCLR_LOCAL_ROWS=0")
            .arg(rows)
            .arg(laws)
            .arg(cl_ulong{0})
            .arg(cl_uint{1})
            .arg(device::clr_stream{1, 0, CLR_DOMAIN_ERROR})
            .arg(device::clr_bins{-1.5f, 1.5f, 1024 / 3.0f, 1024})
            .arg(cl_ulong{first})
            .arg(cl_ulong{count})
            .arg(cl_ulong{0})
            .arg(cl_ulong{vectors})
            .arg(cl_ulong{vectors})
            .local(4)
            .run(1, 1);
        const auto got = contents<cl_uint>(rows);
        return Row(got.begin(), got.end()) == host_row(wide, {1}, {first, count}, bins);
    };
    EXPECT_TRUE(equal("kernel", "kernel"));
    EXPECT_FALSE(equal("position < top ? position : top", "position < top ? position + 1.0f : top"));  // off by one bin
    EXPECT_FALSE(equal("i < queue.waiting", "i + 1 < queue.waiting"));                                 // a lost lane
    EXPECT_FALSE(equal("to[1] = odd", "to[1] = even"));                                                // half counted twice
    EXPECT_FALSE(equal("#if !CLR_GROUPED\n    clr_count_waiting(queue, counters);", "#if 0\n"));       // the last step lost
    EXPECT_FALSE(equal("(ulong)(at + i * step) < count", "at + i * step < (long)count"));  // draws before the first
    EXPECT_FALSE(equal("(float)(bins.count + CLR_OVERFLOW)", "(float)(bins.count - 1)"));  // clamped in
}

TEST(Histogram, SlowMemoryDoesNotGrowWithTheSamples) {
    const Engine engine;
    const Stream stream{1, 0, Generator::pcg4d3x};
    error_histogram(engine, wide, stream, {0, 1'000'000}, bins);
    const std::uint64_t before = peak_memory_kb();
    const auto h = error_histogram(engine, wide, stream, {0, 10'000'000'000}, bins);
    EXPECT_EQ(h.total(), 10'000'000'000u);
    EXPECT_LT(peak_memory_kb(), before + 4096);
}

// An engine for each kernel: oclgrind 21.10 takes counters that a kernel clears for uninitialised where another ran before.
TEST(HistogramSmall, every_kernel) {
    const Bins few{-2, 4, 6};
    const auto values = edge_values(few);
    Row want(few.count + 3);
    for (const float x : values) ++want[slot(few, x)];
    for (const auto generator : {Generator::philox, Generator::pcg4d3x}) {
        const Stream stream{3, 10, generator};
        const IndexRange range{5, 43};
        for (const auto& shape : smallest_shapes()) {
            EXPECT_EQ(
                error_histogram(Engine(shape.options), wide, stream, range, few, {.precision = Precision::double_precision})
                    .total(),
                range.count);
            EXPECT_EQ(row_of(error_histogram(Engine(shape.options), wide, stream, range, few)),
                      host_row(wide, stream, range, few));
            EXPECT_EQ(row_of(histogram(Engine(shape.options), values, few)), want);
        }
    }
}

TEST(Histogram, kernels_are_clean_under_oclgrind) { expect_clean_under_oclgrind("histogram_test", "HistogramSmall.*"); }
