// The batches that clratio combine reads, and tau.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "combine_options.hpp"
#include "image_reader.hpp"

namespace tool::combining {

/// Bytes of images read ahead, and again of those in one launch: a quarter of the machine's memory each.
std::size_t memory_budget();

/// A batch to be read, and one that was.
struct Job {
    std::uint64_t index;
    std::string m, t;
};
struct Pair {
    std::uint64_t index = 0;
    clratio::Image m, t;
};

/// The batches of a list, read ahead on threads, in its order.
class PairReader {
public:
    PairReader(std::vector<Job> jobs, const std::string& layer);

    /// The next pair, and those that are read already, as many as one launch takes; all of them where that is all there
    /// is. Throws what reading threw, once the pairs before it were given.
    std::vector<Pair> next();
    bool done() const { return !failed_ && taken_ == jobs_.size(); }
    double seconds() const { return images_.seconds(); }

private:
    Pair one();

    std::vector<Job> jobs_;
    ImageReader images_;
    std::size_t taken_ = 0;
    std::exception_ptr failed_;
};

/// How many pairs of this size one launch may take.
std::size_t pairs_in_a_launch(const clratio::Image& image);

/// IoError with row, column and channel of the first NaN or infinity.
void require_finite(const clratio::Image& image);

/// tau as numbers, or as an image: the mean of all --tau files.
class TauInput {
public:
    /// UsageError where numbers and files are mixed.
    explicit TauInput(const std::vector<std::string>& words);
    /// Reads the files, or compares the count of numbers with the channels. UsageError, IoError.
    void fit(const clratio::Image& shape, const std::vector<std::string>& words, const std::string& layer);

    operator clratio::Tau() const;

private:
    std::vector<float> numbers_;
    clratio::Image image_;
};

/// IoError, InvalidArgument where it has another shape.
clratio::Image read_like(const clratio::Image& shape, const std::string& file, const std::string& layer);

}  // namespace tool::combining
