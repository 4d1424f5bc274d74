// A program with a queue and buffers of its own: raw cl_mem views, events in and out.
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

#include <clratio/clratio.hpp>

#include <cstdio>
#include <vector>

// One more batch of interleaved RGBA, alpha skipped, and the picture so far, in one launch. Nothing waits.
cl_event add_and_show(clratio::Moments& sum, cl_mem m, cl_mem t, cl_mem tau, cl_mem out, cl_event rendered) {
    const auto colours = [&](cl_mem mem) { return clratio::View{mem, 0, sum.size(), 4, 3}; };
    const clratio::Batch batch{colours(m), colours(t)};
    const clratio::View tau_of_each_channel{tau, 0, sum.size(), 0, 3};
    return clratio::add_and_combine(sum, {&batch, 1}, tau_of_each_channel, {colours(out), {}, nullptr}, {}, {&rendered, 1});
}

namespace {

constexpr std::size_t pixels = 1000;

struct Device {
    cl_context context;
    cl_command_queue queue;
};

Device own_device() {
    const clratio::Engine pick;  // any device will do here; a real program has its own
    const cl_device_id id = pick.device();
    const cl_context context = clCreateContext(nullptr, 1, &id, nullptr, nullptr, nullptr);
    return {context, clCreateCommandQueue(context, id, CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE, nullptr)};
}

std::vector<float> rgba(float colour) {
    std::vector<float> values(4 * pixels, colour);
    for (std::size_t p = 0; p < pixels; ++p) values[4 * p + 3] = -1;
    return values;
}

cl_mem buffer(const Device& d, std::vector<float> values) {
    return clCreateBuffer(d.context, CL_MEM_READ_WRITE | CL_MEM_COPY_HOST_PTR, values.size() * sizeof(float), values.data(),
                          nullptr);
}

cl_event write(const Device& d, cl_mem to, const std::vector<float>& values) {
    cl_event done = nullptr;
    clEnqueueWriteBuffer(d.queue, to, CL_FALSE, 0, values.size() * sizeof(float), values.data(), 0, nullptr, &done);
    return done;
}

// Alpha as it was; the ratio of the means is 1/2, and tau is 2, 4, 8.
std::size_t count_wrong(const std::vector<float>& result) {
    std::size_t wrong = 0;
    for (std::size_t p = 0; p < pixels; ++p)
        for (std::size_t c = 0; c < 4; ++c) wrong += result[4 * p + c] != (c == 3 ? -1 : static_cast<float>(1 << c));
    return wrong;
}

}  // namespace

int main() {
    const Device d = own_device();
    const cl_mem m = buffer(d, rgba(0)), t = buffer(d, rgba(0.5f)), tau = buffer(d, {2, 4, 8}), out = buffer(d, rgba(9));
    clratio::Moments sum{clratio::Engine{d.queue}, 3 * pixels};

    const auto rendered = rgba(0.25f);
    const cl_event written = write(d, m, rendered), shown = add_and_show(sum, m, t, tau, out, written);
    std::vector<float> result(4 * pixels);
    clEnqueueReadBuffer(d.queue, out, CL_TRUE, 0, result.size() * sizeof(float), result.data(), 1, &shown, nullptr);

    for (const cl_event event : {written, shown}) clReleaseEvent(event);
    for (const cl_mem mem : {m, t, tau, out}) clReleaseMemObject(mem);
    clReleaseCommandQueue(d.queue);
    clReleaseContext(d.context);
    const std::size_t wrong = count_wrong(result);
    std::printf("%zu of %zu values wrong\n", wrong, result.size());
    return wrong != 0;
}
