// Owning OpenCL handles and checked calls; private to the library.
#pragma once

#include <utility>

#define CL_TARGET_OPENCL_VERSION 300
#include <CL/cl.h>

#include "clratio/exception.hpp"

namespace clratio {

const char* code_name(cl_int code);

inline void check(cl_int code, const char* call) {
    if (code != CL_SUCCESS) throw DeviceError(call, code);
}

/// Owns one reference to an OpenCL object.
template <class T, cl_int(CL_API_CALL* retain)(T), cl_int(CL_API_CALL* release)(T)> class Handle {
public:
    Handle() = default;
    explicit Handle(T owned) : value_(owned) {}
    Handle(const Handle& other) : value_(other.value_) {
        if (value_) retain(value_);
    }
    Handle(Handle&& other) noexcept : value_(std::exchange(other.value_, nullptr)) {}
    Handle& operator=(Handle other) noexcept {
        std::swap(value_, other.value_);
        return *this;
    }
    ~Handle() {
        if (value_) release(value_);
    }
    static Handle share(T borrowed) {
        check(retain(borrowed), "clRetain");
        return Handle(borrowed);
    }
    T get() const { return value_; }
    T give() { return std::exchange(value_, nullptr); }
    explicit operator bool() const { return value_ != nullptr; }

private:
    T value_ = nullptr;
};

using Context = Handle<cl_context, clRetainContext, clReleaseContext>;
using Queue = Handle<cl_command_queue, clRetainCommandQueue, clReleaseCommandQueue>;
using Program = Handle<cl_program, clRetainProgram, clReleaseProgram>;
using Kernel = Handle<cl_kernel, clRetainKernel, clReleaseKernel>;
using Memory = Handle<cl_mem, clRetainMemObject, clReleaseMemObject>;
using Event = Handle<cl_event, clRetainEvent, clReleaseEvent>;

}  // namespace clratio
