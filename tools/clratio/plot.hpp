// Pictures of error laws, drawn by gnuplot: density to the right, error upwards, as the supplement's figures have them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tool {

struct Curve {
    enum class Style { line, thin, dashed, dots };
    struct Point {
        double density, error;
    };
    std::string title;  ///< its line in the key; none where empty
    Style style = Style::line;
    std::string colour;  ///< "#rrggbb"
    std::vector<Point> points;
};

struct Panel {
    std::string title;
    double most_density = 1, least_error = -1, most_error = 1;
    std::vector<Curve> curves;
    std::string x_label = "probability density", y_label = "error";
    bool doubling = false;  ///< x is the logarithm to base 2 of what the axis shows
};

/// Panels side by side. Titles are gnuplot's enhanced text, without apostrophes.
struct Drawing {
    std::string title;
    std::vector<Panel> panels;
};

/// Colour i of `count` along one scale, light to dark.
std::string scale_colour(std::size_t i, std::size_t count);

/// A count as enhanced text: 2.5·10^{8}.
std::string power_of_ten(std::uint64_t count);

/// UsageError for a name that ends neither in .svg nor in .png.
void require_picture_name(const std::string& file);

/// An IoError that names the Debian package where there is no gnuplot.
void require_gnuplot(const std::string& file);

/// Draws to a .svg or .png file, whole or not at all. The script goes to gnuplot on its standard input and the picture comes
/// from its standard output, so that no shell and no script sees the file's name. Errors: IoError with gnuplot's words.
void draw(const Drawing& drawing, const std::string& file);

}  // namespace tool
