#include "combine_input.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace tool::combining {

std::optional<float> tau_number(const std::string& text) {
    float value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc::invalid_argument || end != text.data() + text.size()) return std::nullopt;
    if (error != std::errc() || !std::isfinite(value)) throw UsageError("--tau: expected a finite number, got " + text);
    return value;
}

namespace {

constexpr std::size_t most_in_a_launch = 8;

std::vector<std::string> interleaved(const std::vector<Job>& jobs) {
    std::vector<std::string> all;
    for (const Job& job : jobs) {
        all.push_back(job.m);
        all.push_back(job.t);
    }
    return all;
}

std::vector<float> numbers(const std::vector<std::string>& words) {
    std::vector<float> all;
    for (const auto& text : words)
        if (const auto value = tau_number(text)) all.push_back(*value);
    if (!all.empty() && all.size() != words.size()) throw UsageError("--tau: either numbers or files, not both");
    return all;
}

}  // namespace

std::size_t memory_budget() {
    const long pages = sysconf(_SC_PHYS_PAGES), bytes = sysconf(_SC_PAGESIZE);
    constexpr std::size_t least = std::size_t{1} << 28;
    return pages > 0 && bytes > 0 ? std::max(least, static_cast<std::size_t>(pages) / 4 * static_cast<std::size_t>(bytes))
                                  : least;
}

std::size_t pairs_in_a_launch(const clratio::Image& image) {
    const std::size_t bytes = 2 * sizeof(float) * image.values.size();
    return std::clamp<std::size_t>(memory_budget() / bytes, 1, most_in_a_launch);
}

PairReader::PairReader(std::vector<Job> jobs, const std::string& layer)
    : jobs_(std::move(jobs)), images_(interleaved(jobs_), layer, memory_budget(), std::thread::hardware_concurrency()) {}

Pair PairReader::one() { return {jobs_[taken_++].index, images_.next(), images_.next()}; }

std::vector<Pair> PairReader::next() {
    if (failed_) std::rethrow_exception(failed_);
    std::vector<Pair> pairs;
    pairs.push_back(one());
    const std::size_t most = pairs_in_a_launch(pairs.front().m);
    const bool wait = jobs_.size() - taken_ < most;
    try {
        while (pairs.size() < most && !done() && (wait || images_.ready(2))) pairs.push_back(one());
    } catch (...) {
        failed_ = std::current_exception();
    }
    return pairs;
}

void require_finite(const clratio::Image& image) {
    for (std::size_t i = 0; i < image.values.size(); ++i) {
        if (std::isfinite(image.values[i])) continue;
        const std::size_t channels = image.channels.size(), pixel = i / channels,
                          width = static_cast<std::size_t>(image.width());
        throw clratio::IoError(image.path, image.layer,
                               fmt::format("{} at column {}, row {}, channel {}, refused by --nonfinite fail",
                                           image.values[i], pixel % width, pixel / width, image.channels[i % channels]));
    }
}

SideReader::SideReader(std::vector<std::string> files, const std::string& layer) : images_(std::move(files), layer, 0, 1) {}

clratio::Image SideReader::next_like(const clratio::Image& shape) {
    auto image = images_.next();
    clratio::require_same_shape(shape, image);
    return image;
}

TauInput::TauInput(const std::vector<std::string>& words, const std::string& layer, bool wanted)
    : numbers_(numbers(words)), files_(wanted && numbers_.empty() ? words : std::vector<std::string>(), layer) {}

void TauInput::fit(const clratio::Image& shape) {
    if (numbers_.size() > 1 && numbers_.size() != shape.channels.size())
        throw UsageError(
            fmt::format("--tau: {} numbers for the {} channels of {}", numbers_.size(), shape.channels.size(), shape.path));
    std::vector<double> sum;
    double files = 0;
    for (; !files_.done(); ++files) {
        image_ = files_.next_like(shape);
        if (files == 0 && files_.done()) return;
        sum.resize(image_.size());
        for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += image_.values[i];
    }
    for (std::size_t i = 0; i < sum.size(); ++i) image_.values[i] = static_cast<float>(sum[i] / files);
}

TauInput::operator clratio::Tau() const {
    if (numbers_.size() == 1) return numbers_.front();
    return numbers_.empty() ? clratio::Tau(image_) : clratio::Tau(numbers_);
}

}  // namespace tool::combining
