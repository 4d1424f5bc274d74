#include "study_report.hpp"

#include <sys/utsname.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <limits>
#include <thread>

#include "audit.hpp"
#include "figures.hpp"
#include "output_file.hpp"
#include "png.hpp"
#include "study_page.hpp"
#include "study_sections.hpp"
#include "study_svg.hpp"

namespace tool::study {
namespace {

using clratio::Pattern;
using clratio::Sampler;
using clratio::Sampling;

constexpr Sampler marching{Sampling::uni, Pattern::stratified, false};

Sampler iid(Sampling sampling) { return {sampling, Pattern::iid, false}; }

/// The rows of Tables 1 to 4; all others stand behind a fold.
bool in_table(const Estimator& e) {
    const auto& s = e.sampler;
    if (s.independent) return false;
    if (s.pattern == Pattern::stratified) return s.sampling == Sampling::uni;
    return s.pattern == Pattern::iid && (s.sampling == Sampling::uni || s.sampling == Sampling::ds ||
                                         s.sampling == Sampling::dsa || s.sampling == Sampling::wvds_mis);
}

/// As the supplement has them: marching first, then regular distance sampling, then WVDS.
int rank_of(const Estimator& e) {
    if (e.sampler.pattern != Pattern::iid) return 0;
    return e.sampler.sampling == Sampling::uni   ? 1
           : e.sampler.sampling == Sampling::dsa ? 2
           : e.sampler.sampling == Sampling::ds  ? 3
                                                 : 4;
}

// ---- pictures

std::string base64(const std::string& bytes) {
    constexpr auto digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out;
    for (std::size_t i = 0; i < bytes.size(); i += 3) {
        std::uint32_t word = 0;
        for (std::size_t k = 0; k < 3; ++k)
            word = word << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
        for (std::size_t k = 0; k < 4; ++k) out += i + k > bytes.size() ? '=' : digits[word >> (18 - 6 * k) & 63];
    }
    return out;
}

class Page {
public:
    Page(const Results& results, const clratio::Engine& engine, const std::string& file)
        : results_(results), engine_(engine), file_(file), out_(file) {}

    void add(const std::string& html) { out_.write(html); }
    void commit() { out_.commit(); }

    void head() {
        add(fmt::format("<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><meta name=\"viewport\" "
                        "content=\"width=device-width\">\n<title>clratio: fog, shadows and ratio estimators</title>\n"
                        "<style>{}</style>\n",
                        page_style));
    }
    void introduction(const std::vector<Claim>& claims, const RunTimes& times);
    void scenes();
    void claims(const std::vector<Claim>& claims);
    void convergence();
    void tables();
    void figures(std::uint64_t count);
    void audit();
    void colophon(const RunTimes& times);

private:
    void shots(const SceneResult& scene);
    void density_table(const SceneResult& scene, std::size_t number);
    void density_rows(const SceneResult& scene, const std::vector<Estimator>& rows);
    void number_table(const SceneResult& scene);

    const Results& results_;
    clratio::Engine engine_;
    std::string file_;
    OutputFile out_;
};

std::string verdict_html(Verdict v) {
    const char* classes[] = {"holds", "weakly", "fails", "undecided"};
    return fmt::format("<span class=\"verdict {}\">{}</span>", classes[static_cast<std::size_t>(v)], name_of(v));
}

void Page::introduction(const std::vector<Claim>& claims, const RunTimes& times) {
    const auto& plan = results_.plan;
    add(page_introduction);
    add(fmt::format(page_run, plan.seeds, plan.frame.width, plan.frame.height, estimators_of(results_.scenes.front()).size(),
                    plan.scenes.size(),
                    times.quick ? " It is the quick study: a full one has 128 images of 200 × 150." : ""));
    add("<h3>In short</h3>\n<ul>\n");
    for (const auto& claim : claims) add(fmt::format("<li>{} {}</li>\n", escaped(claim.said), escaped(claim.summary)));
    add(page_contents);
}

double brightest(std::vector<float> values) {
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 97 / 100);
    std::nth_element(values.begin(), at, values.end());
    return std::max(1e-12, static_cast<double>(*at));
}

void Page::shots(const SceneResult& scene) {
    const clratio::Frame frame = results_.plan.frame;
    const clratio::MediumScene device(engine_, scene.named.scene, frame);
    const auto tau = clratio::tau_image(device), reference = clratio::reference_image(device);
    const auto noisy = clratio::render(device, iid(Sampling::wvds_mis), {0}, 4);
    auto ratio = noisy.m;
    for (std::size_t i = 0; i < ratio.size(); ++i) ratio[i] = noisy.t[i] > 0 ? tau[i] * (noisy.m[i] / noisy.t[i]) : 0;
    const double scale = 0.9 / brightest(reference);
    const auto shot = [&](const std::vector<float>& values, const std::string& caption) {
        Canvas canvas(static_cast<int>(frame.width), static_cast<int>(frame.height), 0);
        for (std::size_t i = 0; i < values.size(); i += 3)
            canvas.set(static_cast<int>(i / 3 % frame.width), static_cast<int>(i / 3 / frame.width),
                       {srgb(scale * static_cast<double>(values[i])), srgb(scale * static_cast<double>(values[i + 1])),
                        srgb(scale * static_cast<double>(values[i + 2]))});
        add(fmt::format("<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"><figcaption>{0}</figcaption></figure>\n",
                        caption, base64(png_of(canvas, file_))));
    };
    add("<div class=\"shots\">\n");
    shot(tau, "τ: without shadows, exact");
    shot(reference, "with shadows, exact");
    shot(noisy.m, "4 samples, plain mean");
    shot(ratio, "the same 4 samples, ratio");
    add("</div>\n");
}

void Page::scenes() {
    add(page_scenes);
    for (const auto& scene : results_.scenes) {
        const auto& lit = scene.lit.front();
        add(fmt::format("<h3>{}</h3>\n", escaped(scene.named.title)));
        shots(scene);
        const auto& m = scene.named.scene.medium;
        add(fmt::format(page_scene, scene.parts.front().pixels, results_.plan.frame.width * results_.plan.frame.height,
                        100 * lit.share, m.sigma_t[0], m.sigma_t[1], m.sigma_t[2], m.sigma_s[0], m.sigma_s[1], m.sigma_s[2],
                        m.g, scene.named.scene.spheres.size(), scene.named.scene.boxes.size(), escaped(scene.named.name)));
    }
}

void Page::claims(const std::vector<Claim>& claims) {
    add(page_claims);
    for (const auto& claim : claims) {
        add(fmt::format("<h3>({}) {}</h3>\n<p>{}</p>\n", claim.id, escaped(claim.said), escaped(claim.summary)));
        add(fmt::format("<details{}><summary>{} numbers</summary><div class=\"scroll\"><table class=\"findings\">\n",
                        claim.findings.size() <= 8 ? " open" : "", claim.findings.size()));
        for (const auto& f : claim.findings)
            add(fmt::format("<tr><td>{}<td>{}<td>{}<td>{}</tr>\n", escaped(f.scene), escaped(f.what),
                            verdict_html(f.verdict), escaped(f.numbers)));
        add("</table></div></details>\n");
    }
}

void Page::convergence() {
    const std::vector<Line> lines{{{marching, false}, "c1"},
                                  {{marching, true}, "c1"},
                                  {{iid(Sampling::uni), false}, "c5"},
                                  {{iid(Sampling::dsa), false}, "c2"},
                                  {{iid(Sampling::dsa), true}, "c2"},
                                  {{iid(Sampling::ds), true}, "c3"},
                                  {{iid(Sampling::wvds_mis), false}, "c4"},
                                  {{iid(Sampling::wvds_mis), true}, "c4"}};
    add(page_convergence);
    for (const auto& line : lines)
        add(key_of(line.colour_class + (line.estimator.ratio ? "" : " plain"), true,
                   title_of(line.estimator.sampler) + (line.estimator.ratio ? ", ratio" : ", plain mean")));
    add("</div>\n<div class=\"plots\">\n");
    for (const auto& scene : results_.scenes)
        add(fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", convergence_plot(scene, lines),
                        escaped(scene.named.title)));
    add(page_numbers);
    for (const auto& scene : results_.scenes) number_table(scene);
    add(page_numbers_end);
}

/// The exact number, in brackets, where the largest errors, which are counted as smaller ones, are missed in the other.
std::string what_is_missed(const SceneResult& scene, const Estimator& e, std::uint32_t level, const Estimate& rmse) {
    const double exact = e.ratio ? std::numeric_limits<double>::quiet_NaN() : predicted_rmse(scene, e, level, all_channels);
    return rmse.value < exact - 4 * rmse.error ? fmt::format(" ({:.4g})", 1e3 * exact) : "";
}

void Page::number_table(const SceneResult& scene) {
    add(fmt::format("<h3>{}</h3><div class=\"scroll\"><table class=\"numbers\"><tr><th>", escaped(scene.named.title)));
    for (std::uint32_t level = 0; level < levels; ++level) add(fmt::format("<th>N = {}", 1u << level));
    add("<th>predicted<th>bias, N = 1<th>bias, N = 64</tr>\n");
    for (const auto& e : estimators_of(scene)) {
        add(fmt::format("<tr><td>{}, {}", title_of(e.sampler), e.ratio ? "ratio" : "plain mean"));
        for (std::uint32_t level = 0; level < levels; ++level) {
            const auto s = statistics_of(scene.part(e.sampler), level, e.ratio, all_channels);
            add(std::isnan(s.rmse.error) ? fmt::format("<td>{:.4g}", 1e3 * s.rmse.value)
                                         : fmt::format("<td title=\"± {:.2g}, ± {:.2g} by pixels\">{:.4g}",
                                                       1e3 * s.rmse.error, 1e3 * s.rmse_pixel_error, 1e3 * s.rmse.value));
            add(what_is_missed(scene, e, level, s.rmse));
        }
        const double predicted = predicted_rmse(scene, e, levels - 1, all_channels);
        add(std::isnan(predicted) ? std::string("<td>–") : fmt::format("<td>{:.4g}", 1e3 * predicted));
        for (const std::uint32_t level : {0u, levels - 1})
            add(fmt::format("<td>{:.2g}",
                            1e3 * statistics_of(scene.part(e.sampler), level, e.ratio, all_channels).bias.value));
        add("</tr>\n");
    }
    add("</table></div>\n");
}

void Page::density_rows(const SceneResult& scene, const std::vector<Estimator>& rows) {
    add("<div class=\"scroll\"><table class=\"densities\"><thead><tr><th>");
    for (std::uint32_t level = 0; level < levels; ++level) add(fmt::format("<th>N = {}", 1u << level));
    add("</tr></thead>\n");
    for (const auto& e : rows) {
        add(fmt::format("<tr><th>{}<span>{}</span>", title_of(e.sampler), e.ratio ? "ratio" : "plain mean"));
        for (std::uint32_t level = 0; level < levels; ++level) {
            const auto s = statistics_of(scene.part(e.sampler), level, e.ratio, all_channels);
            add(fmt::format("<td>{}<div>{:.3g}</div>", density_cell(scene, e, level), 1e3 * s.rmse.value));
        }
        add("</tr>\n");
    }
    add("</table></div>\n");
}

void Page::density_table(const SceneResult& scene, std::size_t number) {
    std::vector<Estimator> main, others;
    for (const auto& e : estimators_of(scene)) (in_table(e) ? main : others).push_back(e);
    std::stable_sort(main.begin(), main.end(), [](const auto& a, const auto& b) { return rank_of(a) < rank_of(b); });
    const auto s = statistics_of(scene.part(iid(Sampling::wvds_mis)), 0, true, all_channels);
    add(fmt::format(
        "<h3>Table {}. {}</h3>\n<p class=\"note\">Errors from −{:g} (bottom) to {:g} (top). {:.0f} % of the ratio’s errors "
        "at N = 1 are 0 and not drawn.</p>\n",
        number, escaped(scene.named.title), scene.named.range, scene.named.range, 100 * s.atom));
    density_rows(scene, main);
    add("<details><summary>The other samplings and patterns</summary>\n");
    density_rows(scene, others);
    add("</details>\n");
}

void Page::tables() {
    add(page_tables);
    for (std::size_t i = 0; i < results_.scenes.size(); ++i) density_table(results_.scenes[i], i + 1);
}

/// 10<sup>6</sup>.
std::string power_of_ten_html(std::uint64_t count) {
    return fmt::format("10<sup>{:.0f}</sup>", std::log10(static_cast<double>(count)));
}

void Page::figures(std::uint64_t count) {
    const Figure figure = sampled_figure(engine_, {1}, count);
    add(fmt::format(page_figures, power_of_ten_html(count), panels(panels_of(figure, false)),
                    panels(panels_of(figure, true))));
}

void Page::audit() {
    const auto report = audit::examine({engine_, 1'000'000}, [](const char*) {});
    std::size_t numbers = 0, failed = 0;
    for (const auto& finding : report.findings)
        for (const auto& n : finding.numbers) {
            ++numbers;
            failed += !audit::holds(n);
        }
    add(fmt::format(
        "<h2 id=\"audit\">The supplement’s equations</h2>\n<p>{} equations and sentences, each checked now with {} numbers "
        "in "
        "all: {}. <code>clratio audit</code> says more on each.</p>\n<div class=\"scroll\"><table class=\"findings\">\n",
        report.findings.size(), numbers, failed == 0 ? "all as expected" : fmt::format("{} NOT as expected", failed)));
    for (const auto& finding : report.findings) {
        const char* classes[] = {"holds", "weakly", "fails"};
        add(fmt::format("<tr><td>{}<td>{}<td><span class=\"verdict {}\">{}</span><td>{}</tr>\n",
                        finding.equation == "text" ? "text" : "(" + finding.equation + ")", escaped(finding.said),
                        classes[static_cast<std::size_t>(finding.verdict)], audit::name_of(finding.verdict),
                        escaped(finding.truth)));
    }
    add("</table></div>\n");
}

std::string utc_now() {
    const std::time_t now = std::time(nullptr);
    std::tm parts{};
    gmtime_r(&now, &parts);
    char text[32];
    std::strftime(text, sizeof text, "%Y-%m-%d %H:%M UTC", &parts);
    return text;
}

void Page::colophon(const RunTimes& times) {
    const auto& plan = results_.plan;
    const auto& device = engine_.info();
    utsname system{};
    uname(&system);
    add("<h2 id=\"colophon\">How it was made</h2>\n<table class=\"findings\">\n");
    const auto row = [&](const std::string& name, const std::string& value) {
        add(fmt::format("<tr><th>{}<td>{}</tr>\n", name, escaped(value)));
    };
    row("clratio", CLRATIO_VERSION);
    row("device", fmt::format("{}, {} compute units", device.name, device.compute_units));
    row("OpenCL", fmt::format("{}, {}, driver {}", device.platform, device.version, device.driver));
    row("system", fmt::format("{} {} on {}, {} threads", system.sysname, system.release, system.machine,
                              std::thread::hardware_concurrency()));
    row("random numbers", fmt::format("Philox4x32-10, seeds 0 to {}", plan.seeds - 1));
    const PartTime& t = times.computed;
    row("samples", t.seconds > 0 ? fmt::format("{:.3g} in {:.1f} s: {:.0f} million a second, errors counted on the way",
                                               t.samples, t.seconds, t.samples / t.seconds / 1e6)
                                 : "all taken from earlier runs");
    row("time", fmt::format("{:.0f} s up to this page, {}", times.whole, utc_now()));
    add(page_end);
}

}  // namespace

void write_report(const Results& results, const std::vector<Claim>& claims, const clratio::Engine& engine,
                  const RunTimes& times, const std::string& file) {
    Page page(results, engine, file);
    page.head();
    page.introduction(claims, times);
    page.scenes();
    page.claims(claims);
    page.convergence();
    page.tables();
    page.add(chords_section(results));
    page.add(averages_section(results));
    page.figures(times.quick ? 1'000'000 : 10'000'000);
    page.audit();
    page.add(speed_section(results, times, engine.info().name));
    page.colophon(times);
    page.commit();
}

}  // namespace tool::study
