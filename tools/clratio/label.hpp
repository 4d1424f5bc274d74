// A canvas of 8-bit RGB, and capital letters on it.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace tool {

class Canvas {
public:
    Canvas(int width, int height, std::uint8_t paper)
        : width_(width), height_(height),
          bytes_(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), paper) {}

    int width() const { return width_; }
    int height() const { return height_; }
    const std::uint8_t* bytes() const { return bytes_.data(); }
    void set(int x, int y, std::array<std::uint8_t, 3> colour) {
        for (std::size_t c = 0; c < 3; ++c) bytes_[3 * static_cast<std::size_t>(y * width_ + x) + c] = colour[c];
    }

private:
    int width_, height_;
    std::vector<std::uint8_t> bytes_;
};

constexpr int label_height = 11;  ///< pixels: 7 for a letter, 2 above and below

/// Letters in black at the top of the columns left .. left + width - 1; what does not fit is cut. Small letters are
/// drawn as capitals, unknown signs as a space.
void draw_label(Canvas& canvas, int left, int width, const std::string& text);

}  // namespace tool
