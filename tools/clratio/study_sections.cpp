// The report's closer looks: short chords, averaged ratios, speed.
#include "study_sections.hpp"

#include <algorithm>
#include <cmath>

#include "study_page.hpp"
#include "study_svg.hpp"

namespace tool::study {

using clratio::Pattern;
using clratio::Sampler;
using clratio::Sampling;

const char* title_of(Sampling sampling) {
    switch (sampling) {
    case Sampling::uni:
        return "Uniform";
    case Sampling::ds:
        return "Distance, truncated";
    case Sampling::dsa:
        return "Distance, untruncated";
    case Sampling::dsm:
        return "Distance, MIS";
    case Sampling::wvds_mean:
        return "WVDS, mean";
    case Sampling::wvds_min:
        return "WVDS, least";
    case Sampling::wvds_mis:
        break;
    }
    return "WVDS, MIS";
}

std::string title_of(const Sampler& s) {
    if (s.sampling == Sampling::uni && s.pattern != Pattern::iid)
        return std::string("Ray marching, ") + std::string(clratio::name_of(s.pattern));
    if (s.independent) return std::string(title_of(s.sampling)) + ", independent t";
    return std::string(title_of(s.sampling)) +
           (s.pattern == Pattern::iid ? "" : ", " + std::string(clratio::name_of(s.pattern)));
}

std::string key_of(const std::string& classes, bool line, const std::string& name) {
    return fmt::format(
        "<span><svg viewBox=\"0 0 36 12\">{}<circle class=\"mark {}\" cx=\"18\" cy=\"6\" r=\"3.2\"/></svg>{}</span>",
        line ? fmt::format("<path class=\"curve {}\" d=\"M0 6H36\"/>", classes) : "", classes, escaped(name));
}

namespace {

/// Three digits.
std::string digits(double x) {
    if (std::isnan(x)) return "–";
    return std::abs(x) >= 100 ? fmt::format("{:.0f}", x) : fmt::format("{:#.3g}", x);
}

std::string with_error(const Estimate& e, double scale) {
    return std::isnan(e.error) ? "<td>" + digits(scale * e.value)
                               : fmt::format("<td title=\"± {:.2g}\">{}", scale * e.error, digits(scale * e.value));
}

std::string averages_sentence(const Results& results) {
    std::size_t cases = 0, kept = 0;
    double worst = 0;
    std::string example;
    for (const auto& scene : results.scenes)
        for (const auto& line : scene.averages.lines) {
            if (line.level != levels - 1) continue;
            const auto& bias = line.of_ratios.bias;
            const double ratio = line.of_ratios.rmse.value / std::max(1e-30, line.of_means.rmse.value);
            ++cases;
            kept += std::abs(bias.value) > 4 * bias.error;
            if (ratio <= worst) continue;
            worst = ratio;
            example =
                fmt::format("{} ({}): RMSE × 1000 at N = 64 is {:.3g} for the mean of ratios, {:.3g} for the ratio of means",
                            escaped(scene.named.name), title_of(line.sampling), 1e3 * line.of_ratios.rmse.value,
                            1e3 * line.of_means.rmse.value);
        }
    return fmt::format("At N = 64 the mean of ratios is still biased by more than 4 standard errors in {} of {} cases. "
                       "Furthest apart are the two in {}.",
                       kept, cases, example);
}

/// Samples, the seconds they would have taken had every part been as fast as the middle one, and those they took.
struct Speed {
    double samples = 0, usual = 0, seconds = 0;
    Speed& operator+=(const Speed& o) {
        samples += o.samples;
        usual += o.usual;
        seconds += o.seconds;
        return *this;
    }
};

Speed speed_of(const std::vector<PartTime>& parts) {
    std::vector<double> rates;
    Speed out;
    for (const auto& part : parts) {
        rates.push_back(part.samples / part.seconds);
        out.samples += part.samples;
        out.seconds += part.seconds;
    }
    if (rates.empty()) return out;
    const auto middle = rates.begin() + static_cast<std::ptrdiff_t>(rates.size() / 2);
    std::nth_element(rates.begin(), middle, rates.end());
    out.usual = out.samples / *middle;
    return out;
}

std::string speed_cells(const std::vector<Speed>& cells) {
    std::string html;
    Speed all;
    const auto rate = [](const Speed& s) {
        return s.usual > 0 ? fmt::format("<td>{:.0f}", s.samples / s.usual / 1e6) : std::string("<td>–");
    };
    for (const auto& cell : cells) {
        html += rate(cell);
        all += cell;
    }
    return html + rate(all) + fmt::format("<td>{:.1f}</tr>\n", all.seconds);
}

}  // namespace

std::string chords_section(const Results& results) {
    std::string html;
    const auto add = [&](const std::string& more) { html += more; };
    const auto& first = results.scenes.front().chords;
    add(fmt::format(page_chords, first.samples, first.seeds));
    for (const auto& e : first.errors)
        add(fmt::format("<th class=\"pair\">{}<br>plain mean<th><br>ratio", title_of(e.sampling)));
    add("</tr>\n");
    for (const auto& scene : results.scenes) {
        add(fmt::format("<tr><td>{}<td>{:.1f} %", escaped(scene.named.name), 100 * scene.chords.longest));
        for (const auto& e : scene.chords.errors)
            add(fmt::format("<td class=\"pair\" title=\"± {:.2g}\">{}<small>{}</small>{}",
                            std::isnan(e.plain.error) ? 0 : e.plain.error, digits(e.plain.value), digits(e.predicted),
                            with_error(e.ratio, 1)));
        add("</tr>\n");
    }
    add(page_chords_end);
    return html;
}

std::string averages_section(const Results& results) {
    std::string html;
    const auto add = [&](const std::string& more) { html += more; };
    const auto& first = results.scenes.front().averages;
    const std::vector<std::string> classes{"c5", "c3"};
    add(fmt::format(page_averages, first.seeds, first.frame.width, first.frame.height, averages_sentence(results)));
    for (std::size_t i = 0; i < classes.size(); ++i)
        for (const bool ratios : {true, false})
            add(key_of(classes[i] + (ratios ? "" : " plain"), true,
                       std::string(title_of(first.lines[i * levels].sampling)) +
                           (ratios ? ", mean of ratios" : ", ratio of means")));
    add("</div>\n<div class=\"plots\">\n");
    for (const auto& scene : results.scenes)
        add(fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", bias_plot(scene, classes),
                        escaped(scene.named.title)));
    add("</div>\n");
    add(page_averages_end);
    for (const auto& scene : results.scenes)
        for (std::size_t i = 0; i < classes.size(); ++i)
            for (const bool ratios : {true, false}) {
                const auto* line = &scene.averages.lines[i * levels];
                add(fmt::format("<tr><td>{}<td>{}<td>{}", escaped(scene.named.name), title_of(line->sampling),
                                ratios ? "mean of ratios" : "ratio of means"));
                const auto at = [&](std::size_t level) -> const RmseAndBias& {
                    return ratios ? line[level].of_ratios : line[level].of_means;
                };
                for (const std::size_t level : {0, 2, 6}) add(with_error(at(level).bias, 1e3));
                for (const std::size_t level : {0, 2, 6}) add(with_error(at(level).rmse, 1e3));
                add("</tr>\n");
            }
    add("</table></div></details>\n");
    return html;
}

std::string speed_section(const Results& results, const RunTimes& times, const std::string& device) {
    std::string html = fmt::format(page_speed, escaped(device));
    for (const auto& scene : results.scenes) html += fmt::format("<th>{}", escaped(scene.named.name));
    html += "<th>all<th>seconds</tr>\n";
    std::vector<Speed> of_scenes(results.scenes.size());
    std::uint64_t timed = 0, parts = 0;
    double spread_seconds = 0;
    for (const auto& series : results.scenes.front().series) {
        std::vector<Speed> row(results.scenes.size());
        for (const auto& t : times.series) {
            if (!(Series{0, t.series.sampler} == Series{0, series.sampler})) continue;
            row[t.series.scene] += speed_of(t.timed);
            of_scenes[t.series.scene] += speed_of(t.timed);
            timed += t.timed.size();
            parts += t.parts;
            for (const auto& part : t.timed) spread_seconds += part.spread_seconds;
        }
        html += "<tr><td>" + title_of(series.sampler) + speed_cells(row);
    }
    html += "<tr class=\"total\"><td>all" + speed_cells(of_scenes);
    return html + fmt::format(page_speed_end, timed, parts, spread_seconds, times.looks);
}

}  // namespace tool::study
