// clratio figures: the supplement's Figures 1 and 2 with the laws that are right beside those that were printed.
#include "figures.hpp"

#include <filesystem>

#include "command.hpp"
#include "error_options.hpp"

namespace tool {
namespace {

constexpr double lo = -1.5, hi = 1.5, most_density = 6.5;
constexpr std::uint32_t bins = 300;
constexpr std::uint64_t sizes[] = {1, 2, 4, 8, 16, 32, 64};
constexpr Estimator estimators[] = {Estimator::mc, Estimator::ratio};

struct Options {
    std::string folder, count = "1e8";
    StreamOptions stream;
};

clratio::ErrorModel model_of(std::uint64_t n) {
    return {.mu = .5, .tau = 1, .sigma_m = .5, .sigma_t = .35, .rho = 0, .n = n};
}

Panel panel_of(const Figure& figure, Estimator estimator, bool samples) {
    const auto law_style = samples ? Curve::Style::thin : Curve::Style::line;
    Panel panel{estimator == Estimator::mc ? "Monte Carlo (MC)" : "Ratio estimator (RE)", most_density, lo, hi, {}};
    std::size_t i = 0;
    for (const auto& counts : figure) {
        if (counts.estimator != estimator) continue;
        const auto colour = scale_colour(i++, std::size(sizes));
        const std::string title = fmt::format("N = {}", counts.model.n);
        if (estimator == Estimator::ratio)
            panel.curves.push_back({"", Curve::Style::dashed, colour, density_curve(counts.published(), lo, hi)});
        panel.curves.push_back({samples ? "" : title, law_style, colour, density_curve(counts.exact(), lo, hi)});
        if (samples) panel.curves.push_back({title, Curve::Style::dots, colour, density_points(counts, bins)});
    }
    if (samples) panel.curves.push_back({"samples", Curve::Style::dots, "#606060", {}});
    panel.curves.push_back({estimator == Estimator::mc ? "exact: eq. (23)" : "exact law", law_style, "#606060", {}});
    if (estimator == Estimator::ratio) panel.curves.push_back({"published eq. (22)", Curve::Style::dashed, "#606060", {}});
    return panel;
}

}  // namespace

std::vector<Panel> panels_of(const Figure& figure, bool samples) {
    return {panel_of(figure, Estimator::mc, samples), panel_of(figure, Estimator::ratio, samples)};
}

Figure sampled_figure(const clratio::Engine& engine, const clratio::Stream& stream, std::uint64_t count) {
    Sampling sampling{stream, {0, count}, {lo, hi, bins}};
    SampleProgress progress(static_cast<double>(sampling.range.count) * std::size(estimators) * std::size(sizes));
    Figure figure;
    for (const auto estimator : estimators)
        for (const auto n : sizes) {
            figure.push_back(with_usage_errors([&] {
                return count_errors(engine, estimator, model_of(n), sampling, progress.next(sampling.range.count));
            }));
            ++sampling.stream.id;
        }
    return figure;
}

namespace {

void draw_figure(const Figure& figure, const std::filesystem::path& stem, const std::string& title, bool samples) {
    const Drawing drawing{title, panels_of(figure, samples)};
    for (const char* extension : {".svg", ".png"}) draw(drawing, stem.string() + extension);
}

void write_laws(const Figure& figure, const std::string& file) {
    OutputFile out(file);
    out.write("estimator,n,error,exact,published\n");
    for (const auto& counts : figure) {
        const auto exact = density_curve(counts.exact(), lo, hi), published = density_curve(counts.published(), lo, hi);
        for (std::size_t i = 0; i < exact.size(); ++i)
            out.write(fmt::format("{},{},{},{},{}\n", name_of(counts.estimator), counts.model.n, exact[i].error,
                                  exact[i].density, published[i].density));
    }
    out.commit();
}

void write_samples(const Figure& figure, const std::string& file) {
    OutputFile out(file);
    out.write(csv_header);
    for (const auto& counts : figure) write_csv(out, counts);
    out.commit();
}

int figures(const Options& options) {
    const std::filesystem::path folder = options.folder;
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw clratio::IoError(options.folder, "", "cannot be made a folder: " + error.message());
    require_gnuplot(options.folder);
    const Figure figure = sampled_figure(clratio::Engine{}, options.stream.stream(), whole_number("--count", options.count));
    const std::uint64_t count = figure.front().histogram.total();
    draw_figure(figure, folder / "figure1", "Figure 1: the law of the error after N samples", false);
    draw_figure(figure, folder / "figure2", "Figure 2: " + power_of_ten(count) + " sampled errors of each", true);
    write_laws(figure, (folder / "figure1.csv").string());
    write_samples(figure, (folder / "figure2.csv").string());
    for (const char* name : {"figure1", "figure2"}) fmt::print("{0}.svg {0}.png {0}.csv\n", (folder / name).string());
    return ok;
}

}  // namespace

void add_figures(CLI::App& app, Run& run) {
    auto o = std::make_shared<Options>();
    Command command(app, "figures", "Draw the supplement's Figures 1 (laws) and 2 (samples), with their numbers");
    command.option("-o,--output", o->folder, "Folder for figure1 and figure2, each .svg, .png and .csv")
        .required()
        .type("DIR");
    command.option("--count", o->count, "Errors to draw for each of 14 histograms").type("WHOLE").shows_default();
    o->stream.add_to(command);
    command.footer(
        "Density to the right, error upwards, one curve for each N = 1, 2, 4, .. 64, Monte Carlo and ratio side by\n"
        "side; mu = 0.5, tau = 1, sigma_m = 0.5, sigma_t = 0.35, rho = 0. Lines are the exact laws, dashes eq. (22) as\n"
        "the supplement prints it, dots the samples.\n\nExample: clratio figures -o figures --count 1e9");
    command.on_call(run, [o] { return figures(*o); });
}

}  // namespace tool
