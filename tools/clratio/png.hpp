// Pictures in memory as PNG.
#pragma once

#include <cstdint>
#include <string>

#include "label.hpp"

namespace tool {

/// IEC 61966-2-1, from linear light in [0, 1]; what is outside is clipped. NaN and infinity have no colour.
std::uint8_t srgb(double linear);

/// Errors: clratio::IoError that names `path`, where the picture will go.
std::string png_of(const Canvas& canvas, const std::string& path);

}  // namespace tool
