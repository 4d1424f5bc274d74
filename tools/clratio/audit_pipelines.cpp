#include "audit_pipelines.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tool::audit {
namespace {

// Giles, Approximating the erfinv function (GPU Computing Gems, 2011), single precision.
constexpr std::array centre{2.81022636e-08f, 3.43273939e-07f, -3.5233877e-06f, -4.39150654e-06f, 0.00021858087f,
                            -0.00125372503f, -0.00417768164f, 0.246640727f,    1.50140941f};
constexpr std::array tail{-0.000200214257f, 0.000100950558f, 0.00134934322f, -0.00367342844f, 0.00573950773f,
                          -0.0076224613f,   0.00943887047f,  1.00167406f,    2.83297682f};

float polynomial(const std::array<float, 9>& coefficients, float w) {
    float sum = 0;
    for (const float c : coefficients) sum = sum * w + c;
    return sum;
}

float inverse_erf(float x) {
    const float w = -std::log((1 - x) * (1 + x));
    return x * (w < 5 ? polynomial(centre, w - 2.5f) : polynomial(tail, std::sqrt(w) - 3));
}

// A bijection of 32 bits (Ettinger's lowbias32).
std::uint32_t hash(std::uint32_t x) {
    x = (x ^ x >> 16) * 0x7feb352du;
    x = (x ^ x >> 15) * 0x846ca68bu;
    return x ^ x >> 16;
}

}  // namespace

float literal_normal(std::uint32_t h) {
    const float xi = static_cast<float>(h) * 0x1p-32f;
    return 1.41421356f * inverse_erf(2 * xi - 1);
}

float literal_error_sample(const clratio::ErrorModel& model, std::uint32_t i) {
    const auto single = [](double v) { return static_cast<float>(v); };
    const float impulse = model.tau == 0, control = single(model.tau) + impulse;
    const float m = single(model.mu) + single(model.sigma_m) * literal_normal(hash(2 * i));
    const float t = single(model.tau) + single(model.sigma_t) * literal_normal(hash(2 * i + 1)) + impulse;
    return control * m / t - single(model.mu);
}

clratio::Histogram literal_histogram(const clratio::ErrorModel& model, std::uint64_t samples, clratio::Bins bins) {
    clratio::Histogram out;
    out.bins.resize(bins.count);
    out.lo = bins.lo;
    out.hi = bins.hi;
    const double width = (bins.hi - bins.lo) / bins.count;
    for (std::uint64_t i = 0; i < samples; ++i) {
        const double x = literal_error_sample(model, static_cast<std::uint32_t>(i));
        if (std::isnan(x))
            ++out.nonfinite;
        else if (x < bins.lo)
            ++out.underflow;
        else if (x >= bins.hi)
            ++out.overflow;
        else
            ++out.bins[std::min<std::size_t>(bins.count - 1, static_cast<std::size_t>((x - bins.lo) / width))];
    }
    return out;
}

}  // namespace tool::audit
