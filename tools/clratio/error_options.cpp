#include "error_options.hpp"
#include "command.hpp"

#include <algorithm>

namespace tool {

std::uint64_t whole_number(const std::string& option, const std::string& text) {
    if (const auto whole = whole_of(text)) return *whole;
    throw UsageError(fmt::format("{}: expected a whole number, such as 1000000 or 1e6, got {}", option, text));
}

void StreamOptions::add_to(Command& command) {
    command.option("--seed", seed, "Seed of the stream").type("WHOLE").shows_default();
    command.option("--stream", id, "Stream id of the first model; the next one has the next id").shows_default();
    command.option("--rng", rng, "philox, or pcg4d3x: faster, see docs/streams.md")
        .one_of({"philox", "pcg4d3x"})
        .type("WORD")
        .shows_default();
}

clratio::Stream StreamOptions::stream() const {
    return {.seed = whole_number("--seed", seed),
            .id = id,
            .generator = rng == "philox" ? clratio::Generator::philox : clratio::Generator::pcg4d3x};
}

namespace {

std::string bar(double part) {
    constexpr std::size_t width = 40;
    const auto full = std::min(static_cast<std::size_t>(part * width), width);
    return fmt::format("[{}{}] {:3.0f} %", std::string(full, '='), std::string(width - full, ' '), 100 * part);
}

}  // namespace

clratio::Progress SampleProgress::next(std::uint64_t count) {
    before_ = after_;
    after_ += static_cast<double>(count);
    return [this](std::uint64_t done, std::uint64_t) {
        const double samples = before_ + static_cast<double>(done);
        line_.show(fmt::format("{} of {:.3g} samples", bar(samples / total_), total_));
        return !interrupt_.asked();
    };
}

}  // namespace tool
