// clratio combine: batches of image pairs to one image.
#include <unistd.h>

#include <charconv>
#include <chrono>
#include <cmath>

#include "combine_report.hpp"
#include "image_reader.hpp"
#include "progress_line.hpp"
#include "tool.hpp"

namespace tool {
namespace {

using namespace combining;
using clratio::NonFinite;

constexpr std::size_t most_in_a_launch = 8;

/// Bytes of images read ahead, and again of those in one launch: a quarter of the machine's memory each.
std::size_t memory_budget() {
    const long pages = sysconf(_SC_PHYS_PAGES), bytes = sysconf(_SC_PAGESIZE);
    constexpr std::size_t least = std::size_t{1} << 28;
    return pages > 0 && bytes > 0 ? std::max(least, static_cast<std::size_t>(pages) / 4 * static_cast<std::size_t>(bytes))
                                  : least;
}

class Clock {
public:
    double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

private:
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

template <class Work> auto timed(double& seconds, Work work) {
    const Clock clock;
    struct Add {
        double& to;
        const Clock& from;
        ~Add() { to += from.seconds(); }
    } add{seconds, clock};
    return work();
}

// ---- tau

std::optional<float> number(const std::string& text) {
    float value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc::invalid_argument || end != text.data() + text.size()) return std::nullopt;
    if (error != std::errc() || !std::isfinite(value)) throw UsageError("--tau: expected a finite number, got " + text);
    return value;
}

/// Numbers, or an image: the mean of all --tau files.
struct TauInput {
    std::vector<float> numbers;
    clratio::Image image;

    operator clratio::Tau() const {
        if (numbers.size() == 1) return numbers.front();
        return numbers.empty() ? clratio::Tau(image) : clratio::Tau(numbers);
    }
};

std::vector<float> tau_numbers(const Options& options) {
    std::vector<float> numbers;
    for (const auto& text : options.tau)
        if (const auto value = number(text)) numbers.push_back(*value);
    if (!numbers.empty() && numbers.size() != options.tau.size())
        throw UsageError("--tau: either numbers or files, not both");
    return numbers;
}

clratio::Image read_like(const std::string& file, const Options& options, Report& report) {
    auto image = timed(report.seconds.decode, [&] { return clratio::read_image(file, options.layer); });
    clratio::require_same_shape(report.shape, image);
    return image;
}

clratio::Image mean_of_files(const Options& options, Report& report) {
    clratio::Image mean;
    std::vector<double> sum;
    for (const auto& file : options.tau) {
        mean = read_like(file, options, report);
        sum.resize(mean.size());
        for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += mean.values[i];
    }
    const auto files = static_cast<double>(options.tau.size());
    for (std::size_t i = 0; i < sum.size(); ++i) mean.values[i] = static_cast<float>(sum[i] / files);
    return mean;
}

// ---- batches

struct Pair {
    clratio::Image m, t;
};

std::vector<std::string> interleaved(const std::vector<std::string>& m, const std::vector<std::string>& t) {
    std::vector<std::string> all;
    for (std::size_t k = 0; k < m.size(); ++k) {
        all.push_back(m[k]);
        all.push_back(t[k]);
    }
    return all;
}

Pair next_pair(ImageReader& reader, const clratio::Image* shape) {
    Pair pair;
    pair.m = reader.next();
    pair.t = reader.next();
    if (shape) clratio::require_same_shape(*shape, pair.m);
    clratio::require_same_shape(pair.m, pair.t);
    return pair;
}

clratio::Image without_values(const clratio::Image& image) {
    clratio::Image shape = image;
    shape.values.clear();
    return shape;
}

void require_finite(const clratio::Image& image) {
    for (std::size_t i = 0; i < image.values.size(); ++i) {
        if (std::isfinite(image.values[i])) continue;
        const std::size_t channels = image.channels.size(), pixel = i / channels,
                          width = static_cast<std::size_t>(image.width());
        throw clratio::IoError(image.path, image.layer,
                               fmt::format("{} at column {}, row {}, channel {}, refused by --nonfinite fail",
                                           image.values[i], pixel % width, pixel / width, image.channels[i % channels]));
    }
}

/// The next pair, and those that are read already, as many as one launch takes; all of them where that is all there is.
std::vector<Pair> next_pairs(ImageReader& reader, const clratio::Image& shape, Pair&& waiting) {
    std::vector<Pair> pairs;
    pairs.push_back(std::move(waiting));
    const std::size_t bytes = 2 * sizeof(float) * pairs.front().m.values.size();
    const std::size_t most = std::clamp<std::size_t>(memory_budget() / bytes, 1, most_in_a_launch);
    const bool wait = 1 + reader.left() / 2 <= most;
    while (pairs.size() < most && reader.left() > 0 && (wait || reader.ready(2))) pairs.push_back(next_pair(reader, &shape));
    return pairs;
}

std::vector<clratio::HostBatch> batches_of(const std::vector<Pair>& pairs, const Options& options) {
    std::vector<clratio::HostBatch> batches;
    for (const Pair& pair : pairs) {
        if (options.moments().nonfinite == NonFinite::fail) {
            require_finite(pair.m);
            require_finite(pair.t);
        }
        batches.push_back({pair.m, pair.t});
    }
    return batches;
}

ReadOut combine_all(ImageReader& reader, const clratio::Engine& engine, const Options& options, const clratio::Tau& tau,
                    Pair&& first, Report& report) {
    Bands bands(engine, first.m.size(), report.shape.channels.size(), options.moments());
    auto pairs = next_pairs(reader, report.shape, std::move(first));
    report.batches = pairs.size();
    if (reader.left() == 0) {
        const auto batches = batches_of(pairs, options);
        return timed(report.seconds.device, [&] { return bands.at_once(batches, tau, options.wanted()); });
    }
    ProgressLine line;
    for (;;) {
        const auto batches = batches_of(pairs, options);
        timed(report.seconds.device, [&] { bands.add(batches); });
        if (reader.left() == 0) break;
        line.show(fmt::format("{} of {} batches", report.batches, options.m.size()));
        pairs = next_pairs(reader, report.shape, next_pair(reader, &report.shape));
        report.batches += pairs.size();
    }
    return timed(report.seconds.device, [&] { return bands.read_out(tau, options.wanted()); });
}

// ---- what comes out

clratio::WriteOptions settings(const Options& options, const Report& report) {
    std::string tau = options.tau.front();
    for (std::size_t i = 1; i < options.tau.size(); ++i) tau += " " + options.tau[i];
    return {{{"clratio/version", CLRATIO_VERSION},
             {"clratio/estimator", options.estimator},
             {"clratio/zero", options.zero},
             {"clratio/nonfinite", options.nonfinite},
             {"clratio/batches", std::to_string(report.batches)},
             {"clratio/tau", tau},
             {"clratio/device", report.device}}};
}

void write_all(const Options& options, const clratio::CombinedImage& out, const Report& report) {
    const auto with = settings(options, report);
    clratio::write_image(options.output, out.estimate, with);
    if (!options.standard_error.empty()) clratio::write_image(options.standard_error, out.standard_error, with);
    if (!options.flags.empty()) clratio::write_flags(options.flags, out.estimate, out.flag_image, with);
}

// ---- the run

void require_counts(const Options& options) {
    if (options.m.size() != options.t.size())
        throw UsageError(fmt::format("batch k of --m belongs to batch k of --t, but --m has {} files and --t has {}",
                                     options.m.size(), options.t.size()));
}

void require_different(const Options& options) {
    std::vector<std::string> files;
    for (const auto& file : {options.output, options.standard_error, options.flags}) {
        if (file.empty()) continue;
        if (std::find(files.begin(), files.end(), file) != files.end()) throw UsageError(file + ": named for two outputs");
        files.push_back(file);
    }
}

void require_error_bar(const Options& options) {
    if (!options.standard_error.empty() && options.estimator == "mean-of-ratios")
        throw UsageError("--stderr: mean-of-ratios has no standard error; ratio and mean have one");
}

// A folder that is not there is said before the work, not after it.
void require_folders(const Options& options) {
    for (const std::filesystem::path file : {options.output, options.standard_error, options.flags})
        if (!file.parent_path().empty() && !std::filesystem::is_directory(file.parent_path()))
            throw clratio::IoError(file.string(), "", "cannot be written: no folder " + file.parent_path().string());
}

int combine(const Options& options) {
    require_counts(options);
    require_different(options);
    require_error_bar(options);
    TauInput tau{tau_numbers(options), {}};
    require_folders(options);

    Report report;
    ImageReader reader(interleaved(options.m, options.t), options.layer, memory_budget(),
                       std::thread::hardware_concurrency());
    const clratio::Engine engine = timed(report.seconds.device, [] { return clratio::Engine{}; });
    report.device = engine.info().name;
    Pair first = next_pair(reader, nullptr);
    report.shape = without_values(first.m);
    if (tau.numbers.size() > 1 && tau.numbers.size() != report.shape.channels.size())
        throw UsageError(fmt::format("--tau: {} numbers for the {} channels of {}", tau.numbers.size(),
                                     report.shape.channels.size(), first.m.path));
    if (tau.numbers.empty()) tau.image = mean_of_files(options, report);

    const clratio::Image reference =
        options.reference.empty() ? clratio::Image{} : read_like(options.reference, options, report);

    auto read_out = combine_all(reader, engine, options, tau, std::move(first), report);
    report.seconds.decode += reader.seconds();
    const auto out = clratio::combined_image(std::move(read_out.chosen), report.shape);
    report.flags = out.flags;
    report.flagged = read_out.flagged;
    report.negatives = read_out.negatives;
    if (!options.reference.empty()) {
        const auto mean = clratio::combined_image(std::move(read_out.mean), report.shape);
        report.scores = {difference(out.estimate, reference), difference(mean.estimate, reference)};
    }
    timed(report.seconds.encode, [&] { write_all(options, out, report); });

    if (options.json)
        print(json_of(options, report));
    else
        print_text(options, report);
    return options.fail_on_flag && report.flagged > 0 ? flagged : ok;
}

constexpr auto footer =
    R"(The estimate of each value (a channel of a pixel) is tau * mean(m) / mean(t) over the batches. m is what is
rendered (shadowed light), t the same without what makes it hard (unshadowed light, the same samples), tau the exact t.

Estimators:
  ratio           tau mean(m) / mean(t); its bias goes with 1/batches (default)
  mean            mean(m), for comparison; tau and t are not used
  mean-of-ratios  mean of tau m / t of each batch, for comparison; keeps a bias that no number of batches removes

Where mean(t) is 0 although tau is not (--zero):
  mc-mean         the plain mean of m (default)
  zero            0
  one             tau, as if nothing were in shadow
Where tau is 0 the value is mean(m) / (mean(t) + 1).

A NaN or an infinity in a batch (--nonfinite):
  skip            that batch does not count for that value (default)
  propagate       the value becomes NaN
  fail            nothing is written; the file and pixel are named, exit code 1

Files: half, float or uint EXR; scanline, tiled or multi-part; all of one size, window and channels. FILE:LAYER names a
layer in one file, --layer one for all; with one colour layer in the file it is found without asking. Alpha is taken
from the first file of --m. The output is float, ZIP, with the windows and attributes of that file and the settings used.
--flags: a UINT for each value; 1 mean t is 0, 2 tau is 0, 4 batch skipped, 8 no data, 16 no error bar, 32 not finite.
--stderr: the standard error by the delta method; +inf with one batch. Without it a missing error bar is no flag that
--fail-on-flag looks at.

--json prints batches, pixels, channels, estimator, device, output, flags (how many values carry each; any: at least one),
negative_inputs, seconds (decode, summed over the reading threads; device; encode) and, with --reference, rmse, bias,
rmse_mean and bias_mean (of the plain mean), over the values that are finite in both files.

Exit codes: 0 done, 1 failed, 2 usage, 3 done but values were flagged and --fail-on-flag was given.

Examples:
  clratio combine --m m_*.exr --t t_*.exr --tau tau.exr -o out.exr
  clratio combine --m a_m.exr b_m.exr --t a_t.exr b_t.exr --tau 1 -o out.exr --layer ViewLayer.Combined
  clratio combine --m m_*.exr --t t_*.exr --tau t_ref.exr -o out.exr --reference m_ref.exr --stderr error.exr --json)";

}  // namespace

void add_combine(CLI::App& app, Run& run) {
    auto o = std::make_shared<Options>();
    auto* command =
        app.add_subcommand("combine", "Combine batches of image pairs (m, t) and the known mean tau of t to one image");
    const auto choice = [&](const char* name, std::string& value, const auto& map, const char* help) {
        std::vector<std::string> words;
        for (const auto& entry : map) words.push_back(entry.first);
        command->add_option(name, value, help)->type_name("WORD")->check(CLI::IsMember(words))->capture_default_str();
    };
    command->add_option("--m", o->m, "Batches of m, one file each")->required()->type_name("FILE");
    command->add_option("--t", o->t, "Batches of t, in the same order")->required()->type_name("FILE");
    command->add_option("--tau", o->tau, "The mean of t: a number, one for each channel, or files, which are averaged")
        ->required()
        ->type_name("FILE|NUMBER");
    command->add_option("-o,--output", o->output, "The combined image")->required()->type_name("OUT.exr");
    choice("--estimator", o->estimator, estimators, "How batches become an estimate");
    choice("--zero", o->zero, zeros, "What a zero denominator gives");
    choice("--nonfinite", o->nonfinite, nonfinites, "What a NaN or an infinity in a batch does");
    command->add_option("--stderr", o->standard_error, "Also write the standard error of each value")->type_name("FILE");
    command->add_option("--flags", o->flags, "Also write the flags of each value")->type_name("FILE");
    command->add_option("--layer", o->layer, "The layer to read where a file names none")->type_name("NAME");
    command->add_option("--reference", o->reference, "Print RMSE and bias of the plain mean and of the estimate against it")
        ->type_name("FILE");
    command->add_flag("--fail-on-flag", o->fail_on_flag, "Exit with code 3 if any value was flagged");
    command->add_flag("--json", o->json, "Print one JSON object instead of text");
    command->footer(footer);
    command->callback([=, &run] { run = [o] { return combine(*o); }; });
}

}  // namespace tool
