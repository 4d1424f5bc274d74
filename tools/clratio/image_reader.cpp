#include "image_reader.hpp"

#include <algorithm>
#include <chrono>

namespace tool {

ImageReader::ImageReader(std::vector<std::string> specs, std::string layer, std::size_t budget, unsigned threads)
    : specs_(std::move(specs)), layer_(std::move(layer)), budget_(budget), thread_count_(std::max(1u, threads)) {
    for (unsigned i = 0; i < thread_count_; ++i) threads_.emplace_back([this] { work(); });
}

ImageReader::~ImageReader() {
    const std::scoped_lock lock(mutex_);
    stop_ = true;
    changed_.notify_all();
}

std::size_t ImageReader::allowed() const {
    const std::size_t fits = largest_ == 0 ? 0 : budget_ / largest_;
    return std::max<std::size_t>(fits, thread_count_);
}

ImageReader::Result ImageReader::read(std::size_t index) {
    try {
        return {clratio::read_image(specs_[index], layer_), nullptr};
    } catch (...) {
        return {{}, std::current_exception()};
    }
}

void ImageReader::work() {
    std::unique_lock lock(mutex_);
    for (;;) {
        changed_.wait(lock, [&] { return stop_ || started_ == specs_.size() || started_ < taken_ + allowed(); });
        if (stop_ || started_ == specs_.size()) return;
        const std::size_t index = started_++;
        lock.unlock();
        const auto begin = std::chrono::steady_clock::now();
        Result result = read(index);
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
        lock.lock();
        seconds_ += took.count();
        largest_ = std::max(largest_, sizeof(float) * (result.image.values.size() + result.image.alpha.size()));
        done_[index] = std::move(result);
        changed_.notify_all();
    }
}

clratio::Image ImageReader::next() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return done_.count(taken_) != 0; });
    Result result = std::move(done_.extract(taken_).mapped());
    ++taken_;
    changed_.notify_all();
    if (result.error) std::rethrow_exception(result.error);
    return std::move(result.image);
}

bool ImageReader::ready(std::size_t count) {
    const std::scoped_lock lock(mutex_);
    for (std::size_t i = 0; i < count; ++i)
        if (done_.count(taken_ + i) == 0) return false;
    return true;
}

double ImageReader::seconds() const {
    const std::scoped_lock lock(mutex_);
    return seconds_;
}

}  // namespace tool
