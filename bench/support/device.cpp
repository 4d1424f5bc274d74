#include "device.hpp"

#include <algorithm>
#include <array>

namespace clratio::bench {
namespace {

constexpr auto source_of_limits = R"(
kernel void scale(global float* x, ulong vectors, ulong per_item) {
    const ulong begin = min(vectors, get_global_id(0) * per_item), end = min(vectors, begin + per_item);
    for (ulong i = begin; i < end; ++i) vstore16(vload16(i, x) * 1.0000001f, i, x);
}
kernel void move(global const float* x, global float* y, uint reads, uint writes, uint apart, ulong vectors, ulong per_item) {
    const ulong begin = min(vectors, get_global_id(0) * per_item), end = min(vectors, begin + per_item);
    for (ulong i = begin; i < end; ++i) {
        float16 s = 0.0f;
        for (uint k = 0; k < reads; ++k) s += vload16(i * reads + k, x);
        for (uint k = 0; k < writes; ++k) vstore16(s, i * apart + k, y);
    }
})";

cl_kernel limit_kernel(const Engine& engine, const char* name) {
    const char* source = source_of_limits;
    cl_program program = clCreateProgramWithSource(engine.context(), 1, &source, nullptr, nullptr);
    cl_device_id device = engine.device();
    clBuildProgram(program, 1, &device, "-cl-std=CL1.2", nullptr, nullptr);
    cl_kernel kernel = clCreateKernel(program, name, nullptr);
    clReleaseProgram(program);
    return kernel;
}

/// Runs a kernel of the limits over vectors of 16, in a contiguous range for each work-item; the last two arguments say so.
cl_event run(const Engine& engine, cl_kernel kernel, cl_uint first_free, cl_ulong vectors) {
    const std::size_t global = 8 * engine.info().compute_units, local = 1;
    const cl_ulong per_item = (vectors + global - 1) / global;
    clSetKernelArg(kernel, first_free, sizeof vectors, &vectors);
    clSetKernelArg(kernel, first_free + 1, sizeof per_item, &per_item);
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
    cl_kernel kernel = limit_kernel(engine, "scale");
    const cl_mem mem = x.mem();
    clSetKernelArg(kernel, 0, sizeof mem, &mem);
    finish(run(engine, kernel, 1, count / 16));
    for (auto _ : state) finish(run(engine, kernel, 1, count / 16));
    clReleaseKernel(kernel);
    report(state, count, 8 * count);
}

void mixed_limit(benchmark::State& state, std::uint64_t values, Mix mix) {
    const Engine engine;
    const std::uint64_t count = values / 16 * 16;
    const std::uint32_t apart = mix.in_place ? mix.reads : mix.writes;
    if (!fits(state, engine, 4 * count * (mix.reads + mix.writes), 4 * count * mix.reads)) return;
    const Array x(engine, count * mix.reads, 1.0f), y(engine, mix.in_place ? 16 : count * mix.writes, 0.0f);
    cl_kernel kernel = limit_kernel(engine, "move");
    const cl_mem from = x.mem(), to = mix.in_place ? x.mem() : y.mem();
    clSetKernelArg(kernel, 0, sizeof from, &from);
    clSetKernelArg(kernel, 1, sizeof to, &to);
    clSetKernelArg(kernel, 2, sizeof mix.reads, &mix.reads);
    clSetKernelArg(kernel, 3, sizeof mix.writes, &mix.writes);
    clSetKernelArg(kernel, 4, sizeof apart, &apart);
    finish(run(engine, kernel, 5, count / 16));
    for (auto _ : state) finish(run(engine, kernel, 5, count / 16));
    clReleaseKernel(kernel);
    report(state, count, 4 * count * (mix.reads + mix.writes));
}

}  // namespace clratio::bench
