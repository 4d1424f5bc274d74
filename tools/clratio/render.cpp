// clratio render: a scene whose answer is known, as images that clratio combine takes.
#include <chrono>
#include <filesystem>
#include <set>

#include "clratio/image.hpp"
#include "command.hpp"
#include "error_options.hpp"
#include "frame_size.hpp"
#include "scene.hpp"

namespace tool {
namespace {

constexpr std::uint64_t most_pixels = 1u << 26;

struct Options {
    std::string scene, estimator = "wvds-mis", pattern = "iid", size = "200x150", seed = "1", rng = "philox", folder;
    std::uint32_t samples = 1, batches = 1;
    bool independent = false, gray = false, json = false;
};

struct Plan {
    NamedScene scene;
    clratio::Frame frame;
    clratio::Sampler sampler;
    clratio::Stream stream;
};

Plan plan_of(const Options& o) {
    Plan plan{find_scene(o.scene), frame_of(o.size, most_pixels), {}, {}};
    if (o.gray) plan.scene = gray(plan.scene);
    plan.sampler = {clratio::sampling_of(o.estimator), clratio::pattern_of(o.pattern), o.independent};
    plan.stream.seed = whole_number("--seed", o.seed);
    plan.stream.generator = o.rng == "philox" ? clratio::Generator::philox : clratio::Generator::pcg4d3x;
    const std::uint64_t most = o.rng == "philox" ? ~std::uint64_t{0} : 0xffffffffu;
    if (plan.stream.seed > most - (o.batches - 1))
        throw UsageError(fmt::format("--seed: batches take seeds up to {}", most));
    return plan;
}

void make_folder(const std::string& folder) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw clratio::IoError(folder, "", "cannot be made a folder: " + error.message());
}

/// "m.exr", or with several batches "m_000.exr", ..: in the order of the seeds under the shell's *.
std::string name_of_batch(char letter, std::uint32_t batch, std::uint32_t batches) {
    if (batches == 1) return fmt::format("{}.exr", letter);
    return fmt::format("{}_{:0{}}.exr", letter, batch, std::max<std::size_t>(3, std::to_string(batches - 1).size()));
}

/// Whether the * of the command that is printed at the end would find this file.
bool is_of_a_render(const std::string& name) {
    return name == "m.exr" || name == "t.exr" ||
           ((name.starts_with("m_") || name.starts_with("t_")) && name.ends_with(".exr"));
}

/// What an earlier render has left would be combined with what this one writes: other names are refused, and of its own
/// names none is left before the first is written.
void make_room(const Options& o) {
    std::set<std::string> written;
    for (std::uint32_t batch = 0; batch < o.batches; ++batch)
        for (const char letter : {'m', 't'}) written.insert(name_of_batch(letter, batch, o.batches));
    for (const auto& entry : std::filesystem::directory_iterator(o.folder)) {
        const std::string name = entry.path().filename().string();
        if (is_of_a_render(name) && !written.contains(name))
            throw clratio::IoError(entry.path().string(), "",
                                   "is of another render, and would be combined with this one; remove it, or choose "
                                   "another folder");
    }
    for (const std::string& name : written) {
        const auto file = std::filesystem::path(o.folder) / name;
        std::error_code failed;
        std::filesystem::remove(file, failed);
        if (failed) throw clratio::IoError(file.string(), "", "cannot be removed: " + failed.message());
    }
}

class Writer {
public:
    Writer(const Options& options, const Plan& plan)
        : folder_(options.folder), frame_(plan.frame), settings_{{"clratio/version", CLRATIO_VERSION},
                                                                 {"clratio/scene", json_of(plan.scene)},
                                                                 {"clratio/sampling", options.estimator},
                                                                 {"clratio/pattern", options.pattern},
                                                                 {"clratio/independent", options.independent ? "yes" : "no"},
                                                                 {"clratio/rng", options.rng},
                                                                 {"clratio/samples", std::to_string(options.samples)}} {}

    void exact(const std::string& name, std::vector<float> values) {
        write(name, std::move(values), {{"clratio/version", CLRATIO_VERSION}, settings_[1]});
    }
    void sampled(const std::string& name, std::vector<float> values, std::uint64_t seed) {
        auto settings = settings_;
        settings.emplace_back("clratio/seed", std::to_string(seed));
        write(name, std::move(values), std::move(settings));
    }
    const std::vector<std::string>& files() const { return files_; }

private:
    void write(const std::string& name, std::vector<float> values,
               std::vector<std::pair<std::string, std::string>> settings) {
        clratio::Image image;
        image.channels = {"R", "G", "B"};
        image.values = std::move(values);
        image.data_window = {0, 0, static_cast<int>(frame_.width) - 1, static_cast<int>(frame_.height) - 1};
        files_.push_back((std::filesystem::path(folder_) / name).string());
        clratio::write_image(files_.back(), image, {std::move(settings)});
    }

    std::string folder_;
    clratio::Frame frame_;
    std::vector<std::pair<std::string, std::string>> settings_;
    std::vector<std::string> files_;
};

struct Report {
    std::string device;
    std::vector<std::string> files;
    std::uint64_t hits = 0;
    double seconds = 0;  ///< of drawing
};

Report render_all(const Options& o, const Plan& plan) {
    const clratio::Engine engine;
    const Interrupt interrupt;
    ProgressLine line;
    line.show("the exact answer ...");
    const clratio::MediumScene scene(engine, plan.scene.scene, plan.frame);
    Writer writer(o, plan);
    Report report{engine.info().name, {}, 0, 0};
    const auto tau = clratio::tau_image(scene);
    for (std::size_t i = 0; i < tau.size(); i += 3) report.hits += tau[i] > 0 || tau[i + 1] > 0 || tau[i + 2] > 0;
    writer.exact("tau.exr", tau);
    writer.exact("reference.exr", clratio::reference_image(scene));
    for (std::uint32_t batch = 0; batch < o.batches; ++batch) {
        if (interrupt.asked())
            throw Stopped(fmt::format("stopped; {} of {} batches are written in {}", batch, o.batches, o.folder));
        line.show(fmt::format("batch {} of {} ...", batch + 1, o.batches));
        clratio::Stream stream = plan.stream;
        stream.seed += batch;
        const auto start = std::chrono::steady_clock::now();
        auto images = clratio::render(scene, plan.sampler, stream, o.samples);
        report.seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        writer.sampled(name_of_batch('m', batch, o.batches), std::move(images.m), stream.seed);
        writer.sampled(name_of_batch('t', batch, o.batches), std::move(images.t), stream.seed);
    }
    report.files = writer.files();
    return report;
}

void print_report(const Options& o, const Plan& plan, const Report& r) {
    const double samples = static_cast<double>(plan.frame.width) * plan.frame.height * o.samples * o.batches;
    if (o.json) {
        print({{"scene", plan.scene.name},
               {"title", plan.scene.title},
               {"estimator", o.estimator},
               {"pattern", o.pattern},
               {"independent", o.independent},
               {"samples", o.samples},
               {"batches", o.batches},
               {"seed", plan.stream.seed},
               {"rng", o.rng},
               {"width", plan.frame.width},
               {"height", plan.frame.height},
               {"rays_that_hit", r.hits},
               {"files", r.files},
               {"device", r.device},
               {"seconds", r.seconds},
               {"samples_per_second", samples / r.seconds}});
        return;
    }
    fmt::print("{}\n{} x {} pixels, {} rays hit the medium; {} batch{} of {} sample{}, {} {}, seeds {} to {}, on {}\n",
               plan.scene.title, plan.frame.width, plan.frame.height, r.hits, o.batches, o.batches == 1 ? "" : "es",
               o.samples, o.samples == 1 ? "" : "s", o.estimator, o.pattern, plan.stream.seed,
               plan.stream.seed + o.batches - 1, r.device);
    const char* const all = o.batches == 1 ? ".exr" : "_*.exr";
    fmt::print(
        "{0}/: tau.exr, reference.exr, {1} and {2}\n\nNext: clratio combine --m {0}/m{3} --t {0}/t{3} --tau {0}/tau.exr "
        "--reference {0}/reference.exr -o {0}/out.exr\n",
        o.folder, name_of_batch('m', 0, o.batches), name_of_batch('t', 0, o.batches), all);
}

int render(const Options& options) {
    const Plan plan = with_usage_errors([&] { return plan_of(options); });
    make_folder(options.folder);
    make_room(options);
    print_report(options, plan, render_all(options, plan));
    return ok;
}

constexpr auto footer =
    R"(Sunlight, scattered once in a box of fog, with spheres and boxes in its way: docs/study.md. SCENE is louvres, window,
spheres or dense, one of them with -gray behind it (each channel fades alike), or your own FILE.json; take one of
tools/scenes as a start.

Writes into DIR
  m.exr, t.exr     means of --spp samples of each pixel: m with the occluders, t without, of the same samples
  tau.exr          the exact mean of t: what a perfect t.exr would be
  reference.exr    the exact mean of m: what you wish m.exr were
m and t are one batch of weight --spp. With --batches B there are m_000.exr, t_000.exr, .. of seeds S, S + 1, ..
Batches of the same names are removed first; a folder with more of them is refused.

Estimators (where along a camera ray the fog is sampled)
  uni        evenly                          ds     by the fog on the ray, within the box (truncated)
  dsa        the same on an endless ray      dsm    ds for each channel in turn, balance heuristic
  wvds-mean  by the fog to the light and to the camera, mean extinction
  wvds-min   the same, least extinction      wvds-mis  the same for each channel in turn, balance heuristic
Patterns: iid; stratified, one sample in each of --spp parts; offset, a grid with one random shift.

Examples:
  clratio render louvres --spp 4 -o out
  clratio render tools/scenes/dense.json --spp 1 --batches 8 --seed 10 --size 400x300 -o out
  clratio combine --m out/m_*.exr --t out/t_*.exr --tau out/tau.exr --reference out/reference.exr -o out/all.exr)";

}  // namespace

void add_render(CLI::App& app, Run& run) {
    auto o = std::make_shared<Options>();
    Command command(app, "render", "Render a foggy scene whose exact answer is known");
    command.option("scene", o->scene, "A scene's name, or its FILE.json").required().type("SCENE");
    command.option("-o,--output", o->folder, "Folder for the images").required().type("DIR");
    command.option("-e,--estimator", o->estimator, "How distances are sampled").type("WORD").shows_default();
    command.option("--pattern", o->pattern, "iid, stratified or offset").type("WORD").shows_default();
    command.option("--spp", o->samples, "Samples of each pixel and batch").within(1, 1 << 24).type("N").shows_default();
    command.option("--batches", o->batches, "Pairs to write, each of a seed of its own")
        .within(1, 100000)
        .type("B")
        .shows_default();
    command.option("--seed", o->seed, "Seed of the first batch").type("WHOLE").shows_default();
    command.option("--size", o->size, "Pixels").type("WxH").shows_default();
    command.option("--rng", o->rng, "philox or pcg4d3x").one_of({"philox", "pcg4d3x"}).type("WORD").shows_default();
    command.flag("--independent", o->independent, "t from samples of its own: for contrast, do not use it");
    command.flag("--gray", o->gray, "Replace each extinction by their mean");
    command.flag("--json", o->json, "Print one JSON object");
    command.footer(footer);
    command.on_call(run, [o] { return render(*o); });
}

}  // namespace tool
