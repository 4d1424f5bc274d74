// Options that errors and figures share, and how numbers are read and progress shown.
#pragma once

#include <cstdint>
#include <string>

#include "clratio/stream.hpp"
#include "command.hpp"
#include "error_counts.hpp"
#include "interrupt.hpp"
#include "progress_line.hpp"

namespace tool {

/// A whole number, 1000000 or 1e6; UsageError names the option.
std::uint64_t whole_number(const std::string& option, const std::string& text);

struct StreamOptions {
    std::string seed = "1", rng = "philox";
    std::uint32_t id = 0;

    void add_to(Command& command);
    clratio::Stream stream() const;
};

/// A bar for `total` samples, at least one, in several calls, and Ctrl-C in between: clratio::Cancelled out of the call.
class SampleProgress {
public:
    explicit SampleProgress(double total) : total_(total) {}

    /// For the next call, which will draw `count` samples.
    clratio::Progress next(std::uint64_t count);

private:
    double total_, before_ = 0, after_ = 0;
    ProgressLine line_;
    Interrupt interrupt_;
};

/// `work()`, with the library's complaints about arguments as what they are here: usage errors.
template <class Work> auto with_usage_errors(Work work) {
    try {
        return work();
    } catch (const clratio::InvalidArgument& e) {
        throw UsageError(e.what());
    }
}

}  // namespace tool
