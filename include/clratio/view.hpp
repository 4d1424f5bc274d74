// Values in a device buffer, without owning or copying them.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

#ifndef CL_TARGET_OPENCL_VERSION
#define CL_TARGET_OPENCL_VERSION 300
#endif
#include <CL/cl.h>

namespace clratio {

/// `count` float32 values in a buffer. Value i stands at element offset + (i / channels) * stride + i % channels:
/// interleaved RGBA with the alpha skipped is {mem, 0, 3 * pixels, 4, 3}. stride == channels: contiguous.
/// stride 0 repeats the same `channels` numbers for every pixel (as a tau for each channel).
/// Units: elements. The view does not retain the buffer.
struct View {
    cl_mem mem = nullptr;
    std::uint64_t offset = 0;
    std::uint64_t count = 0;
    std::uint32_t stride = 1;
    std::uint32_t channels = 1;

    /// Whether all that the view touches lies in so many elements, for any offset, count and stride.
    bool fits(std::uint64_t elements) const {
        if (count == 0 || channels == 0) return offset <= elements;
        if (stride != 0 && (count - 1) / channels > elements / stride) return false;
        const std::uint64_t length = View{mem, 0, count, stride, channels}.end();
        return length <= elements && offset <= elements - length;
    }

    /// One past the last element the view touches.
    std::uint64_t end() const {
        if (count == 0) return offset;
        const std::uint64_t last_pixel = (count - 1) / channels;
        const std::uint64_t widest = last_pixel > 0 && stride < channels ? channels - 1 : (count - 1) % channels;
        return offset + last_pixel * stride + widest + 1;
    }
};

/// A view of any wrapper whose call operator yields the cl_mem, as cl::Buffer's does.
template <class Buffer>
requires requires(const Buffer& b) {
    { b() } -> std::convertible_to<cl_mem>;
}
View view_of(const Buffer& buffer, std::uint64_t count, std::uint64_t offset = 0, std::uint32_t stride = 1,
             std::uint32_t channels = 1) {
    return {buffer(), offset, count, stride, channels};
}

}  // namespace clratio
