// A user's own kernel that draws its own numbers: pi from points in the unit square, four lanes at a time.
#include <clratio/engine.hpp>
#include <clratio/stream.hpp>
#include <cstdio>
#include <string>
#include <vector>

// Each work-item draws `blocks` blocks for each lane. Block b of the stream holds two points.
constexpr const char* source = R"(
kernel void count_inside(global uint* inside, ulong seed, uint blocks) {
    clr_stream stream;
    stream.seed = seed;
    stream.id = 0;
    stream.domain = CLR_DOMAIN_USER;
    uint count = 0;
    for (uint i = 0; i < blocks; ++i) {
        const ulong block = (get_global_id(0) * blocks + i) * CLR_WIDTH;
        const clr_words w = clr_draw(CLR_PHILOX, stream, block);
        const clr_real x0 = clr_uniform(w.w0), y0 = clr_uniform(w.w1), x1 = clr_uniform(w.w2), y1 = clr_uniform(w.w3);
        float radius0[CLR_WIDTH], radius1[CLR_WIDTH];
        clr_store(x0 * x0 + y0 * y0, radius0);
        clr_store(x1 * x1 + y1 * y1, radius1);
        for (int lane = 0; lane < CLR_WIDTH; ++lane) count += (radius0[lane] < 1.0f) + (radius1[lane] < 1.0f);
    }
    inside[get_global_id(0)] = count;
})";

int main() {
    const clratio::Engine engine;
    const std::string text = clratio::device_source() + source;
    const char* strings = text.c_str();
    const cl_device_id device = engine.device();
    cl_program program = clCreateProgramWithSource(engine.context(), 1, &strings, nullptr, nullptr);
    if (clBuildProgram(program, 1, &device, "-cl-std=CL1.2 -DCLR_WIDTH=4 -DCLR_GROUPED=0 -DCLR_FP64=0", nullptr, nullptr) !=
        CL_SUCCESS)
        return 1;
    cl_kernel kernel = clCreateKernel(program, "count_inside", nullptr);

    const std::size_t work_items = 64;
    const cl_uint blocks = 1000;
    const cl_ulong seed = 1;
    std::vector<cl_uint> inside(work_items);
    cl_mem buffer = clCreateBuffer(engine.context(), CL_MEM_WRITE_ONLY, work_items * sizeof(cl_uint), nullptr, nullptr);
    clSetKernelArg(kernel, 0, sizeof buffer, &buffer);
    clSetKernelArg(kernel, 1, sizeof seed, &seed);
    clSetKernelArg(kernel, 2, sizeof blocks, &blocks);
    clEnqueueNDRangeKernel(engine.queue(), kernel, 1, nullptr, &work_items, nullptr, 0, nullptr, nullptr);
    clEnqueueReadBuffer(engine.queue(), buffer, CL_TRUE, 0, work_items * sizeof(cl_uint), inside.data(), 0, nullptr,
                        nullptr);

    // The same draws one by one on the host.
    unsigned long long on_device = 0, on_host = 0;
    for (const cl_uint count : inside) on_device += count;
    const std::uint64_t points = 2 * 4 * blocks * work_items;
    for (std::uint64_t i = 0; i < points; ++i) {
        const float x = clratio::uniform({.seed = seed}, 2 * i), y = clratio::uniform({.seed = seed}, 2 * i + 1);
        on_host += x * x + y * y < 1.0f;
    }
    std::printf("pi is about %.4f; device and host counted %llu and %llu\n",
                4.0 * static_cast<double>(on_device) / static_cast<double>(points), on_device, on_host);
    clReleaseMemObject(buffer);
    clReleaseKernel(kernel);
    clReleaseProgram(program);
    return on_device == on_host ? 0 : 1;
}
