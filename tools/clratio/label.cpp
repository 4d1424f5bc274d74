#include "label.hpp"

#include <algorithm>
#include <cctype>
#include <string_view>

namespace tool {
namespace {

constexpr int letter_width = 5, letter_height = 7, advance = 6, margin = 2;

struct Glyph {
    char sign;
    std::array<std::uint8_t, letter_height> rows;  ///< bit 4 is the leftmost column
};

constexpr std::array glyphs{
    Glyph{'0', {14, 17, 19, 21, 25, 17, 14}}, Glyph{'1', {4, 12, 4, 4, 4, 4, 14}},
    Glyph{'2', {14, 17, 1, 6, 8, 16, 31}},    Glyph{'3', {14, 17, 1, 6, 1, 17, 14}},
    Glyph{'4', {2, 6, 10, 18, 31, 2, 2}},     Glyph{'5', {31, 16, 30, 1, 1, 17, 14}},
    Glyph{'6', {14, 16, 16, 30, 17, 17, 14}}, Glyph{'7', {31, 1, 2, 4, 8, 8, 8}},
    Glyph{'8', {14, 17, 17, 14, 17, 17, 14}}, Glyph{'9', {14, 17, 17, 15, 1, 1, 14}},
    Glyph{'A', {14, 17, 17, 31, 17, 17, 17}}, Glyph{'B', {30, 17, 17, 30, 17, 17, 30}},
    Glyph{'C', {14, 17, 16, 16, 16, 17, 14}}, Glyph{'D', {30, 17, 17, 17, 17, 17, 30}},
    Glyph{'E', {31, 16, 16, 30, 16, 16, 31}}, Glyph{'F', {31, 16, 16, 30, 16, 16, 16}},
    Glyph{'G', {14, 17, 16, 23, 17, 17, 14}}, Glyph{'H', {17, 17, 17, 31, 17, 17, 17}},
    Glyph{'I', {14, 4, 4, 4, 4, 4, 14}},      Glyph{'J', {1, 1, 1, 1, 1, 17, 14}},
    Glyph{'K', {17, 18, 20, 24, 20, 18, 17}}, Glyph{'L', {16, 16, 16, 16, 16, 16, 31}},
    Glyph{'M', {17, 27, 21, 21, 17, 17, 17}}, Glyph{'N', {17, 25, 21, 19, 17, 17, 17}},
    Glyph{'O', {14, 17, 17, 17, 17, 17, 14}}, Glyph{'P', {30, 17, 17, 30, 16, 16, 16}},
    Glyph{'Q', {14, 17, 17, 17, 21, 18, 13}}, Glyph{'R', {30, 17, 17, 30, 20, 18, 17}},
    Glyph{'S', {15, 16, 16, 14, 1, 1, 30}},   Glyph{'T', {31, 4, 4, 4, 4, 4, 4}},
    Glyph{'U', {17, 17, 17, 17, 17, 17, 14}}, Glyph{'V', {17, 17, 17, 17, 17, 10, 4}},
    Glyph{'W', {17, 17, 17, 21, 21, 27, 17}}, Glyph{'X', {17, 17, 10, 4, 10, 17, 17}},
    Glyph{'Y', {17, 17, 10, 4, 4, 4, 4}},     Glyph{'Z', {31, 1, 2, 4, 8, 16, 31}},
    Glyph{'.', {0, 0, 0, 0, 0, 12, 12}},      Glyph{'-', {0, 0, 0, 31, 0, 0, 0}},
    Glyph{'+', {0, 4, 4, 31, 4, 4, 0}},       Glyph{':', {0, 12, 12, 0, 12, 12, 0}},
    Glyph{'/', {1, 1, 2, 4, 8, 16, 16}},      Glyph{'=', {0, 0, 31, 0, 31, 0, 0}},
    Glyph{'(', {2, 4, 8, 8, 8, 4, 2}},        Glyph{')', {8, 4, 2, 2, 2, 4, 8}},
    Glyph{'_', {0, 0, 0, 0, 0, 0, 31}},
};

void draw_letter(Canvas& canvas, int left, char sign) {
    const auto* glyph = std::find_if(glyphs.begin(), glyphs.end(), [&](const Glyph& g) { return g.sign == sign; });
    if (glyph == glyphs.end()) return;
    for (int y = 0; y < letter_height; ++y)
        for (int x = 0; x < letter_width; ++x)
            if ((glyph->rows[static_cast<std::size_t>(y)] >> (letter_width - 1 - x)) & 1)
                canvas.set(left + x, margin + y, {0, 0, 0});
}

}  // namespace

void draw_label(Canvas& canvas, int left, int width, const std::string& text) {
    for (std::size_t i = 0; i < text.size(); ++i) {
        const int x = static_cast<int>(i) * advance + margin;
        if (x + letter_width > width) return;
        draw_letter(canvas, left + x, static_cast<char>(std::toupper(static_cast<unsigned char>(text[i]))));
    }
}

}  // namespace tool
