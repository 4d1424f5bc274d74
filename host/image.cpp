#include "clratio/image.hpp"

#include <ImfThreading.h>

#include "exr_file.hpp"

namespace clratio {
namespace {

std::string shape_of(const Image& image) {
    std::string channels;
    for (const auto& c : image.channels) channels += (channels.empty() ? "" : ",") + c;
    return (image.path.empty() ? "an image made here" : image.path) + " with " + std::to_string(image.width()) + "x" +
           std::to_string(image.height()) + " pixels, channels " + channels + ", data window " + text_of(image.data_window) +
           ", display window " + text_of(image.display_window);
}

Image in_the_shape_of(const Image& like, std::vector<float>&& values) {
    Image image;
    image.channels = like.channels;
    image.values = std::move(values);
    image.alpha = like.alpha;
    image.data_window = like.data_window;
    image.display_window = like.display_window;
    image.metadata = like.metadata;
    return image;
}

}  // namespace

void set_image_threads(unsigned count) {
    if (count > 1024) throw InvalidArgument("threads", "0 to 1024", std::to_string(count));
    Imf::setGlobalThreadCount(static_cast<int>(count));
}

void require_same_shape(const Image& a, const Image& b) {
    if (a.channels != b.channels || a.data_window != b.data_window || a.display_window != b.display_window)
        throw InvalidArgument("images of one shape", shape_of(a), shape_of(b));
}

CombinedImage combined_image(Combined&& combined, const Image& like) {
    CombinedImage image;
    image.estimate = in_the_shape_of(like, std::move(combined.estimate));
    const auto give = [&](Image& to, std::vector<float>& values) {
        if (!values.empty()) to = in_the_shape_of(like, std::move(values));
    };
    give(image.standard_error, combined.standard_error);
    give(image.bias, combined.bias);
    give(image.lower, combined.lower);
    give(image.upper, combined.upper);
    give(image.gain, combined.gain);
    give(image.needed, combined.needed);
    image.kind = std::move(combined.kind);
    image.flag_image = std::move(combined.flag_image);
    image.flags = combined.flags;
    return image;
}

CombinedImage combine(const Moments& moments, const Image& tau, CombineOptions options) {
    return combined_image(combine(moments, Tau(tau), options), tau);
}

}  // namespace clratio
