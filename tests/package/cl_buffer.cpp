// A program on CL/opencl.hpp, exceptions switched on: cl::Buffer through view_of, and two kinds of errors side by side.
#define CL_HPP_ENABLE_EXCEPTIONS
#define CL_HPP_TARGET_OPENCL_VERSION 120
#define CL_HPP_MINIMUM_OPENCL_VERSION 120
#include <CL/opencl.hpp>

#include <clratio/clratio.hpp>

#include <cstdio>
#include <vector>

// tau m / t for means that are on the device already, on the caller's queue.
cl::Event ratio(const cl::CommandQueue& queue, const cl::Buffer& m, const cl::Buffer& t, const cl::Buffer& tau,
                const cl::Buffer& out, std::uint64_t count) {
    const clratio::Engine engine{queue()};
    const auto view = [=](const cl::Buffer& buffer) { return clratio::view_of(buffer, count); };
    return cl::Event(clratio::combine(engine, view(m), view(t), view(tau), {view(out), {}, nullptr}));
}

namespace {

constexpr std::size_t values = 4097;

bool throws_cl_error(const cl::Context& context) {
    try {
        cl::Program(context, "kernel void broken( {", true);
    } catch (const cl::Error&) {
        return true;
    }
    return false;
}

bool throws_invalid_argument(const clratio::Engine& engine, clratio::View m, clratio::View shorter) {
    try {
        clratio::combine(engine, m, shorter, m, {m, {}, nullptr});
    } catch (const clratio::InvalidArgument&) {
        return true;
    }
    return false;
}

}  // namespace

int main() {
    const clratio::Engine pick;  // any device will do here; a real program has its own
    const cl::Device device(pick.device(), true);
    const cl::Context context(device);
    const cl::CommandQueue queue(context, device);
    const std::vector<float> ms(values, 3), ts(values, 4), taus(values, 2);
    std::vector<float> result(values);
    const auto buffer = [&](auto& from) { return cl::Buffer(queue, from.begin(), from.end(), false); };
    const cl::Buffer m = buffer(ms), t = buffer(ts), tau = buffer(taus), out = buffer(result);
    ratio(queue, m, t, tau, out, values).wait();
    cl::copy(queue, out, result.begin(), result.end());

    std::size_t wrong = 0;
    for (const float value : result) wrong += value != 1.5f;
    std::printf("%zu of %zu values wrong\n", wrong, result.size());
    const clratio::View some = clratio::view_of(m, values), fewer = clratio::view_of(t, values - 1);
    return wrong != 0 || !throws_cl_error(context) || !throws_invalid_argument(clratio::Engine{queue()}, some, fewer);
}
