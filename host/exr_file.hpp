// What reading and writing OpenEXR files share; private to clratio::io.
#pragma once

#include <ImfFrameBuffer.h>
#include <ImfHeader.h>

#include <string>
#include <vector>

#include "clratio/image.hpp"

namespace clratio {

struct Image::Metadata {
    Imf::Header header;
};

inline Window window_of(const Imath::Box2i& box) { return {box.min.x, box.min.y, box.max.x, box.max.y}; }
inline Imath::Box2i box_of(const Window& w) { return {{w.x0, w.y0}, {w.x1, w.y1}}; }

inline std::string text_of(const Window& w) {
    return "(" + std::to_string(w.x0) + "," + std::to_string(w.y0) + ")-(" + std::to_string(w.x1) + "," +
           std::to_string(w.y1) + ")";
}

/// Slices for channels interleaved at `values`, 4 bytes (float or uint) each; a channel's name is its name in the file.
inline void add_slices(Imf::FrameBuffer& frame, const std::vector<std::string>& channels, Imf::PixelType type,
                       const void* values, const Imath::Box2i& window) {
    const std::size_t pixel = 4 * channels.size();
    const std::size_t row = pixel * static_cast<std::size_t>(window.max.x - window.min.x + 1);
    const auto* first = static_cast<const char*>(values);
    for (std::size_t c = 0; c < channels.size(); ++c)
        frame.insert(channels[c], Imf::Slice::Make(type, first + 4 * c, window, pixel, row));
}

inline constexpr std::size_t longest_name = 255;  ///< of a channel: OpenEXR cuts longer ones without a word

/// Adds the attributes that describe the picture, not the layout of the file it was read from.
void carry_metadata(const Image::Metadata& from, Imf::Header& to);

/// Throws InvalidArgument unless the image has channels of different names that fit, and at least one pixel.
void require_channels(const Image& image);

/// A damaged header can ask for any amount of memory. No compression of OpenEXR packs values more tightly than this; throws
/// std::runtime_error.
void require_plausible_size(const Imf::Header& header, std::uint64_t file_bytes);

/// Throws std::runtime_error unless this is a file that starts as OpenEXR files do.
void require_exr(const std::string& path);

}  // namespace clratio
