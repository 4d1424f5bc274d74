// clratio study: the errors of every estimator in every scene, against the number of samples, and the report on them.
#include <algorithm>
#include <chrono>
#include <filesystem>

#include "command.hpp"
#include "error_options.hpp"
#include "frame_size.hpp"
#include "study_report.hpp"

namespace tool {
namespace {

using namespace study;
namespace fs = std::filesystem;

struct Options {
    std::vector<std::string> scenes, merge;
    std::string size, folder, shard;
    std::uint64_t seeds = 0;
    int lanes = 0;
    bool quick = false, gray = false, no_report = false, json = false;
};

struct Shard {
    std::uint64_t index = 1, count = 1;
};

Shard shard_of(const std::string& text) {
    if (text.empty()) return {};
    const auto slash = text.find('/');
    Shard shard{0, 0};
    if (slash != std::string::npos)
        shard = {whole_number("--shard", text.substr(0, slash)), whole_number("--shard", text.substr(slash + 1))};
    if (shard.index < 1 || shard.index > shard.count)
        throw UsageError("--shard: expected I/N with 1 <= I <= N, such as 2/4, got " + text);
    return shard;
}

Plan plan_of(const Options& o) {
    Plan plan;
    plan.frame = frame_of(!o.size.empty() ? o.size : o.quick ? "80x60" : "200x150", most_pixels);
    plan.seeds = o.seeds != 0 ? o.seeds : o.quick ? 16 : 128;
    for (const auto& name : o.scenes.empty() ? scene_names() : o.scenes) {
        plan.scenes.push_back(find_scene(name));
        if (o.gray) plan.scenes.push_back(gray(plan.scenes.back()));
    }
    for (std::size_t i = 0; i < plan.scenes.size(); ++i)
        for (std::size_t j = 0; j < i; ++j)
            if (plan.scenes[i].name == plan.scenes[j].name)
                throw UsageError(plan.scenes[i].name + ": two scenes of this name");
    return plan;
}

/// Copies what other folders have and this one has not: parts that are whole and belong to this study.
std::uint64_t take_parts(const PartFolder& own, const Plan& plan, const std::vector<std::string>& folders) {
    std::uint64_t taken = 0;
    for (const auto& folder : folders) {
        if (!fs::is_directory(fs::path(folder) / "parts"))
            throw clratio::IoError(folder, "", "cannot be merged: no folder parts in it");
        const PartFolder other((fs::path(folder) / "parts").string(), plan);
        for (const auto& piece : pieces_of(plan)) {
            Part part;
            if (own.read(piece, part) || !other.read(piece, part)) continue;
            own.write(piece, part);
            ++taken;
        }
    }
    return taken;
}

/// What this run did, for people.
struct Work {
    std::uint64_t pieces = 0, found = 0, taken = 0, computed = 0;
    PartTime computed_time;
    double looks = 0;  ///< seconds for what is not in parts
};

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Of the rays that meet the fog: the others need none.
double samples_of(const Piece& piece, const Part& part) {
    const auto& sampler = piece.series.sampler;
    const double a_pixel = sampler.pattern == clratio::Pattern::iid ? 1u << (levels - 1) : (1u << levels) - 1;
    return static_cast<double>(part.seeds * part.pixels) * a_pixel * (sampler.independent ? 2 : 1);
}

class Runner {
public:
    Runner(const Options& options, const Plan& plan, const clratio::Engine& engine)
        : options_(options), plan_(plan), engine_(engine), shard_(shard_of(options.shard)),
          folder_((fs::path(options.folder) / "parts").string(), plan), times_(options.folder, engine) {
        work_.taken = take_parts(folder_, plan, options.merge);
    }

    /// All pieces of this shard are on disk afterwards.
    void compute_missing() {
        const auto pieces = pieces_of(plan_);
        std::vector<Piece> missing;
        for (std::size_t i = shard_.index - 1; i < pieces.size(); i += shard_.count) {
            Part part;
            ++work_.pieces;
            if (folder_.read(pieces[i], part))
                ++work_.found;
            else
                missing.push_back(pieces[i]);
        }
        for (const auto& piece : missing) {
            show(piece, missing.size());
            compute_one(piece);
        }
        line_.clear();
    }

    Results results() {
        Results out{plan_, {}};
        const auto start = std::chrono::steady_clock::now();
        const PartTime before = work_.computed_time;
        const auto series = plan_.series();
        const auto pieces = pieces_of(plan_);
        for (std::size_t s = 0; s < plan_.scenes.size(); ++s) {
            line_.show(plan_.scenes[s].name + ": predictions ...");
            SceneResult scene{plan_.scenes[s],  {},         {}, predict_scene(plan_.scenes[s].scene, plan_.frame), {},
                              closer_chords(s), averages(s)};
            for (const auto& one : series)
                if (one.scene == s) scene.series.push_back(one);
            scene.parts.resize(scene.series.size());
            for (const auto& piece : pieces) {
                if (piece.series.scene != s) continue;
                const auto at = std::find(scene.series.begin(), scene.series.end(), piece.series) - scene.series.begin();
                Part part;
                if (!folder_.read(piece, part)) part = compute_one(piece);
                scene.parts[static_cast<std::size_t>(at)] += part;
            }
            for (const auto sampling : clratio::all_samplings) scene.lit.push_back(lit_errors(on_device(s), sampling));
            out.scenes.push_back(std::move(scene));
            if (interrupt_.asked()) stop();
        }
        const PartTime& after = work_.computed_time;
        work_.looks =
            seconds_since(start) - (after.seconds - before.seconds) - (after.spread_seconds - before.spread_seconds);
        line_.clear();
        return out;
    }

    std::vector<SeriesTime> times() const {
        std::vector<SeriesTime> out;
        for (const auto& series : plan_.series()) out.push_back({series, 0, {}});
        for (const auto& piece : pieces_of(plan_)) {
            auto& to = *std::find_if(out.begin(), out.end(), [&](const auto& t) { return t.series == piece.series; });
            ++to.parts;
            if (const auto time = times_.find(folder_.name_of(piece))) to.timed.push_back(*time);
        }
        return out;
    }

    const clratio::MediumScene& on_device(std::size_t scene) {
        if (!device_scene_ || at_ != scene) device_scene_.emplace(engine_, plan_.scenes[scene].scene, plan_.frame);
        at_ = scene;
        return *device_scene_;
    }

    const Work& work() const { return work_; }
    const Shard& shard() const { return shard_; }

private:
    Part compute_one(const Piece& piece) {
        const auto& scene = on_device(piece.series.scene);
        const auto start = std::chrono::steady_clock::now();
        Part part = compute(scene, plan_.scenes[piece.series.scene], piece, [this](auto, auto) {
            if (interrupt_.asked()) stop();
            return true;
        });
        PartTime time{samples_of(piece, part), seconds_since(start), 0};
        add_spreads(part, scene, piece);
        time.spread_seconds = seconds_since(start) - time.seconds;
        work_.computed_time += time;
        folder_.write(piece, part);
        times_.add(folder_.name_of(piece), time);
        ++work_.computed;
        return part;
    }

    std::uint64_t few_seeds() const { return std::min(seeds_a_piece, plan_.seeds); }

    ShortChords closer_chords(std::size_t scene) {
        line_.show(plan_.scenes[scene].name + ": short chords ...");
        return short_chords(on_device(scene), few_seeds());
    }

    Averages averages(std::size_t scene) {
        line_.show(plan_.scenes[scene].name + ": averages of ratios ...");
        return averages_of({engine_, plan_.scenes[scene].scene, averages_frame(plan_.frame)}, few_seeds());
    }

    void show(const Piece& piece, std::size_t missing) {
        if (interrupt_.asked()) stop();
        line_.show(fmt::format("part {} of {}: {}", work_.computed + 1, missing, folder_.name_of(piece)));
    }

    [[noreturn]] void stop() {
        line_.clear();
        throw Stopped(fmt::format("stopped; {} of {} parts are in {}/parts: the same command goes on from there",
                                  work_.found + work_.computed, work_.pieces, options_.folder));
    }

    const Options& options_;
    const Plan& plan_;
    clratio::Engine engine_;
    Shard shard_;
    PartFolder folder_;
    TimeLog times_;
    Work work_;
    ProgressLine line_;
    Interrupt interrupt_;
    std::optional<clratio::MediumScene> device_scene_;
    std::size_t at_ = 0;
};

void print_work(const Options& o, const Work& w, const std::vector<Claim>& claims, const std::vector<std::string>& files) {
    const PartTime& time = w.computed_time;
    if (o.json) {
        Json out{{"parts", w.pieces},       {"found", w.found},        {"taken", w.taken}, {"computed", w.computed},
                 {"samples", time.samples}, {"seconds", time.seconds}, {"files", files},   {"claims", Json::array()}};
        for (const auto& claim : claims) out["claims"].push_back(json_of(claim));
        print(out);
        return;
    }
    fmt::print("{} parts: {} found, {} of them taken from elsewhere, {} computed", w.pieces, w.found, w.taken, w.computed);
    if (w.computed > 0)
        fmt::print(": {:.3g} samples in {:.1f} s, {:.0f} M/s", time.samples, time.seconds,
                   time.samples / time.seconds / 1e6);
    fmt::print("\n");
    for (const auto& claim : claims) fmt::print("\n{}", text_of(claim));
    if (!files.empty()) fmt::print("\n{}\n", fmt::join(files, "\n"));
}

int study_command(const Options& options) {
    const auto start = std::chrono::steady_clock::now();
    const Plan plan = with_usage_errors([&] { return plan_of(options); });
    shard_of(options.shard);
    clratio::EngineOptions engine_options;
    engine_options.width = options.lanes;
    const clratio::Engine engine = with_usage_errors([&] { return clratio::Engine(engine_options); });
    Runner runner(options, plan, engine);
    runner.compute_missing();
    std::vector<Claim> claims;
    std::vector<std::string> files;
    if (runner.shard().count == 1) {
        const Results results = runner.results();
        const auto path_of = [&](const char* name) {
            return files.emplace_back((fs::path(options.folder) / name).string());
        };
        claims = claims_of(results);
        write_errors_csv(results, path_of("errors.csv"));
        write_densities_csv(results, path_of("densities.csv"));
        write_chords_csv(results, path_of("short_chords.csv"));
        write_averages_csv(results, path_of("averages.csv"));
        const auto& w = runner.work();
        const RunTimes times{options.quick, w.computed_time, seconds_since(start), w.looks, runner.times()};
        if (!options.no_report) write_report(results, claims, engine, times, path_of("report.html"));
    }
    print_work(options, runner.work(), claims, files);
    return ok;
}

constexpr auto footer =
    R"(Renders each scene with each estimator and --seeds seeds, for N = 1, 2, 4, .. 64 samples a pixel, with and without the
ratio, and compares with the exact answer. Writes into DIR

  report.html    everything, to read: scenes, error densities, convergence, claims with their verdicts
  errors.csv     root mean squared error, bias, median, shares, prediction: a line for each estimator, N and channel
  densities.csv  the histograms of the errors
  short_chords.csv, averages.csv   errors where rays only touch the fog; the mean of ratios against the ratio of means
  parts/         finished parts of the work; times.jsonl: how long each took

A study that was stopped or killed goes on when the same command is given again. Several machines share the work with
--shard; copy their folders to one place and give them to --merge, or copy the files of their parts/ into one. The CSV files
have the same bytes however the work was split.

Examples:
  clratio study --quick -o study                      # seconds
  clratio study -o study                              # 128 images of 200x150 for each: minutes
  clratio study --shard 1/2 -o half1                  # on one machine
  clratio study --shard 2/2 -o half2                  # on another
  clratio study --merge half1 half2 -o study          # and then
  clratio study --scenes window,my_scene.json --seeds 32 -o study)";

}  // namespace

void add_study(CLI::App& app, Run& run) {
    auto o = std::make_shared<Options>();
    Command command(app, "study", "Errors against samples, for all estimators and scenes, and a report");
    command.option("-o,--output", o->folder, "Folder for the results; made where there is none").required().type("DIR");
    command.option("--scenes", o->scenes, "Names or FILE.json, with commas between; all four without it")
        .commas()
        .type("SCENE,...");
    command.option("--seeds", o->seeds, "Images of each estimator, seeds 0 to SEEDS - 1 (128; quick: 16)")
        .within(1, 1 << 20)
        .type("SEEDS");
    command.option("--size", o->size, "Pixels (200x150; quick: 80x60)").type("WxH");
    command.flag("-q,--quick", o->quick, "16 images of 80x60 of each");
    command.flag("--gray", o->gray, "Also each scene with one extinction for all channels");
    command.option("--shard", o->shard, "Compute every N-th part only, beginning with part I; no report").type("I/N");
    command.option("--merge", o->merge, "Take finished parts from these folders first").type("DIR...");
    command.option("--lanes", o->lanes, "Lanes of the device's vectors: changes no result").type("1|2|4|8|16");
    command.flag("--no-report", o->no_report, "CSV files and verdicts only");
    command.flag("--json", o->json, "Print one JSON object");
    command.footer(footer);
    command.on_call(run, [o] { return study_command(*o); });
}

}  // namespace tool
