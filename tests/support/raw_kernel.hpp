// Runs a kernel from source text, past the library's own programs: for a user's kernels and for planted faults.
#pragma once

#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "clratio/engine.hpp"
#include "launch.hpp"

namespace clratio::test {

class RawKernel {
public:
    RawKernel(const Engine& engine, const std::string& source, const std::string& name, const std::string& options = "")
        : engine_(engine) {
        const char* text = source.c_str();
        program_ = Program(clCreateProgramWithSource(engine.context(), 1, &text, nullptr, nullptr));
        const std::string all =
            "-cl-std=CL1.2 -cl-fp32-correctly-rounded-divide-sqrt -DCLR_WIDTH=" + std::to_string(engine.width()) +
            " -DCLR_GROUPED=" + (engine.grouped() ? "1" : "0") + " -DCLR_FP64=1 " + options;
        const cl_device_id device = engine.device();
        if (clBuildProgram(program_.get(), 1, &device, all.c_str(), nullptr, nullptr) != CL_SUCCESS) {
            std::string log(100000, '\0');
            clGetProgramBuildInfo(program_.get(), device, CL_PROGRAM_BUILD_LOG, log.size(), log.data(), nullptr);
            throw std::runtime_error(log.c_str());
        }
        kernel_ = Kernel(clCreateKernel(program_.get(), name.c_str(), nullptr));
    }

    template <class T> RawKernel& arg(const T& value) {
        check(clSetKernelArg(kernel_.get(), next_++, sizeof value, &value), "clSetKernelArg");
        return *this;
    }
    RawKernel& arg(const Buffer& buffer) { return arg(buffer.mem()); }
    RawKernel& local(std::size_t bytes) {
        check(clSetKernelArg(kernel_.get(), next_++, bytes, nullptr), "clSetKernelArg");
        return *this;
    }

    void run(std::size_t global, std::size_t group) {
        check(clEnqueueNDRangeKernel(engine_.queue(), kernel_.get(), 1, nullptr, &global, &group, 0, nullptr, nullptr),
              "enqueue");
        check(clFinish(engine_.queue()), "clFinish");
        next_ = 0;
    }

private:
    Engine engine_;
    Program program_;
    Kernel kernel_;
    cl_uint next_ = 0;
};

/// The text with `from`, which must be in it, replaced by `to` everywhere.
inline std::string replaced(std::string text, std::string_view from, std::string_view to) {
    std::size_t at = text.find(from);
    if (at == std::string::npos) throw std::logic_error("no longer in the source: " + std::string(from));
    for (; at != std::string::npos; at = text.find(from, at + to.size())) text.replace(at, from.size(), to);
    return text;
}

template <class T> std::vector<T> contents(const Buffer& buffer) {
    std::vector<T> v(buffer.size() / sizeof(T));
    buffer.read(std::as_writable_bytes(std::span(v)));
    return v;
}

}  // namespace clratio::test
