#include "progress_line.hpp"

#include <fmt/format.h>
#include <unistd.h>

namespace tool {
namespace {

constexpr auto erase_line = "\r\033[K";

}  // namespace

ProgressLine::ProgressLine() : terminal_(isatty(STDERR_FILENO) == 1) {}

void ProgressLine::show(const std::string& text) {
    if (!terminal_) return;
    fmt::print(stderr, "{}{}", erase_line, text);
    std::fflush(stderr);
    shown_ = true;
}

void ProgressLine::clear() {
    if (!shown_) return;
    fmt::print(stderr, "{}", erase_line);
    shown_ = false;
}

}  // namespace tool
