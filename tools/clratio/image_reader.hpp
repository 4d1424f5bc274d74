// Images read ahead on threads while the device works on those before them.
#pragma once

#include <condition_variable>
#include <exception>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "clratio/image.hpp"

namespace tool {

/// Gives the images of a list in its order. Holds at most `budget` bytes of them, or one a thread where those are larger.
class ImageReader {
public:
    ImageReader(std::vector<std::string> specs, std::string layer, std::size_t budget, unsigned threads);
    ~ImageReader();  ///< waits for what is being read

    clratio::Image next();          ///< waits for it; throws what reading it threw
    bool ready(std::size_t count);  ///< are the next `count` read already?
    std::size_t left() const { return specs_.size() - taken_; }
    double seconds() const;  ///< spent reading, summed over the threads

private:
    struct Result {
        clratio::Image image;
        std::exception_ptr error;
    };
    void work();
    Result read(std::size_t index);
    std::size_t allowed() const;  ///< images to be ahead of the one taken last

    const std::vector<std::string> specs_;
    const std::string layer_;
    const std::size_t budget_;
    const unsigned thread_count_;

    mutable std::mutex mutex_;
    std::condition_variable changed_;
    std::map<std::size_t, Result> done_;
    std::size_t started_ = 0, taken_ = 0, largest_ = 0;
    double seconds_ = 0;
    bool stop_ = false;
    std::vector<std::jthread> threads_;
};

}  // namespace tool
