#include "plot.hpp"

#include <spawn.h>
#include <sys/wait.h>

#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "clratio/exception.hpp"
#include "output_file.hpp"
#include "tool.hpp"

namespace tool {
namespace {

// ---- gnuplot as a child

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

File unnamed_file(const std::string& bytes = {}) {
    File file(std::tmpfile(), std::fclose);
    if (!file || std::fwrite(bytes.data(), 1, bytes.size(), file.get()) != bytes.size() || std::fflush(file.get()) != 0)
        throw clratio::IoError("a temporary file", "", std::string("cannot be written: ") + std::strerror(errno));
    std::rewind(file.get());
    return file;
}

std::string bytes_of(std::FILE* file) {
    std::string bytes;
    std::array<char, 1 << 16> block;
    std::rewind(file);
    while (const std::size_t n = std::fread(block.data(), 1, block.size(), file)) bytes.append(block.data(), n);
    return bytes;
}

struct Said {
    int code;
    std::string out, err;
};

/// `gnuplot arguments`, without the user's settings, with `script` as its input. Code 127: there is no gnuplot.
Said gnuplot(std::vector<const char*> arguments, const std::string& script) {
    const File in = unnamed_file(script), out = unnamed_file(), err = unnamed_file();
    arguments.insert(arguments.begin(), {"gnuplot", "-d"});
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_adddup2(&files, fileno(in.get()), 0);
    posix_spawn_file_actions_adddup2(&files, fileno(out.get()), 1);
    posix_spawn_file_actions_adddup2(&files, fileno(err.get()), 2);
    pid_t child = 0;
    const int failure =
        posix_spawnp(&child, "gnuplot", &files, nullptr, const_cast<char* const*>(arguments.data()), environ);
    posix_spawn_file_actions_destroy(&files);
    if (failure != 0) return {127, "", std::strerror(failure)};
    int status = 0;
    waitpid(child, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), bytes_of(out.get()), bytes_of(err.get())};
}

// The line of gnuplot's complaint that says what is wrong: the last that is not empty.
std::string last_line(const std::string& text) {
    const auto end = text.find_last_not_of(" \n");
    if (end == std::string::npos) return "no reason given";
    const auto start = text.find_last_of('\n', end);
    return text.substr(start == std::string::npos ? 0 : start + 1, end - (start == std::string::npos ? 0 : start + 1) + 1);
}

// ---- the script

constexpr int panel_width = 560, height = 520;

std::string terminal(const std::string& file, std::size_t panels) {
    const int width = panel_width * static_cast<int>(panels);
    if (std::filesystem::path(file).extension() == ".svg")
        return fmt::format("set terminal svg size {},{} enhanced font 'sans-serif,12' background '#ffffff'\n", width,
                           height);
    return fmt::format("set terminal pngcairo size {},{} enhanced font 'DejaVu Sans,11' fontscale 1.25 linewidth 1.4\n",
                       width * 7 / 5, height * 7 / 5);
}

constexpr auto look = R"(set encoding utf8
set border 3 linewidth 0.7 linecolor rgb '#808080'
set tics nomirror out scale 0.6 textcolor rgb '#303030'
set mxtics 2
set grid xtics ytics linetype 1 linewidth 0.5 linecolor rgb '#ececec'
set xzeroaxis linetype 1 linewidth 0.7 linecolor rgb '#c8c8c8'
set key top right Left reverse samplen 1.8 spacing 1.1 width -1 noautotitle textcolor rgb '#303030'
)";

std::string style_of(const Curve& curve) {
    switch (curve.style) {
    case Curve::Style::dashed:
        return fmt::format("lines linewidth 1 dashtype (9,5) linecolor rgb '{}'", curve.colour);
    case Curve::Style::dots:
        return fmt::format("points pointtype 7 pointsize 0.42 linecolor rgb '{}'", curve.colour);
    case Curve::Style::line:
    case Curve::Style::thin:
        break;
    }
    return fmt::format("lines linewidth {} linecolor rgb '{}'", curve.style == Curve::Style::thin ? 0.7 : 1.3, curve.colour);
}

// A point nearer than this part of the axis to it would only make the axis thicker.
constexpr double least_visible = 1e-3;
// Dots this far apart, in parts of the panel, are seen as dots.
constexpr double dot_distance = .013;

/// Which points are drawn: dots keep a distance.
std::vector<Curve::Point> drawn(const Curve& curve, const Panel& panel) {
    if (curve.style != Curve::Style::dots) return curve.points;
    std::vector<Curve::Point> dots;
    for (const auto& p : curve.points) {
        const auto near = [&](const Curve::Point& q) {
            return std::hypot((p.density - q.density) / panel.most_density,
                              (p.error - q.error) / (panel.most_error - panel.least_error)) < dot_distance;
        };
        if (dots.empty() || !near(dots.back())) dots.push_back(p);
    }
    return dots;
}

std::string data(const Curve& curve, const Panel& panel, const std::string& name) {
    std::string text = name + " << EOD\n";
    for (const auto& p : drawn(curve, panel))
        text += !panel.doubling && p.density < least_visible * panel.most_density
                    ? "\n"
                    : fmt::format("{:.5g} {:.6g}\n", p.density, p.error);
    return text + "NaN NaN\nEOD\n";
}

std::string axes(const Panel& panel) {
    std::string tics = "autofreq";
    if (panel.doubling) {
        tics = "(";
        for (int power = 0; power <= panel.most_density; power += 2)
            tics += fmt::format("{}'{}' {}", power ? ", " : "", 1 << power, power);
        tics += ")";
    }
    return fmt::format("set xlabel '{}' textcolor rgb '#303030'\nset ylabel '{}' textcolor rgb '#303030'\nset xtics {}\n",
                       panel.x_label, panel.y_label, tics);
}

std::string plot(const Panel& panel) {
    std::string blocks, parts;
    for (std::size_t i = 0; i < panel.curves.size(); ++i) {
        const auto& curve = panel.curves[i];
        const std::string name = "$curve" + std::to_string(i);
        blocks += data(curve, panel, name);
        parts += fmt::format("{}{} using 1:2 with {}{}", i ? ", \\\n     " : "plot ", name, style_of(curve),
                             curve.title.empty() ? "" : " title '" + curve.title + "'");
    }
    return axes(panel) + fmt::format("{}set title '{}' textcolor rgb '#101010'\nset xrange [0:{}]\nset yrange [{}:{}]\n{}\n",
                                     blocks, panel.title, panel.most_density, panel.least_error, panel.most_error, parts);
}

std::string script(const Drawing& drawing, const std::string& file) {
    std::string text = terminal(file, drawing.panels.size()) + look;
    text +=
        fmt::format("set multiplot layout 1,{} title '{}' textcolor rgb '#101010'\n", drawing.panels.size(), drawing.title);
    for (const auto& panel : drawing.panels) text += plot(panel);
    return text + "unset multiplot\n";
}

}  // namespace

std::string scale_colour(std::size_t i, std::size_t count) {
    static constexpr std::array<std::array<double, 3>, 5> stops{
        {{222, 165, 62}, {120, 174, 108}, {38, 143, 142}, {36, 95, 148}, {38, 36, 98}}};
    const double at = count < 2 ? 3 : static_cast<double>(i) / static_cast<double>(count - 1) * (stops.size() - 1);
    const auto low = std::min(static_cast<std::size_t>(at), stops.size() - 2);
    const double part = at - static_cast<double>(low);
    std::array<int, 3> rgb{};
    for (std::size_t c = 0; c < 3; ++c)
        rgb[c] = static_cast<int>(std::lround(stops[low][c] * (1 - part) + stops[low + 1][c] * part));
    return fmt::format("#{:02x}{:02x}{:02x}", rgb[0], rgb[1], rgb[2]);
}

std::string power_of_ten(std::uint64_t count) {
    const std::string short_form = fmt::format("{:.3g}", static_cast<double>(count));
    const auto e = short_form.find("e+");
    if (e == std::string::npos) return short_form;
    const std::string mantissa = short_form.substr(0, e);
    return (mantissa == "1" ? "" : mantissa + "·") + fmt::format("10^{{{}}}", std::stoi(short_form.substr(e + 2)));
}

void require_picture_name(const std::string& file) {
    const auto extension = std::filesystem::path(file).extension();
    if (extension != ".svg" && extension != ".png") throw UsageError(file + ": a picture's name ends in .svg or .png");
}

void require_gnuplot(const std::string& file) {
    if (gnuplot({"--version"}, "").code != 0)
        throw clratio::IoError(file, "", "drawing needs gnuplot: on Debian, apt-get install gnuplot-nox");
}

void draw(const Drawing& drawing, const std::string& file) {
    require_gnuplot(file);
    const Said said = gnuplot({}, script(drawing, file));
    if (said.code != 0 || said.out.empty()) throw clratio::IoError(file, "", "gnuplot: " + last_line(said.err));
    OutputFile out(file);
    out.write(said.out);
    out.commit();
}

}  // namespace tool
