// The batches that clratio combine reads, and tau.
#pragma once

#include <cstdint>
#include <optional>
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

/// A word of --tau that is a number, not a file. UsageError where it is not finite.
std::optional<float> tau_number(const std::string& word);

/// IoError with row, column and channel of the first NaN or infinity.
void require_finite(const clratio::Image& image);

/// Images that must have the shape of the batches, read one ahead on a thread from the start.
class SideReader {
public:
    SideReader(std::vector<std::string> files, const std::string& layer);

    bool done() const { return images_.left() == 0; }
    /// IoError, InvalidArgument where it has another shape.
    clratio::Image next_like(const clratio::Image& shape);
    double seconds() const { return images_.seconds(); }

private:
    ImageReader images_;
};

/// tau as numbers, or as an image: the mean of all --tau files.
class TauInput {
public:
    /// Begins to read the files, if they are `wanted`. UsageError where numbers and files are mixed.
    TauInput(const std::vector<std::string>& words, const std::string& layer, bool wanted);
    /// Waits for the files, or compares the count of numbers with the channels. UsageError, IoError.
    void fit(const clratio::Image& shape);

    operator clratio::Tau() const;
    /// The image, once nothing else will read it; a Tau made before still refers to it. None where tau is a number.
    std::vector<float> give_away() { return std::move(image_.values); }
    double seconds() const { return files_.seconds(); }  ///< spent reading

private:
    std::vector<float> numbers_;
    SideReader files_;
    clratio::Image image_;
};

}  // namespace tool::combining
