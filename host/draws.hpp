// What all that draws from streams shares on the host: checks, and the blocks a range of draws touches. Private to the
// library.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string>

#include "clratio/error.hpp"
#include "clratio/stream.hpp"
#include "launch.hpp"

namespace clratio {

/// The stream as kernels take it. Errors: InvalidArgument for a seed or domain out of range.
device::clr_stream device_stream(const Stream& stream);

/// Refuses ranges that end beyond end_of_stream.
void check_range(std::uint64_t first, std::uint64_t count);

/// Refuses a law that is not finite, or whose s or b is negative.
void check_law(const Canonical& law);

void require_fp64(const Engine& engine, const char* what);

/// The build option that fixes a kernel's generator.
std::string generator_option(Generator generator);

/// The blocks, in whole vectors, that hold draws first .. first + count - 1 of `per_block` to a block; count > 0.
struct BlockRange {
    std::uint64_t first, count;
};
BlockRange blocks_of(std::uint64_t first, std::uint64_t count, std::uint64_t per_block, int width);

/// Calls fill(buffer, index, count) for parts of `out` that fit into one allocation, and waits.
template <class T, class Fill> void fill_in_parts(const Engine& engine, std::uint64_t first, std::span<T> out, Fill fill) {
    const std::uint64_t largest = std::max<std::uint64_t>(1, engine.info().largest_allocation / sizeof(T));
    check_range(first, out.size());
    for (std::uint64_t done = 0; done < out.size();) {
        const auto part = out.subspan(done, std::min<std::uint64_t>(largest, out.size() - done));
        const auto buffer = Buffer::onto_host(engine, std::as_writable_bytes(part));
        wait(Event(fill(View{buffer.mem(), 0, part.size()}, first + done)));
        buffer.publish();
        done += part.size();
    }
}

}  // namespace clratio
