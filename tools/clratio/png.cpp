#include "png.hpp"

#include <png.h>

#include <algorithm>
#include <cmath>

#include "clratio/exception.hpp"

namespace tool {

std::uint8_t srgb(double linear) {
    const double x = std::clamp(linear, 0.0, 1.0);
    const double encoded = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
    return static_cast<std::uint8_t>(std::lround(255 * encoded));
}

std::string png_of(const Canvas& canvas, const std::string& path) {
    png_image png{};
    png.version = PNG_IMAGE_VERSION;
    png.width = static_cast<png_uint_32>(canvas.width());
    png.height = static_cast<png_uint_32>(canvas.height());
    png.format = PNG_FORMAT_RGB;
    const auto write = [&](void* to, png_alloc_size_t& size) {
        if (!png_image_write_to_memory(&png, to, &size, 0, canvas.bytes(), 0, nullptr))
            throw clratio::IoError(path, "", std::string("cannot be written: ") + png.message);
    };
    png_alloc_size_t size = 0;
    write(nullptr, size);
    std::string bytes(size, '\0');
    write(bytes.data(), size);
    bytes.resize(size);
    return bytes;
}

}  // namespace tool
