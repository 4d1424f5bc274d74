// A picture's size on the command line: 200x150.
#pragma once

#include <charconv>
#include <string>

#include "clratio/medium.hpp"
#include "tool.hpp"

namespace tool {

/// Errors: UsageError that names --size, also above `most_pixels`.
inline clratio::Frame frame_of(const std::string& text, std::uint64_t most_pixels) {
    clratio::Frame frame{0, 0};
    const char *at = text.data(), *const end = at + text.size();
    const auto number = [&](std::uint32_t& to) {
        const auto [next, error] = std::from_chars(at, end, to);
        const bool good = error == std::errc() && next != at && to >= 1 && to <= 65536;
        at = next;
        return good;
    };
    const bool good = number(frame.width) && at != end && *at++ == 'x' && number(frame.height) && at == end;
    if (!good || std::uint64_t{frame.width} * frame.height > most_pixels)
        throw UsageError(
            fmt::format("--size: expected WIDTHxHEIGHT of at most {} pixels, such as 200x150, got {}", most_pixels, text));
    return frame;
}

}  // namespace tool
