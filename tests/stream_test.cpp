#include "clratio/stream.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <fstream>
#include <sstream>

#include "clratio/device/quantile.h"
#include "clratio/histogram.hpp"
#include "embedded.hpp"
#include "support/oclgrind.hpp"
#include "support/raw_kernel.hpp"
#include "support/refused.hpp"
#include "support/shapes.hpp"
#include "support/theory.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

using Words = std::array<std::uint32_t, 4>;

Words words(device::clr_words w) { return {w.w0, w.w1, w.w2, w.w3}; }

std::vector<std::string> lines(const std::string& file) {
    std::ifstream in(std::string(CLRATIO_TEST_DATA) + "/" + file);
    std::vector<std::string> all;
    for (std::string line; std::getline(in, line);)
        if (!line.empty() && line[0] != '#') all.push_back(line);
    return all;
}

template <class T> std::vector<T> numbers(std::istream& in, std::size_t count) {
    std::vector<T> v(count);
    in >> std::hex;
    for (auto& x : v) in >> x;
    if (!in) throw std::runtime_error("known answers: bad line");
    return v;
}

struct RawAnswer {
    Words in, out;
    std::array<std::uint32_t, 2> key;
    bool philox;
};

// Random123's kat_vectors for philox4x32 10, and every line of pcg4d3x_kat.txt.
std::vector<RawAnswer> raw_answers() {
    std::vector<RawAnswer> all{{{0, 0, 0, 0}, {0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}, {0, 0}, true},
                               {{~0u, ~0u, ~0u, ~0u}, {0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}, {~0u, ~0u}, true},
                               {{0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344},
                                {0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1},
                                {0xa4093822, 0x299f31d0},
                                true}};
    for (const auto& line : lines("pcg4d3x_kat.txt")) {
        std::istringstream in(line);
        const auto v = numbers<std::uint32_t>(in, 8);
        all.push_back({{v[0], v[1], v[2], v[3]}, {v[4], v[5], v[6], v[7]}, {0, 0}, false});
    }
    return all;
}

struct LayoutAnswer {
    Stream stream;
    std::uint64_t block;
    std::vector<std::uint32_t> words;
};

std::vector<LayoutAnswer> layout_answers() {
    std::vector<LayoutAnswer> all;
    for (const auto& line : lines("stream_kat.txt")) {
        std::istringstream in(line);
        std::string generator;
        in >> generator;
        const auto v = numbers<std::uint64_t>(in, 4);
        const Stream stream{v[0], static_cast<std::uint32_t>(v[1]),
                            generator == "philox" ? Generator::philox : Generator::pcg4d3x, static_cast<Domain>(v[2])};
        all.push_back({stream, v[3], numbers<std::uint32_t>(in, 4)});
    }
    return all;
}

// A user's kernel: the raw generators on words of the user's own.
const char* raw_generators = R"(
kernel void raw(global const uint* in, global uint* out, uint key0, uint key1, uint philox) {
    clr_words v;
    v.w0 = (clr_uint)(in[0]);
    v.w1 = (clr_uint)(in[1]);
    v.w2 = (clr_uint)(in[2]);
    v.w3 = (clr_uint)(in[3]);
    v = philox ? clr_philox4x32(v, key0, key1) : clr_pcg4d3x(v);
    uint lane[CLR_WIDTH];
    clr_store(v.w0, lane); out[0] = lane[CLR_WIDTH - 1];
    clr_store(v.w1, lane); out[1] = lane[CLR_WIDTH - 1];
    clr_store(v.w2, lane); out[2] = lane[CLR_WIDTH - 1];
    clr_store(v.w3, lane); out[3] = lane[CLR_WIDTH - 1];
})";

// z at the tail probability k 2^-33, an independent double quantile (Boost's erfc_inv).
double reference_normal(std::uint32_t h) {
    const bool negative = h < 0x80000000u;
    const double p = (2.0 * (negative ? h : ~h) + 1) * 0x1p-33;
    const double z = 1.4142135623730951 * boost::math::erfc_inv(2 * p);
    return negative ? -z : z;
}

double ulp(double x) { return std::ldexp(1.0, std::max(std::ilogb(x), -126) - 23); }

struct Worst {
    double ulps = 0, relative = 0;
    std::uint32_t at = 0;
};

template <class Quantile> void compare(Worst& worst, std::uint32_t h, Quantile quantile) {
    const double want = reference_normal(h), got = quantile(h), off = std::abs(got - want);
    if (off / ulp(want) > worst.ulps) worst = {off / ulp(want), worst.relative, h};
    worst.relative = std::max(worst.relative, off / std::abs(want));
}

// A million words in equal steps, and 2^16 at both ends.
template <class Visit> void each_tested_word(Visit visit) {
    for (std::uint64_t i = 0; i < 1'000'000; ++i) visit(static_cast<std::uint32_t>(i * 4294967296u / 1'000'000));
    for (std::uint32_t i = 0; i < 65536; ++i) {
        visit(i);
        visit(~i);
    }
}

template <class Quantile> Worst worst_of(Quantile quantile) {
    Worst worst;
    each_tested_word([&](std::uint32_t h) { compare(worst, h, quantile); });
    return worst;
}

bool accurate(const Worst& w) { return w.ulps <= 8 && w.relative <= 6e-7; }

std::vector<float> host_normals(const Stream& s, std::uint64_t first, std::size_t count) {
    std::vector<float> v(count);
    for (std::size_t i = 0; i < count; ++i) v[i] = normal(s, first + i);
    return v;
}

// Bits, so that zeros and NaNs compare too.
template <class T> bool same_bits(std::span<const T> a, std::span<const T> b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}
template <class T> bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
    return same_bits(std::span<const T>(a), std::span<const T>(b));
}

// Word ranges at the edges: odd starts, where the 32-bit words of the index and of the block carry, and the end.
const std::vector<std::uint64_t> starts{0, 1, 61, (1ull << 32) - 77, (1ull << 34) - 1001, end_of_stream - 2003};

}  // namespace

TEST(Stream, raw_generators_give_the_known_answers) {
    for (const auto& a : raw_answers()) {
        const device::clr_words in{a.in[0], a.in[1], a.in[2], a.in[3]};
        EXPECT_EQ(words(a.philox ? device::clr_philox4x32(in, a.key[0], a.key[1]) : device::clr_pcg4d3x(in)), a.out);
    }
}

TEST(Stream, a_users_kernel_gives_the_known_answers_at_every_width) {
    for (const int width : {1, 2, 4, 8, 16}) {
        const Engine engine({.width = width, .path = EngineOptions::Path::ranges});
        RawKernel kernel(engine, device_source() + raw_generators, "raw");
        for (const auto& a : raw_answers()) {
            const auto in = Buffer::from_host(engine, std::as_bytes(std::span(a.in)));
            const Buffer out(engine, sizeof(Words));
            kernel.arg(in).arg(out).arg(a.key[0]).arg(a.key[1]).arg(cl_uint{a.philox}).run(1, 1);
            EXPECT_EQ(contents<std::uint32_t>(out), std::vector<std::uint32_t>(a.out.begin(), a.out.end()))
                << "width " << width;
        }
    }
}

TEST(Stream, layout_gives_the_known_answers) {
    const Engine engine;
    for (const auto& a : layout_answers()) {
        std::vector<std::uint32_t> host(4), device(4);
        if (a.block < end_of_stream / 4) {
            for (std::uint64_t i = 0; i < 4; ++i) host[i] = word(a.stream, 4 * a.block + i);
            fill_words(engine, a.stream, 4 * a.block, device);
            EXPECT_EQ(device, a.words) << a.block;
        } else {
            host = {};
            for (const std::uint32_t w :
                 words(device::clr_draw(static_cast<std::uint32_t>(a.stream.generator),
                                        {a.stream.seed, a.stream.id, static_cast<std::uint32_t>(a.stream.domain)}, a.block)))
                host.push_back(w);
        }
        EXPECT_EQ(host, a.words) << a.block;
    }
}

TEST(Stream, domains_ids_and_seeds_share_no_numbers) {
    for (const auto generator : {Generator::philox, Generator::pcg4d3x})
        for (const Stream& other :
             {Stream{2, 0, generator}, Stream{1, 1, generator}, Stream{1, 0, generator, Domain::error}})
            for (std::uint64_t i = 0; i < 64; ++i) EXPECT_NE(word({1, 0, generator}, i), word(other, i));
}

TEST(Stream, normals_are_the_vectors_normals) {
    for (const auto& v : theory("normal_from_u32")) {
        const double want = v["z"], got = device::clr_normal(v["h"]);
        EXPECT_LE(std::abs(got - want), std::min(8 * ulp(want), 6e-7 * std::abs(want))) << v;
        EXPECT_NEAR(reference_normal(v["h"]), want, 4e-15 * std::abs(want)) << v;  // the reference is one
    }
}

TEST(Stream, rational_quantile_is_the_vectors_rational) {
    const auto& r = theory("normal_rational_f32");
    for (const double w : {0.0, 0.5, 2.0, 7.0, 15.0, 21.4}) {
        const auto tail = [w] { return 0.5 * (1 - std::sqrt(-std::expm1(-w))); };
        const double p = w < 1 ? tail() : 0.5 * std::exp(-w) / (1 + std::sqrt(-std::expm1(-w)));
        const auto h = static_cast<std::uint32_t>(std::min(p * 0x1p32, 0x1p31 - 1));
        const double k = 2.0 * h + 1, x = (0x1p32 - k) * 0x1p-32, exact_w = -std::log(4 * k * 0x1p-33 * (1 - k * 0x1p-33));
        double n = 0, d = 0;
        for (std::size_t i = r["N_ascending"].size(); i-- > 0;) n = n * exact_w + r["N_ascending"][i].get<double>();
        for (std::size_t i = r["D_ascending"].size(); i-- > 0;) d = d * exact_w + r["D_ascending"][i].get<double>();
        EXPECT_NEAR(device::clr_normal(h), -x * n / d, 6e-7 * x * n / d) << "w " << w;
    }
}

TEST(Stream, normals_are_within_8_ulp_and_6e_7) {
    const Worst worst = worst_of(device::clr_normal);
    EXPECT_TRUE(accurate(worst)) << worst.ulps << " ulp at word " << worst.at << ", " << worst.relative << " relative";
    RecordProperty("worst_ulp", std::to_string(worst.ulps));
    RecordProperty("worst_relative", std::to_string(worst.relative));
}

TEST(Stream, accuracy_test_rejects_a_collapsed_tail_and_a_wrong_coefficient) {
    EXPECT_FALSE(accurate(worst_of([](std::uint32_t h) { return device::clr_normal(h & ~0xffu); })));
    EXPECT_FALSE(accurate(worst_of([](std::uint32_t h) { return device::clr_normal(h) * (1 + 8e-7f); })));
}

TEST(Stream, draws_are_open_and_symmetric) {
    using namespace device;
    each_tested_word([](std::uint32_t h) {
        ASSERT_EQ(clr_normal(~h), -clr_normal(h)) << h;
        ASSERT_EQ(clr_uniform(~h), 1 - clr_uniform(h)) << h;
        ASSERT_EQ(clr_normal_double(~h, ~h), -clr_normal_double(h, h)) << h;
        ASSERT_EQ(clr_uniform_double(~h, ~h), 1 - clr_uniform_double(h, h)) << h;
        ASSERT_NE(clr_normal(h), 0) << h;
    });
    EXPECT_EQ(clr_uniform(0), 0x1p-24f);
    EXPECT_EQ(clr_uniform(~0u), 1 - 0x1p-24f);
    EXPECT_EQ(clr_uniform_double(0, 0), 0x1p-53);
    EXPECT_EQ(clr_uniform_double(~0u, ~0u), 1 - 0x1p-53);
    EXPECT_NEAR(clr_normal(0), -6.3379577545537895, 6.4e-7 * 6);
    EXPECT_GT(clr_normal(0x80000000u), 0);
    EXPECT_LT(clr_normal(0x80000000u), 3e-10f);
}

TEST(Stream, double_normals_are_within_2e_15) {
    double worst = 0;
    const auto compare = [&worst](std::uint64_t h) {
        const bool negative = h >> 63 == 0;
        const std::uint64_t k = 2 * (negative ? h : ~h) + 1;
        const double p = static_cast<double>(k) * 0x1p-65;
        const double x = static_cast<double>(0 - k) * 0x1p-64;
        const double want = 1.4142135623730951 * (p < 0.25 ? boost::math::erfc_inv(2 * p) : boost::math::erf_inv(x));
        const double got = device::clr_normal_double(static_cast<std::uint32_t>(h), static_cast<std::uint32_t>(h >> 32));
        worst = std::max(worst, std::abs(std::abs(got) / want - 1));
        ASSERT_EQ(got < 0, negative);
    };
    for (std::uint64_t i = 0; i < 200'000; ++i) compare(i * 92233720368547u + i);
    for (std::uint64_t i = 0; i < 2000; ++i) compare(i);
    for (int shift = 0; shift < 63; ++shift) compare(std::uint64_t{1} << shift);
    EXPECT_LE(worst, 2e-15);
}

namespace {

/// erfcinv(2 p) = erfinv(2 q) for p + q = 1/2.
double inverse_error_function(double p, double q) {
    const auto z = device::clr_normal_magnitude_double(p, q);
    return 0.70710678118654752 * (z.n / z.d);
}

}  // namespace

// 2e-15 is the quantile's bound; one rounding more for the product.
TEST(Stream, double_quantile_is_the_vectors_erfinv_and_erfcinv) {
    constexpr double bound = 2e-15 + 0x1p-53;
    double worst = 0;
    for (const auto& v : theory("erfinv")) {
        const double y = std::fabs(v.at("y").get<double>()), want = std::fabs(v.at("erfinv").get<double>());
        if (want == 0) continue;
        worst = std::max(worst, std::fabs(inverse_error_function((1 - y) / 2, y / 2) / want - 1));
    }
    for (const auto& v : theory("erfcinv")) {
        const double q = v.at("q"), lower = std::min(q, 2 - q), want = std::fabs(v.at("erfcinv").get<double>());
        if (want == 0) continue;
        worst = std::max(worst, std::fabs(inverse_error_function(lower / 2, (1 - lower) / 2) / want - 1));
    }
    EXPECT_LE(worst, bound);
    EXPECT_GT(std::fabs(inverse_error_function(0.25, 0.25 * (1 + 0x1p-48)) / inverse_error_function(0.25, 0.25) - 1), bound)
        << "planted fault: q off by 16 ulp";
}

TEST(Stream, normals_have_the_same_bits_in_every_shape_and_range) {
    constexpr std::size_t count = 2003;
    for (const auto generator : {Generator::philox, Generator::pcg4d3x}) {
        const Stream stream{3, 5, generator};
        for (const auto& shape : all_shapes()) {
            const Engine engine(shape.options);
            for (const std::uint64_t first : starts) {
                std::vector<float> got(count);
                fill_normals(engine, stream, first, got);
                ASSERT_TRUE(same_bits(got, host_normals(stream, first, count))) << shape.name << " from " << first;
            }
        }
    }
}

namespace {

void expect_the_hosts_fills(const Shape& shape, const Stream& stream, std::uint64_t first, std::size_t count) {
    const Engine engine(shape.options);
    std::vector<std::uint32_t> w(count), want_w(count);
    std::vector<float> u(count), want_u(count), n(count), want_n(count);
    std::vector<double> d(count), want_d(count), z(count), want_z(count);
    fill_words(engine, stream, first, w);
    fill_uniforms(engine, stream, first, u);
    fill_normals(engine, stream, first, n);
    fill_uniforms(engine, stream, first, d);
    fill_normals(engine, stream, first, z);
    for (std::size_t i = 0; i < count; ++i) {
        want_w[i] = word(stream, first + i);
        want_u[i] = uniform(stream, first + i);
        want_n[i] = normal(stream, first + i);
        want_d[i] = uniform_double(stream, first + i);
        want_z[i] = normal_double(stream, first + i);
    }
    EXPECT_TRUE(same_bits(w, want_w)) << shape.name;
    EXPECT_TRUE(same_bits(u, want_u)) << shape.name;
    EXPECT_TRUE(same_bits(n, want_n)) << shape.name;
    EXPECT_TRUE(same_bits(d, want_d)) << shape.name;
    EXPECT_TRUE(same_bits(z, want_z)) << shape.name;
}

}  // namespace

TEST(Stream, all_fills_have_the_hosts_bits) {
    constexpr std::size_t count = 517;
    for (const Shape& shape : some_shapes())
        for (const std::uint64_t first : {std::uint64_t{0}, (std::uint64_t{1} << 33) - 259, end_of_stream - count})
            expect_the_hosts_fills(shape, {2, 9}, first, count);
}

TEST(StreamSmall, every_kernel) {
    for (const auto generator : {Generator::philox, Generator::pcg4d3x})
        for (const Shape& shape : smallest_shapes()) expect_the_hosts_fills(shape, {2, 9, generator}, 3, 21);
}

TEST(Stream, kernels_are_clean_under_oclgrind) { expect_clean_under_oclgrind("stream_test", "StreamSmall.*"); }

TEST(Stream, fills_views_with_gaps_and_leaves_the_gaps_alone) {
    const Engine engine;
    const auto want = host_normals({1}, 7, 90);
    const Buffer pixels = Buffer::zeroed(engine, (5 + 4 * 30) * sizeof(float));
    wait(Event(fill_normals(engine, {1}, 7, {pixels.mem(), 5, 90, 4, 3})));
    const auto got = contents<float>(pixels);
    for (std::size_t i = 0; i < 30; ++i) {
        for (std::size_t c = 0; c < 3; ++c) EXPECT_EQ(got[5 + 4 * i + c], want[3 * i + c]);
        EXPECT_EQ(got[5 + 4 * i + 3], 0);
    }
    for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(got[i], 0);
}

TEST(Stream, bad_arguments_are_refused_by_name) {
    const Engine engine;
    std::vector<float> out(4);
    refused([&] { fill_normals(engine, {1ull << 32, 0, Generator::pcg4d3x}, 0, out); }, "seed: expected");
    refused([&] { fill_normals(engine, {1, 0, Generator::philox, static_cast<Domain>(16)}, 0, out); }, "domain: expected");
    refused([&] { fill_normals(engine, {1}, end_of_stream - 3, out); }, "range: expected");
    refused([&] { word({1}, end_of_stream); }, "range: expected");
    refused([&] { fill_normals(engine, {1}, 0, View{}); }, "out: expected");
    const Buffer small(engine, 16);
    refused([&] { fill_normals(engine, {1}, 0, View{small.mem(), 1, 4}); }, "out: expected");
    refused([&] { fill_normals_double(engine, {1}, 0, View{small.mem(), 0, 3}); }, "out: expected");
    refused([&] { fill_normals(engine, {1}, 0, View{small.mem(), 0, 4, 0, 1}); }, "out: expected a stride");
    const View wraps{small.mem(), ~std::uint64_t{0} - 3, 8}, endless{small.mem(), 0, ~std::uint64_t{0} / 4 + 2, 4, 1};
    refused([&] { fill_normals(engine, {1}, 0, wraps); }, "out: expected a view inside its buffer of 4 elements");
    refused([&] { histogram(engine, wraps, {-1, 1, 4}); }, "values: expected a view inside its buffer of 4 elements");
    refused([&] { histogram(engine, endless, {-1, 1, 4}); }, "values: expected a view inside its buffer of 4 elements");
    refused([&] { error_samples(engine, Canonical{1, 0, 1}, {1}, 0, wraps); }, "out: expected a view inside its buffer");
}

// Faults that the bit comparisons above must catch, each planted into the device's source.
TEST(Stream, bit_comparison_catches_planted_faults) {
    const Engine engine;
    const auto differs = [&engine](std::string_view from, std::string_view to, std::uint64_t first, bool doubles) {
        constexpr std::uint64_t count = 2048;
        const Buffer out(engine, count * (doubles ? 8 : 4));
        const std::uint64_t per_block = doubles ? 2 : 4, blocks = count / per_block;
        RawKernel(engine, replaced(flatten_kernel("stream"), from, to),
                  doubles ? "clr_fill_normals_double" : "clr_fill_normals", "-DCLR_GENERATOR=CLR_PHILOX")
            .arg(out)
            .arg(device::clr_layout{0, 1, 1})
            .arg(device::clr_stream{1, 0, 0})
            .arg(cl_ulong{first})
            .arg(cl_ulong{count})
            .arg(cl_ulong{first / per_block})
            .arg(device::clr_range{blocks, blocks / static_cast<std::uint64_t>(engine.width())})
            .run(1, 1);
        if (!doubles) return !same_bits(contents<float>(out), host_normals({1}, first, count));
        std::vector<double> want(count);
        for (std::size_t i = 0; i < count; ++i) want[i] = normal_double({1}, first + i);
        return !same_bits(contents<double>(out), want);
    };
    EXPECT_FALSE(differs("kernel", "kernel", 0, false));
    EXPECT_FALSE(differs("kernel", "kernel", 0, true));
    EXPECT_FALSE(differs("kernel", "kernel", std::uint64_t{1} << 34, false));
    EXPECT_TRUE(differs("#define clr_fma(a, b, c) fma(a, b, c)", "#define clr_fma(a, b, c) ((a) * (b) + (c))", 0, false));
    EXPECT_TRUE(differs("FP_CONTRACT OFF", "FP_CONTRACT ON", 0, true));
    EXPECT_TRUE(differs("(clr_uint)((clr_u32)(first >> 32))", "(clr_uint)(0u)", std::uint64_t{1} << 34, false));
    EXPECT_TRUE(differs("(clr_u32)first)", "(clr_u32)first & 0x7fffffffu)", std::uint64_t{1} << 33, false));
    EXPECT_TRUE(differs("key1 + 9 * step1", "key1 + 8 * step1", 0, false));
}
