// The device headers in a user's own C++ and in a user's own kernel: the same bits as the library's kernels, and as known
// answers. With PLANTED_FAULT, logarithms are the C++ library's: right, but of other bits.
#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#include <CL/opencl.hpp>

#include <clratio/clratio.hpp>
#include <clratio/device/exponential.h>
#include <clratio/device/ratio.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstdio>
#include <vector>

namespace {

using namespace clratio::device;

constexpr std::size_t values = 4096;
constexpr int batches = 5;
constexpr float tau = 0.7f;

// Uniform in (0, 1), from a 64-bit congruential generator (Knuth's MMIX).
std::vector<float> uniform(std::uint64_t seed) {
    std::vector<float> u(values);
    for (float& value : u) {
        seed = seed * 6364136223846793005u + 1442695040888963407u;
        value = (static_cast<float>(seed >> 41) + 0.5f) * 0x1p-23f;
    }
    return u;
}

struct Value {
    clr_moments moments{};
    clr_two weight{};
    std::uint32_t added = 0;

    void add(float m, float t) {
        const clr_two one{1, 0}, sum = clr_two_add(weight, one);
        moments = clr_moments_add(moments, m, t, clr_entry_make(weight, one, sum), added++);
        weight = sum;
    }
    float estimate() const {
        const clr_moments settled = clr_moments_settle(moments);
        return clr_divide_means(settled.m, settled.t, tau, CLR_ZERO_MC_MEAN).value;
    }
};

std::size_t plane_differs(const clratio::Moments& sum, cl_mem clratio::StatePlanes::*plane, const std::vector<Value>& host,
                          clr_two clr_moments::*member) {
    const auto bits = sum.bits(plane);
    std::size_t count = 0;
    for (std::size_t i = 0; i < values; ++i) {
        const clr_two two = host[i].moments.*member;
        count += bits[i] != std::bit_cast<std::uint32_t>(two.hi) || bits[values + i] != std::bit_cast<std::uint32_t>(two.lo);
    }
    return count;
}

std::size_t moments_differ() {
    const clratio::Engine engine;
    clratio::Moments sum{engine, values, {.nonfinite = clratio::NonFinite::propagate}};
    std::vector<Value> host(values);
    for (std::uint64_t k = 0; k < batches; ++k) {
        const auto m = uniform(2 * k + 1), t = uniform(2 * k + 2);
        sum.add(m, t);
        for (std::size_t i = 0; i < values; ++i) host[i].add(m[i], t[i]);
    }
    using Planes = clratio::StatePlanes;
    std::size_t count = plane_differs(sum, &Planes::m, host, &clr_moments::m);
    count += plane_differs(sum, &Planes::t, host, &clr_moments::t);
    count += plane_differs(sum, &Planes::mm, host, &clr_moments::mm);
    count += plane_differs(sum, &Planes::tt, host, &clr_moments::tt);
    count += plane_differs(sum, &Planes::mt, host, &clr_moments::mt);
    const auto out = clratio::combine(sum, tau);
    for (std::size_t i = 0; i < values; ++i)
        count += std::bit_cast<std::uint32_t>(out.estimate[i]) != std::bit_cast<std::uint32_t>(host[i].estimate());
    return count;
}

// A kernel of the user's own on the same headers.
std::vector<float> logs_on_device(const std::vector<float>& x) {
    const clratio::Engine engine;
    const cl::Context context(engine.context(), true);
    const cl::CommandQueue queue(engine.queue(), true);
    const cl::Program program(context, clratio::device_source() + R"(
        kernel void logs(global float* x) { x[get_global_id(0)] = clr_log(x[get_global_id(0)]); })");
    program.build("-DCLR_WIDTH=1 -DCLR_GROUPED=0 -DCLR_FP64=0");
    cl::Kernel kernel(program, "logs");
    std::vector<float> y = x;
    const cl::Buffer buffer(queue, y.begin(), y.end(), false);
    kernel.setArg(0, buffer);
    queue.enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(y.size()));
    cl::copy(queue, buffer, y.begin(), y.end());
    return y;
}

float log_on_host(float x) {
#if defined(PLANTED_FAULT)
    return std::log(x);
#else
    return clr_log(x);
#endif
}

std::size_t logs_differ() {
    const auto x = uniform(99), y = logs_on_device(x);
    std::size_t count = 0;
    for (std::size_t i = 0; i < values; ++i)
        count += std::bit_cast<std::uint32_t>(y[i]) != std::bit_cast<std::uint32_t>(log_on_host(x[i]));
    return count;
}

// 1/3 as a pair, what 0.1f * 0.1f leaves beyond a float, e and ln 10.
std::size_t known_answers_differ() {
    const clr_two third = clr_two_divide({1, 0}, {3, 0});
    const std::array<float, 5> got{third.hi, third.lo, clr_two_product(0.1f, 0.1f).lo, clr_exp(1.0f), clr_log(10.0f)};
    const std::array<std::uint32_t, 5> known{0x3eaaaaab, 0xb22aaaab, 0xafe147ae, 0x402df854, 0x40135d8e};
    std::size_t count = 0;
    for (std::size_t i = 0; i < got.size(); ++i) {
        const auto bits = std::bit_cast<std::uint32_t>(got[i]);
        if (bits != known[i]) std::printf("known answer %zu: %08x, not %08x\n", i, bits, known[i]);
        count += bits != known[i];
    }
    return count;
}

}  // namespace

int main() {
    const std::size_t moments = moments_differ(), logs = logs_differ(), known = known_answers_differ();
    std::printf("%zu of %zu moments and estimates differ\n%zu of %zu logarithms differ\n", moments, 6 * values, logs,
                values);
    return moments + logs + known != 0;
}
