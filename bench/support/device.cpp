#include "device.hpp"

#include <algorithm>
#include <array>

namespace clratio::bench {
namespace {

constexpr auto scaling_source = R"(
kernel void scale(global float* x, ulong vectors, ulong per_item) {
    const ulong begin = min(vectors, get_global_id(0) * per_item), end = min(vectors, begin + per_item);
    for (ulong i = begin; i < end; ++i) vstore16(vload16(i, x) * 1.0000001f, i, x);
})";

cl_kernel scaling_kernel(const Engine& engine) {
    const char* source = scaling_source;
    cl_program program = clCreateProgramWithSource(engine.context(), 1, &source, nullptr, nullptr);
    cl_device_id device = engine.device();
    clBuildProgram(program, 1, &device, "-cl-std=CL1.2", nullptr, nullptr);
    cl_kernel kernel = clCreateKernel(program, "scale", nullptr);
    clReleaseProgram(program);
    return kernel;
}

cl_event scale(const Engine& engine, cl_kernel kernel, cl_mem x, std::uint64_t count) {
    const std::size_t global = 8 * engine.info().compute_units, local = 1;
    const cl_ulong vectors = count / 16, per_item = (vectors + global - 1) / global;
    clSetKernelArg(kernel, 0, sizeof x, &x);
    clSetKernelArg(kernel, 1, sizeof vectors, &vectors);
    clSetKernelArg(kernel, 2, sizeof per_item, &per_item);
    cl_event done = nullptr;
    clEnqueueNDRangeKernel(engine.queue(), kernel, 1, nullptr, &global, &local, 0, nullptr, &done);
    return done;
}

}  // namespace

Array::Array(const Engine& engine, std::uint64_t count, float value) : count_(count) {
    cl_int code = CL_SUCCESS;
    mem_ = clCreateBuffer(engine.context(), CL_MEM_READ_WRITE, count * sizeof(float), nullptr, &code);
    if (code != CL_SUCCESS) {
        mem_ = nullptr;
        return;
    }
    cl_event done = nullptr;
    clEnqueueFillBuffer(engine.queue(), mem_, &value, sizeof value, 0, count * sizeof(float), 0, nullptr, &done);
    finish(done);
}

Array::~Array() {
    if (mem_) clReleaseMemObject(mem_);
}

void finish(cl_event event) {
    clWaitForEvents(1, &event);
    clReleaseEvent(event);
}

bool fits(benchmark::State& state, const Engine& engine, std::uint64_t bytes, std::uint64_t largest) {
    const auto& d = engine.info();
    if (bytes <= d.global_memory && largest <= d.largest_allocation) return true;
    state.SkipWithError(
        ("does not fit: " + std::to_string(bytes >> 20) + " MiB on a device of " + std::to_string(d.global_memory >> 20))
            .c_str());
    return false;
}

void report(benchmark::State& state, std::uint64_t items, std::uint64_t bytes) {
    const auto runs = static_cast<std::int64_t>(state.iterations());
    state.SetItemsProcessed(runs * static_cast<std::int64_t>(items));
    state.SetBytesProcessed(runs * static_cast<std::int64_t>(bytes));
}

void scaling_limit(benchmark::State& state, std::uint64_t bytes) {
    const Engine engine;
    const std::uint64_t count = std::min<std::uint64_t>(bytes / 8, engine.info().largest_allocation / 4) / 16 * 16;
    if (!fits(state, engine, 4 * count, 4 * count)) return;
    const Array x(engine, count, 1.0f);
    cl_kernel kernel = scaling_kernel(engine);
    finish(scale(engine, kernel, x.mem(), count));
    for (auto _ : state) finish(scale(engine, kernel, x.mem(), count));
    clReleaseKernel(kernel);
    report(state, count, 8 * count);
}

}  // namespace clratio::bench
