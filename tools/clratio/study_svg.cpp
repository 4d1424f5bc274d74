#include "study_svg.hpp"

#include <algorithm>
#include <cmath>

namespace tool::study {

std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : text)
        out += c == '&' ? "&amp;" : c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '"' ? "&quot;" : std::string(1, c);
    return out;
}

namespace {

constexpr std::size_t steps = 128;  // of a cell: two bins each
constexpr int cell_width = 100;     // units of a cell; a step is 1 high
constexpr const char* channel_classes[] = {"r", "g", "b"};

std::vector<double> in_steps(const std::vector<double>& density) {
    std::vector<double> out(steps);
    for (std::size_t i = 0; i < density.size(); ++i) out[steps - 1 - i * steps / density.size()] += density[i];
    return out;
}

/// From the top: equal neighbours are one stroke.
std::string outline(const std::vector<double>& density, double peak) {
    std::string path = "M0 0";
    int at = 0;
    for (std::size_t i = 0; i <= steps; ++i) {
        const int x = i == steps ? 0 : static_cast<int>(std::lround(cell_width * std::sqrt(density[i] / peak)));
        if (x == at && i < steps) continue;
        if (i > 0) path += fmt::format("V{}", i);
        if (x != at) path += fmt::format("H{}", x);
        at = x;
    }
    return path;
}

}  // namespace

std::string density_cell(const SceneResult& scene, const Estimator& e, std::uint32_t level) {
    const Part& part = scene.part(e.sampler);
    std::array<std::vector<double>, 3> densities;
    double peak = 0;
    for (std::size_t c = 0; c < 3; ++c) {
        densities[c] = in_steps(density_of(part, level, e.ratio, c));
        peak = std::max(peak, *std::max_element(densities[c].begin(), densities[c].end()));
    }
    const Statistics s = statistics_of(part, level, e.ratio, all_channels);
    std::string out =
        fmt::format("<svg class=\"cell\" viewBox=\"0 0 {0} {1}\" preserveAspectRatio=\"none\"><title>{2}, N = {3}: "
                    "RMSE {4:.4g}, bias {5:.2g}, {6:.0f} % exact, {7:.1f} % beyond the edges</title>"
                    "<path class=\"zero\" d=\"M0 {8}H{0}\"/>",
                    cell_width, steps, e.name(), 1u << level, s.rmse.value, s.bias.value, 100 * s.atom,
                    100 * (s.below + s.above), steps / 2);
    for (std::size_t c = 0; c < 3 && peak > 0; ++c)
        out += fmt::format("<path class=\"{}\" d=\"{}\"/>", channel_classes[c], outline(densities[c], peak));
    return out + "</svg>";
}

namespace {

/// Straight axes from numbers to the picture.
struct Axes {
    double x0, x1, y0, y1;  ///< the numbers at the edges
    double left, right, top, bottom;

    double x(double v) const { return left + (right - left) * (v - x0) / (x1 - x0); }
    double y(double v) const { return bottom + (top - bottom) * (v - y0) / (y1 - y0); }
    std::string point(double a, double b) const { return fmt::format("{:.1f} {:.1f}", x(a), y(b)); }
};

std::string text(double x, double y, const char* classes, const std::string& words) {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"{}\">{}</text>", x, y, classes, escaped(words));
}

std::string grid(double xa, double ya, double xb, double yb) {
    return fmt::format("<path class=\"grid\" d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\"/>", xa, ya, xb, yb);
}

std::string polyline(const Axes& axes, const std::vector<std::pair<double, double>>& points, const std::string& classes) {
    std::string d;
    for (const auto& [x, y] : points) d += (d.empty() ? "M" : "L") + axes.point(x, y);
    return fmt::format("<path class=\"{}\" d=\"{}\"/>", classes, d);
}

double shown(double rmse) { return std::log10(std::max(rmse, 1e-12)); }

/// The decades that hold all measured values, heavy tails at N = 1 aside.
std::pair<double, double> decades_of(const SceneResult& scene, const std::vector<Line>& lines) {
    double least = 1e9, most = -1e9;
    for (const auto& line : lines)
        for (const std::uint32_t level : {0u, levels - 1}) {
            const double v = shown(
                statistics_of(scene.part(line.estimator.sampler), level, line.estimator.ratio, all_channels).rmse.value);
            least = std::min(least, v);
            most = std::max(most, v);
        }
    return {std::floor(2 * least) / 2 - 0.05, std::ceil(2 * most) / 2 + 0.05};
}

/// A line that falls as N to the power of -slope, from `start` down to the edge.
std::string guide(const Axes& axes, double start, double slope, const std::string& name) {
    const double fall = slope * std::log10(2.0), end = std::min(levels - 1.0, (start - axes.y0) / fall);
    return polyline(axes, {{0, start}, {end, start - fall * end}}, "guide") +
           text(axes.x(0) + 4, axes.y(start) - 5, "label", name);
}

}  // namespace

std::string convergence_plot(const SceneResult& scene, const std::vector<Line>& lines) {
    const auto [low, high] = decades_of(scene, lines);
    const Axes axes{-0.2, levels - 0.8, low, high, 52, 508, 12, 330};
    std::string out =
        fmt::format("<svg class=\"plot\" viewBox=\"0 0 520 372\"><title>{}</title>", escaped(scene.named.title));
    for (std::uint32_t level = 0; level < levels; ++level) {
        out += grid(axes.x(level), axes.top, axes.x(level), axes.bottom);
        out += text(axes.x(level), axes.bottom + 17, "tick middle", std::to_string(1u << level));
    }
    for (int decade = -8; decade <= 12; ++decade)
        for (const int digit : {1, 2, 5}) {
            const double v = decade + std::log10(digit);
            if (v < axes.y0 || v > axes.y1) continue;
            if (digit != 1 && axes.y1 - axes.y0 > 4) continue;
            out += grid(axes.left, axes.y(v), axes.right, axes.y(v));
            out += text(axes.left - 6, axes.y(v) + 4, "tick end", fmt::format("{:g}", digit * std::pow(10.0, decade)));
        }
    out += text((axes.left + axes.right) / 2, axes.bottom + 37, "label middle", "samples a pixel, N");
    out += guide(axes, axes.y1 - 0.05 * (axes.y1 - axes.y0), 0.5, "1/√N") +
           guide(axes, axes.y0 + 0.55 * (axes.y1 - axes.y0), 1, "1/N");
    for (const auto& line : lines) {
        const std::string classes = line.colour_class + (line.estimator.ratio ? "" : " plain");
        std::vector<std::pair<double, double>> measured, predicted;
        for (std::uint32_t level = 0; level < levels; ++level) {
            const auto s = statistics_of(scene.part(line.estimator.sampler), level, line.estimator.ratio, all_channels);
            measured.emplace_back(level, shown(s.rmse.value));
            predicted.emplace_back(level, shown(predicted_rmse(scene, line.estimator, level, all_channels)));
        }
        const bool known = line.estimator.sampler.pattern == clratio::Pattern::iid;
        out += polyline(axes, known ? predicted : measured, "curve " + classes + (known ? "" : " measured"));
        for (const auto& [x, y] : measured)
            out += fmt::format("<circle class=\"mark {}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.2\"/>", classes, axes.x(x),
                               axes.y(y));
    }
    return out + "</svg>";
}

namespace {

/// 1, 2 or 5 times a power of ten: about five of them in `range`.
double tick_step(double range) {
    const double power = std::pow(10.0, std::floor(std::log10(range / 5)));
    const double digit = range / 5 / power;
    return power * (digit < 1.5 ? 1 : digit < 3.5 ? 2 : digit < 7.5 ? 5 : 10);
}

std::string bias_curve(const Axes& axes, const std::vector<Average>& lines, std::size_t first, bool ratios,
                       const std::string& classes) {
    std::vector<std::pair<double, double>> points;
    std::string marks;
    for (std::uint32_t level = 0; level < levels; ++level) {
        const Average& line = lines[first + level];
        const Estimate& bias = ratios ? line.of_ratios.bias : line.of_means.bias;
        const double x = level + (ratios ? -0.04 : 0.04), y = 1e3 * bias.value, error = 1e3 * bias.error;
        points.emplace_back(x, y);
        if (!std::isnan(error)) marks += polyline(axes, {{x, y - error}, {x, y + error}}, "whisker " + classes);
        marks +=
            fmt::format("<circle class=\"mark {}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"3.2\"/>", classes, axes.x(x), axes.y(y));
    }
    return polyline(axes, points, "curve " + classes) + marks;
}

}  // namespace

std::string bias_plot(const SceneResult& scene, const std::vector<std::string>& colour_classes) {
    double least = 0, most = 0;
    for (const auto& line : scene.averages.lines)
        for (const Estimate& bias : {line.of_means.bias, line.of_ratios.bias}) {
            const double room = std::isnan(bias.error) ? 0 : bias.error;
            least = std::min(least, 1e3 * (bias.value - room));
            most = std::max(most, 1e3 * (bias.value + room));
        }
    const double margin = 0.06 * std::max(most - least, 1e-6), step = tick_step(std::max(most - least, 1e-6));
    const Axes axes{-0.3, levels - 0.7, least - margin, most + margin, 52, 508, 12, 210};
    std::string out =
        fmt::format("<svg class=\"plot\" viewBox=\"0 0 520 252\"><title>{}</title>", escaped(scene.named.title));
    for (double y = step * std::ceil(axes.y0 / step); y <= axes.y1; y += step) {
        const double shown = std::abs(y) < step / 2 ? 0 : y;
        out += grid(axes.left, axes.y(y), axes.right, axes.y(y));
        out += text(axes.left - 6, axes.y(y) + 4, "tick end", fmt::format("{:g}", shown));
    }
    for (std::uint32_t level = 0; level < levels; ++level)
        out += text(axes.x(level), axes.bottom + 17, "tick middle", std::to_string(1u << level));
    out += text((axes.left + axes.right) / 2, axes.bottom + 37, "label middle", "samples a pixel, N");
    out += fmt::format("<path class=\"guide\" d=\"M{}L{}\"/>", axes.point(axes.x0, 0), axes.point(axes.x1, 0));
    for (std::size_t i = 0; i < colour_classes.size(); ++i) {
        out += bias_curve(axes, scene.averages.lines, i * levels, false, colour_classes[i] + " plain");
        out += bias_curve(axes, scene.averages.lines, i * levels, true, colour_classes[i]);
    }
    return out + "</svg>";
}

namespace {

constexpr double panel_width = 470, panel_height = 430;

std::string curve(const Axes& axes, const Curve& c, double most) {
    std::string d;
    if (c.style == Curve::Style::dots) {
        for (const auto& p : c.points)
            if (p.density > most / 2000 && p.density <= most) d += fmt::format("M{}h0", axes.point(p.density, p.error));
        return fmt::format("<path class=\"dots\" stroke=\"{}\" d=\"{}\"/>", c.colour, d);
    }
    bool down = false;
    for (const auto& p : c.points) {
        const bool inside = p.density <= most;
        if (inside) d += (down ? "L" : "M") + axes.point(p.density, p.error);
        down = inside;
    }
    return fmt::format("<path class=\"law{}\" stroke=\"{}\" d=\"{}\"/>", c.style == Curve::Style::dashed ? " dashed" : "",
                       c.colour, d);
}

std::string panel_at(const Panel& p, double left) {
    const Axes axes{0,  p.most_density,   p.least_error, p.most_error, left + 44, left + panel_width - 14,
                    34, panel_height - 46};
    std::string out = text((axes.left + axes.right) / 2, 20, "heading middle", p.title);
    for (double e = std::ceil(2 * p.least_error) / 2; e <= p.most_error; e += 0.5) {
        out += grid(axes.left, axes.y(e), axes.right, axes.y(e));
        out += text(axes.left - 6, axes.y(e) + 4, "tick end", fmt::format("{:g}", e));
    }
    for (double d = 0; d <= p.most_density; d += 1) {
        out += grid(axes.x(d), axes.top, axes.x(d), axes.bottom);
        out += text(axes.x(d), axes.bottom + 17, "tick middle", fmt::format("{:g}", d));
    }
    out += text((axes.left + axes.right) / 2, axes.bottom + 36, "label middle", "probability density");
    double y = axes.top + 16;
    for (const auto& c : p.curves) {
        out += curve(axes, c, p.most_density);
        if (c.title.empty()) continue;
        out += fmt::format("<path class=\"{}\" stroke=\"{}\" d=\"M{:.0f} {:.0f}h{}\"/>",
                           c.style == Curve::Style::dashed ? "law dashed"
                           : c.style == Curve::Style::dots ? "dots"
                                                           : "law",
                           c.colour, axes.right - 128, y - 4, c.style == Curve::Style::dots ? 0 : 22);
        out += text(axes.right - 98, y, "tick", c.title);
        y += 16;
    }
    return out;
}

}  // namespace

std::string panels(const std::vector<Panel>& all) {
    std::string out = fmt::format("<svg class=\"wide\" viewBox=\"0 0 {:.0f} {:.0f}\">",
                                  panel_width * static_cast<double>(all.size()), panel_height);
    for (std::size_t i = 0; i < all.size(); ++i) out += panel_at(all[i], panel_width * static_cast<double>(i));
    return out + "</svg>";
}

}  // namespace tool::study
