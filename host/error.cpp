#include "clratio/error.hpp"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "clratio/device/error.h"
#include "draws.hpp"

namespace clratio {
namespace {

void require(bool holds, const char* name, const char* expected, double got) {
    if (!holds) throw InvalidArgument(std::string("error model: ") + name, expected, std::to_string(got));
}

void check_model(const ErrorModel& e) {
    require(std::isfinite(e.mu), "mu", "a finite number", e.mu);
    require(std::isfinite(e.tau), "tau", "a finite number", e.tau);
    require(std::isfinite(e.sigma_m) && e.sigma_m >= 0, "sigma_m", "a finite number >= 0", e.sigma_m);
    require(std::isfinite(e.sigma_t) && e.sigma_t >= 0, "sigma_t", "a finite number >= 0", e.sigma_t);
    require(std::abs(e.rho) <= 1, "rho", "a number in [-1, 1]", e.rho);
    require(e.n >= 1, "n", "at least 1", static_cast<double>(e.n));
}

// rho a b - c d, |rho| <= 1, within a few ulp, also where it cancels (Kahan's difference of products, with rho a to its last
// bit).
double difference_of_products(double rho, double a, double b, double c, double d) {
    const double scaled = rho * a, lost = std::fma(rho, a, -scaled);
    const double cd = c * d, error = std::fma(-c, d, cd);
    return std::fma(scaled, b, -cd) + (error + lost * b);
}

constexpr int no_exponent = -1'000'000;  // of 0: below that of any number, and sums of it are no overflow

int exponent_of(double x) { return x == 0 ? no_exponent : std::ilogb(x); }

// r sigma_m - mu sigma_t / c, on numbers near 1, so that no product overflows or vanishes.
double slope_term(double r, double sigma_m, double mu, double sigma_t, double c) {
    const int c_scale = exponent_of(c), t_scale = exponent_of(sigma_t) - c_scale;
    const int scale = std::max(exponent_of(sigma_m), exponent_of(mu) + t_scale);
    if (scale <= no_exponent / 2) return 0;
    const int left = exponent_of(sigma_m) - scale, right = exponent_of(mu) + t_scale - scale;  // one of them is 0
    const auto near_1 = [](double x) { return x == 0 ? 0 : std::scalbn(x, -std::ilogb(x)); };
    const double unit_c = std::scalbn(c, -c_scale);
    const double difference = difference_of_products(r, std::scalbn(near_1(sigma_m), left), unit_c,
                                                     std::scalbn(near_1(mu), right), near_1(sigma_t));
    return std::scalbn(difference / unit_c, scale);
}

}  // namespace

Canonical canonical(const ErrorModel& e) {
    check_model(e);
    const double c = e.tau == 0 ? 1 : e.tau;
    const double scale = std::sqrt(static_cast<double>(e.n));
    const double r = std::copysign(1.0, c) * e.rho;
    const Canonical out{e.sigma_t / std::abs(c) / scale, slope_term(r, e.sigma_m, e.mu, e.sigma_t, std::abs(c)) / scale,
                        e.sigma_m * std::sqrt((1 - r) * (1 + r)) / scale};
    require(std::isfinite(out.s), "sigma_t / |tau|", "a number below overflow", out.s);
    require(std::isfinite(out.a), "mu sigma_t / |tau|", "a number below overflow", out.a);
    return out;
}

Canonical monte_carlo_canonical(const ErrorModel& e) {
    check_model(e);
    return {0, 0, e.sigma_m / std::sqrt(static_cast<double>(e.n))};
}

device::clr_canonical to_float(const Canonical& c) {
    const device::clr_canonical f{static_cast<float>(c.s), static_cast<float>(c.a), static_cast<float>(c.b)};
    for (const auto& [name, value] : {std::pair{"s", f.s}, {"a", f.a}, {"b", f.b}})
        require(std::isfinite(value), name, "a number that float can hold", value);
    return f;
}

void check_law(const Canonical& c) {
    require(std::isfinite(c.s) && c.s >= 0, "s", "a finite number >= 0", c.s);
    require(std::isfinite(c.a), "a", "a finite number", c.a);
    require(std::isfinite(c.b) && c.b >= 0, "b", "a finite number >= 0", c.b);
}

device::clr_stream error_stream(Stream stream) {
    stream.domain = Domain::error;
    return device_stream(stream);
}

namespace {

template <class Law>
cl_event samples(const Engine& engine, const char* kernel, const Law& law, const BlockRange& blocks, const Stream& stream,
                 std::uint64_t first, View out, std::span<const cl_event> wait_list) {
    return Launch(engine, "error", kernel, generator_option(stream.generator))
        .view(out)
        .arg(law)
        .arg(error_stream(stream))
        .arg(cl_ulong{first})
        .arg(cl_ulong{out.count})
        .arg(cl_ulong{blocks.first})
        .after(wait_list)
        .run_ranges(blocks.count)
        .give();
}

device::clr_words block(const Stream& stream, std::uint64_t block) {
    return device::clr_draw(static_cast<std::uint32_t>(stream.generator), error_stream(stream), block);
}

}  // namespace

cl_event error_samples(const Engine& engine, const Canonical& law, const Stream& stream, std::uint64_t first, View out,
                       std::span<const cl_event> wait_list) {
    check_law(law);
    check_range(first, out.count);
    check_output("out", out, out.count);
    const auto blocks = blocks_of(first, std::max<std::uint64_t>(1, out.count), 2, engine.width());
    return samples(engine, "clr_error_samples", to_float(law), blocks, stream, first, out, wait_list);
}

cl_event error_samples_double(const Engine& engine, const Canonical& law, const Stream& stream, std::uint64_t first,
                              View out, std::span<const cl_event> wait_list) {
    check_law(law);
    require_fp64(engine, "double samples");
    check_range(first, out.count);
    check_output("out", out, out.count, sizeof(double));
    const auto blocks = blocks_of(first, std::max<std::uint64_t>(1, out.count), 1, engine.width());
    return samples(engine, "clr_error_samples_double", law, blocks, stream, first, out, wait_list);
}

void error_samples(const Engine& engine, const Canonical& law, const Stream& stream, std::uint64_t first,
                   std::span<float> out) {
    fill_in_parts(engine, first, out,
                  [&](View part, std::uint64_t at) { return error_samples(engine, law, stream, at, part); });
}

void error_samples(const Engine& engine, const Canonical& law, const Stream& stream, std::uint64_t first,
                   std::span<double> out) {
    fill_in_parts(engine, first, out,
                  [&](View part, std::uint64_t at) { return error_samples_double(engine, law, stream, at, part); });
}

float error_sample(const Canonical& law, const Stream& stream, std::uint64_t index) {
    check_law(law);
    check_range(index, 1);
    const auto w = block(stream, index / 2);
    return index % 2 ? device::clr_error_sample(to_float(law), w.w2, w.w3)
                     : device::clr_error_sample(to_float(law), w.w0, w.w1);
}

double error_sample_double(const Canonical& law, const Stream& stream, std::uint64_t index) {
    check_law(law);
    check_range(index, 1);
    const auto w = block(stream, index);
    return device::clr_error_sample_double(law, w.w0, w.w1, w.w2, w.w3);
}

}  // namespace clratio
