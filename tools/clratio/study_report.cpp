#include "study_report.hpp"

#include <sys/utsname.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <thread>

#include "audit.hpp"
#include "figures.hpp"
#include "output_file.hpp"
#include "png.hpp"
#include "study_page.hpp"
#include "study_svg.hpp"

namespace tool::study {
namespace {

using clratio::Pattern;
using clratio::Sampler;
using clratio::Sampling;

constexpr Sampler marching{Sampling::uni, Pattern::stratified, false};

Sampler iid(Sampling sampling) { return {sampling, Pattern::iid, false}; }

// ---- names for people

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
    add("<h1>Fog, shadows and ratio estimators</h1>\n<p class=\"lead\">How fast do renderings of light scattered once in "
        "fog "
        "converge, and does dividing out the unshadowed noise help? Measured against exact answers.</p>\n");
    add("<p>A camera looks into a box of fog. Sunlight enters, is scattered once and reaches the camera, unless a slat, a "
        "wall "
        "or a ball is in its way. Along each camera ray the renderer takes a few random points; <i>m</i> is the mean of the "
        "light from them with the shadows, <i>t</i> the mean without. The exact unshadowed light <i>τ</i> is known in "
        "closed "
        "form, and so the shadowed light can be estimated in two ways:</p>\n"
        "<p style=\"text-align:center\"><i>plain mean</i>: m &emsp;&emsp; <i>ratio</i>: τ · m / t</p>\n"
        "<p>The ratio divides out what is noise in the fog and leaves what is noise in the shadow. In these scenes the "
        "shadowed "
        "light is known exactly, too: every error below is the true error of a pixel’s colour, not a difference from "
        "another "
        "noisy picture.</p>\n");
    add(fmt::format(
        "<p>This run rendered {} images of {} × {} pixels for each of {} estimators in {} scenes, with N = 1, 2, 4, .. "
        "64 samples a pixel.{}</p>\n",
        plan.seeds, plan.frame.width, plan.frame.height, estimators_of(results_.scenes.front()).size(), plan.scenes.size(),
        times.quick ? " It is the quick study: a full one has 128 images of 200 × 150." : ""));
    add("<h3>In short</h3>\n<ul>\n");
    for (const auto& claim : claims) add(fmt::format("<li>{} {}</li>\n", escaped(claim.said), escaped(claim.summary)));
    add("</ul>\n<nav><a href=\"#scenes\">Scenes</a><a href=\"#claims\">Claims</a><a href=\"#convergence\">Convergence</a>"
        "<a href=\"#tables\">Error densities (Tables 1–4)</a><a href=\"#figures\">Error laws (Figures 1, 2)</a>"
        "<a href=\"#audit\">The equations</a><a href=\"#colophon\">How it was made</a></nav>\n");
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
    add("<h2 id=\"scenes\">The scenes</h2>\n<p>One ray through the middle of each pixel, light scattered once. The third "
        "picture "
        "is what a renderer gives after four samples (WVDS, MIS), the fourth is made of the same numbers.</p>\n");
    for (const auto& scene : results_.scenes) {
        const auto& lit = scene.lit.front();
        add(fmt::format("<h3>{}</h3>\n", escaped(scene.named.title)));
        shots(scene);
        const auto& m = scene.named.scene.medium;
        add(fmt::format(
            "<p class=\"note\">{} of {} rays meet the fog; {:.0f} % of these are fully lit. Extinction {:g}, {:g}, {:g}; "
            "scattering {:g}, {:g}, {:g}; g {:g}; {} spheres, {} boxes. Written <code>{}</code> on the command "
            "line.</p>\n",
            scene.parts.front().pixels, results_.plan.frame.width * results_.plan.frame.height, 100 * lit.share,
            m.sigma_t[0], m.sigma_t[1], m.sigma_t[2], m.sigma_s[0], m.sigma_s[1], m.sigma_s[2], m.g,
            scene.named.scene.spheres.size(), scene.named.scene.boxes.size(), escaped(scene.named.name)));
    }
}

void Page::claims(const std::vector<Claim>& claims) {
    add("<h2 id=\"claims\">Four claims, and what became of them</h2>\n<p>The supplement draws four conclusions from its "
        "tables. "
        "Here each is decided by the numbers of this run; two errors differ where they are 4 standard errors apart. "
        "<i>WVDS</i> draws distances by the fog toward both the light and the camera; <i>distance sampling</i> by the fog "
        "toward the camera alone: on an endless ray (untruncated) or within the box (truncated).</p>\n");
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

std::string key_of(const std::string& classes, bool line, const std::string& name) {
    return fmt::format(
        "<span><svg viewBox=\"0 0 36 12\">{}<circle class=\"mark {}\" cx=\"18\" cy=\"6\" r=\"3.2\"/></svg>{}</span>",
        line ? fmt::format("<path class=\"curve {}\" d=\"M0 6H36\"/>", classes) : "", classes, escaped(name));
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
    add("<h2 id=\"convergence\">Error against samples</h2>\n<p>Root mean squared error over all pixels whose rays meet the "
        "fog, "
        "all channels and images. Marks are measured. For independent samples the lines are not drawn through them: they "
        "are "
        "predicted from exact second moments, for the plain mean exactly, for the ratio to first order in 1/N. For ray "
        "marching, a grid with jitter, lines only join the marks.</p>\n<div class=\"key\">");
    for (const auto& line : lines)
        add(key_of(line.colour_class + (line.estimator.ratio ? "" : " plain"), true,
                   title_of(line.estimator.sampler) + (line.estimator.ratio ? ", ratio" : ", plain mean")));
    add("</div>\n<div class=\"plots\">\n");
    for (const auto& scene : results_.scenes)
        add(fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", convergence_plot(scene, lines),
                        escaped(scene.named.title)));
    add("</div>\n<details><summary>The numbers: RMSE × 1000 of all estimators, and what the second moments predict at N = "
        "64</summary>\n");
    for (const auto& scene : results_.scenes) number_table(scene);
    add("<p class=\"note\">One standard error in the tooltip, from the spread of the images, whose channels and pixels are "
        "summed "
        "first. Values with heavy tails (independent t, WVDS mean in a dense medium) have no stable RMSE: the median size "
        "of "
        "an error is given in errors.csv.</p></details>\n");
}

void Page::number_table(const SceneResult& scene) {
    add(fmt::format("<h3>{}</h3><div class=\"scroll\"><table class=\"numbers\"><tr><th>", escaped(scene.named.title)));
    for (std::uint32_t level = 0; level < levels; ++level) add(fmt::format("<th>N = {}", 1u << level));
    add("<th>predicted<th>bias, N = 1<th>bias, N = 64</tr>\n");
    for (const auto& e : estimators_of(scene)) {
        add(fmt::format("<tr><td>{}, {}", title_of(e.sampler), e.ratio ? "ratio" : "plain mean"));
        for (std::uint32_t level = 0; level < levels; ++level) {
            const auto s = statistics_of(scene.part(e.sampler), level, e.ratio, all_channels);
            add(fmt::format("<td title=\"± {:.2g}\">{:.4g}", 1e3 * s.rmse.error, 1e3 * s.rmse.value));
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
    add("<h2 id=\"tables\">Densities of the error</h2>\n<p>Laid out as the supplement’s Tables 1 to 4: a row for each "
        "estimator, a "
        "column for each N. In each cell the density of the error of red, green and blue is to the right, and the error "
        "goes "
        "upwards: above the dotted line a pixel is brighter than it should be, below it darker. Each cell is drawn to its "
        "own "
        "peak, so look at the shape and the spread; the number below is the RMSE × 1000. Pixels whose error is 0 are left "
        "out, since their spike would flatten everything else.</p>\n"
        "<p>The lobes of the ratio are no accident: with k of N samples in shadow the estimate is about τ(1 − k/N), so the "
        "errors of one pixel sit on a ladder of N + 1 rungs.</p>\n");
    for (std::size_t i = 0; i < results_.scenes.size(); ++i) density_table(results_.scenes[i], i + 1);
}

void Page::figures(std::uint64_t count) {
    const Figure figure = sampled_figure(engine_, {1}, count);
    add(fmt::format(
        "<h2 id=\"figures\">The law of the error</h2>\n<p>Apart from scenes: if the means of m and t are normal, the law "
        "of the ratio’s error is known. Figure 1 has the exact laws for μ = 0.5, τ = 1, σ<sub>m</sub> = 0.5, "
        "σ<sub>t</sub> = 0.35 and independent m and t; dashes are eq. (22) as the supplement prints it, which lacks "
        "a factor. Figure 2 has {} sampled errors of each beside them.</p>\n<figure>{}<figcaption>Figure 1. Laws."
        "</figcaption></figure>\n<figure>{}<figcaption>Figure 2. Samples.</figcaption></figure>\n",
        count, panels(panels_of(figure, false)), panels(panels_of(figure, true))));
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
    row("samples", times.seconds > 0 ? fmt::format("{:.3g} in {:.1f} s: {:.0f} million a second, errors counted on the way",
                                                   times.samples, times.seconds, times.samples / times.seconds / 1e6)
                                     : "all taken from earlier runs");
    row("time", fmt::format("{:.0f} s up to this page, {}", times.whole, utc_now()));
    add("</table>\n<p class=\"note\">Errors are counted on the device as whole numbers, so that errors.csv and "
        "densities.csv have the "
        "same bytes however the work is split, stopped and merged. The method is that of E. Velinov and K. Mitchell, "
        "<i>Ratio estimators</i>, supplemental material IV (doi:10.1109/TVCG.2021.3135764); scenes and numbers are this "
        "project’s own, and only the shape of the supplement’s tables can be compared.</p>\n</html>\n");
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
    page.figures(times.quick ? 1'000'000 : 10'000'000);
    page.audit();
    page.colophon(times);
    page.commit();
}

}  // namespace tool::study
