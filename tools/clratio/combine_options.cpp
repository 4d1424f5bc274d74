#include "combine_options.hpp"

#include <algorithm>
#include <cmath>
#include <set>

#include "clratio/state.hpp"
#include "command.hpp"
#include "output_file.hpp"
#include "watch_folder.hpp"

namespace tool::combining {
namespace {

constexpr auto footer =
    R"(The estimate of each value (a channel of a pixel) is tau * mean(m) / mean(t) over the batches. m is what is
rendered (shadowed light), t the same without what makes it hard (unshadowed light, the same samples), tau the exact t.

Estimators (docs/estimators.md says which one when):
  ratio           tau mean(m) / mean(t); its bias goes with 1/batches (default)
  beale           the ratio with less bias; as the ratio, it stays in [0, tau] where 0 <= m <= t
  tin             much like beale, but can leave [0, tau]
  jackknife       the ratio with less bias, from --groups of batches; noisy with few
  mickey          unbiased, from --groups of batches
  hartley-ross    unbiased where all weights are equal, from the ratios of single batches; suffers where t is small
  regression      mean(m) - beta (mean(t) - tau); the least noise where there are many batches
  crossfit-regression  the same, unbiased, with the slopes of the other --groups
  mean            mean(m), for comparison; goes without --tau
  mean-of-ratios  mean of tau m / t of each batch, for comparison; keeps a bias that no number of batches removes
With too few batches or groups, the ratio (the regressions: the mean) stands in, flagged.

Where mean(t) is 0 although tau is not (--zero):
  mc-mean         the plain mean of m (default)
  zero            0
  one             tau, as if nothing were in shadow
Where tau is 0 the value is mean(m) / (mean(t) + 1).

A NaN or an infinity in a batch (--nonfinite):
  skip            that batch does not count for that value (default)
  propagate       the value becomes NaN
  fail            no output is written, and --state ends with the batch before; the file and pixel are named, exit code 1

Files: half, float or uint EXR; scanline, tiled or multi-part; all of one size, window and channels. FILE:LAYER names a
layer in one file, --layer one for all; with one colour layer in the file it is found without asking. Alpha is taken
from the first file of --m. The output is float, ZIP, with the windows and attributes of that file and the settings used.
--flags: a UINT for each value; 1 mean t is 0, 2 tau is 0, 4 batch skipped, 8 no data, 16 no error bar, 32 not finite,
64 too few batches or groups, or others that do not vary, 128 (with --interval or --needed) the batches agree exactly.
--stderr: the standard error by the delta method (jackknife: its own); +inf with one batch (a regression: two). Without it
a missing error bar is no flag that --fail-on-flag looks at. hartley-ross and mean-of-ratios: 1 where t of some batch is 0.

--interval LEVEL: a confidence interval of each value, --lower to --upper. --method fieller (default) belongs to the ratio
and need not be bounded; --kind, a UINT, says what the two numbers mean: 0 between them, 1 all but what lies between them,
2 everything. --method delta is the estimate -+ a multiple of its standard error, too narrow with few batches.
--gain: the variance of the ratio over that of the plain mean, as the batches predict it: below 1 the ratio pays.
--bias: of the ratio, as the batches predict it. --needed: how many more batches until the standard error is below --target
(in units of m) or --relative-target (of the estimate), or below the larger of both; 0 where it is, inf where nothing is
known; else a number that need not be whole. Where all batches agree it is 0 too, which is no proof: flag 128.

--weight: how many samples each batch is the mean of (or one number for all). --weights reliability takes them as trust
instead: then all batches have the same variance, and error bars come out accordingly.

--fixed Q keeps sums of whole numbers in units of 2^-Q: the state's bytes are the same for any order and grouping of the
batches on any number of machines. Values up to 2^16 (--range), whole weights, 2^(63-Q-R) - 1 of them in all, no overflow;
not for the estimators that need groups or ratios. Without it sums are two-float: any values and weights, and the same
bits for the same batches in the same order.

--state FILE keeps the sums, so that more batches can be added later or elsewhere: nothing is read twice, no batch counts
twice. A batch's index is --first-batch (0) plus its place in the list. With --resume the run goes on with FILE if it is
there, and skips listed batches that it holds: the same command again finishes what was stopped. FILE is replaced whole,
every --checkpoint seconds and at the end; Ctrl-C and SIGTERM save and exit with 130, a kill loses what came after the last
checkpoint, a full disk loses nothing. Without --output batches are added, no more; without --m the state is read out.
Machines of a farm keep a state each, with their own --first-batch, and clratio merge joins them.

--watch DIR adds what a renderer writes to DIR. --m and --t are patterns there, "m_*.exr" "t_*.exr" or "b_*.exr:shadow"
"b_*.exr:light" (quoted!), where * is a number, the batch's index: the same after every restart. A pair counts when both
files have stood still for --settle seconds and open completely. The outputs are written anew after each launch of batches.
It ends on --until-batches N (in the sums), on --until-error E (the root mean square of the standard error, over the values
that have one, in units of m), or on Ctrl-C.

--json prints batches, pixels, channels, estimator, device, output, flags (how many values carry each; any: at least one),
negative_inputs, seconds (decode, summed over the reading threads; device; encode), with --state also state (file, ranges,
held: batches it began with, added: batches since), with --interval interval (level, method, bounded, of them points,
exclusive, whole_line, coverage, coverage_with_width) and with --reference rmse, bias, rmse_mean and bias_mean (of the plain
mean), over the values that are finite in both files.

Exit codes: 0 done, 1 failed, 2 usage, 3 done but values were flagged and --fail-on-flag was given, 130 stopped.

Examples:
  clratio combine --m m_*.exr --t t_*.exr --tau tau.exr -o out.exr
  clratio combine --m a_m.exr b_m.exr --t a_t.exr b_t.exr --tau 1 -o out.exr --layer ViewLayer.Combined
  clratio combine --m m_0*.exr --t t_0*.exr --tau t_ref.exr -o out.exr --reference m_ref.exr --stderr error.exr --json
  clratio combine --m m_*.exr --t t_*.exr --tau tau.exr -o out.exr --state sums.exr --resume
  clratio combine --watch renders --m "m_*.exr" --t "t_*.exr" --tau tau.exr -o out.exr --state sums.exr --resume)";

/// Images beside the estimate: the option that asks for each, and its file.
std::vector<std::pair<const char*, std::string>> extras(const Options& o) {
    return {{"--stderr", o.standard_error},
            {"--flags", o.flags},
            {"--lower", o.lower},
            {"--upper", o.upper},
            {"--kind", o.kind},
            {"--bias", o.bias},
            {"--gain", o.gain},
            {"--needed", o.needed}};
}

std::vector<std::string> outputs(const Options& options) {
    std::vector<std::string> files{options.output, options.state};
    for (const auto& [name, file] : extras(options)) files.push_back(file);
    files.erase(std::remove(files.begin(), files.end(), ""), files.end());
    return files;
}

void require_counts(const Options& options) {
    if (options.m.size() != options.t.size())
        throw UsageError(fmt::format("batch k of --m belongs to batch k of --t, whatever the estimator, but --m has {} "
                                     "file{} and --t has {}",
                                     options.m.size(), options.m.size() == 1 ? "" : "s", options.t.size()));
}

bool is_missing(const std::string& file) {
    std::error_code error;
    return std::filesystem::status(file, error).type() == std::filesystem::file_type::not_found;
}

std::string without_layer(const std::string& spec) {
    const auto colon = spec.rfind(':');
    return colon == std::string::npos || !is_missing(spec) ? spec : spec.substr(0, colon);
}

std::vector<std::string> inputs(const Options& options) {
    std::vector<std::string> files{without_layer(options.reference)};
    for (const auto* list : {&options.m, &options.t, &options.tau})
        for (const auto& spec : *list)
            if (options.watch.empty() || list == &options.tau) files.push_back(without_layer(spec));
    return files;
}

std::set<std::filesystem::path> identities_of(const std::vector<std::string>& files) {
    std::set<std::filesystem::path> all;
    for (const auto& file : files) all.insert(identity_of(file));
    return all;
}

void require_different(const Options& options) {
    const auto read = identities_of(inputs(options));
    std::set<std::filesystem::path> written;
    for (const auto& file : outputs(options)) {
        const auto identity = identity_of(file);
        if (!written.insert(identity).second) throw UsageError(file + ": named for two outputs");
        if (read.contains(identity)) throw UsageError(file + ": an input, and an output");
    }
}

/// A glob takes more than the batches where their names do not tell them from the others.
void require_inputs_apart(const Options& options) {
    if (options.m.size() < 2) return;
    if (!options.reference.empty() && identities_of(options.m).contains(identity_of(options.reference)))
        throw UsageError(options.reference + ": a batch of --m, and the --reference");
    const auto batches = identities_of(options.t);
    for (const auto& file : options.tau)
        if (batches.contains(identity_of(file))) throw UsageError(file + ": a batch of --t, and the --tau");
}

void require_error_bar(const Options& options) {
    const bool by_delta = options.interval && options.method == "delta";
    for (const auto& [name, given] : {std::pair{"--stderr", !options.standard_error.empty()},
                                      {"--until-error", options.until_error.has_value()},
                                      {"--needed", !options.needed.empty()},
                                      {"--method delta", by_delta}})
        if (given && options.estimator == "mean-of-ratios")
            throw UsageError(std::string(name) + ": mean-of-ratios has no standard error; all others have one");
    const bool ends = !options.lower.empty() || !options.upper.empty() || !options.kind.empty();
    if (ends && !options.interval)
        throw UsageError("--lower, --upper and --kind need --interval LEVEL, as in --interval .95");
    if (options.interval && !(*options.interval > 0 && *options.interval < 1))
        throw UsageError(fmt::format("--interval: expected a level between 0 and 1, got {}", *options.interval));
    for (const auto& [name, target] :
         {std::pair{"--target", options.target}, {"--relative-target", options.relative_target}})
        if (!(target >= 0) || !std::isfinite(target))
            throw UsageError(fmt::format("{}: expected a number above 0, got {}", name, target));
    if (options.needed.empty() != (options.target <= 0 && options.relative_target <= 0))
        throw UsageError("--needed goes with --target or --relative-target, and they with --needed");
}

void require_groups(const Options& options) {
    if (options.groups && (*options.groups < 1 || *options.groups > clratio::most_groups))
        throw UsageError(fmt::format("--groups: expected 1 to {}, got {}", clratio::most_groups, *options.groups));
    if (clratio::needs_of(options.chosen()).groups && options.groups == 1)
        throw UsageError("--estimator " + options.estimator + " needs --groups of at least 2");
}

/// What a read-out alone does not look at.
void require_batches_to_add(const Options& options) {
    if (!options.m.empty()) return;
    for (const auto& [name, given] : {std::pair{"--weight", !options.weight.empty()},
                                      {"--first-batch", options.first_batch != 0},
                                      {"--t", !options.t.empty()}})
        if (given) throw UsageError(std::string(name) + " is of batches that are added: --m is missing");
}

void require_weights(const Options& options) {
    if (!options.watch.empty() && options.weight.size() > 1)
        throw UsageError("--weight: with --watch all batches have one weight");
    if (options.weight.size() > 1 && options.weight.size() != options.m.size())
        throw UsageError(fmt::format("--weight: expected one number, or one for each of the {} batches, got {}",
                                     options.m.size(), options.weight.size()));
    for (const double w : options.weight)
        if (!(w >= clratio::least_weight && w <= clratio::most_weight))
            throw UsageError(fmt::format("--weight: expected numbers from 2^-60 to 2^60, got {}", w));
}

void require_fixed(const Options& options) {
    if (!options.fixed) return;
    const auto needs = clratio::needs_of(options.chosen());
    for (const auto& [option, given] :
         {std::pair{"--groups " + fmt::format("{}", options.groups.value_or(1)), options.groups.value_or(1) > 1},
          {"--estimator " + options.estimator, needs.groups || needs.ratios},
          {"--weights reliability", options.weights == "reliability"},
          {"--nonfinite propagate", options.nonfinite == "propagate"}})
        if (given) throw UsageError(option + ": not with --fixed, which keeps the sums of single values alone");
    const auto sums = *options.sums().fixed;
    const int bits = sums.resolution + sums.range;
    if (bits < sums.least_bits || bits > sums.most_bits)
        throw UsageError(fmt::format("--fixed and --range: expected {} to {} bits together, got {}", sums.least_bits,
                                     sums.most_bits, bits));
    for (const double w : options.weight)
        if (w != std::floor(w) || w < 1)
            throw UsageError(fmt::format("--weight: with --fixed whole numbers from 1 on, got {}", w));
    double sum = 0;
    for (std::size_t k = 0; k < options.m.size(); ++k) sum += options.weight_of(options.first_batch + k);
    if (sum > static_cast<double>(sums.most_weight()))
        throw UsageError(fmt::format("--weight: the batches have {} samples, --fixed {} --range {} has room for {}; smaller "
                                     "ones have more",
                                     sum, sums.resolution, sums.range, sums.most_weight()));
}

void require_enough(const Options& options) {
    const bool state_alone = !options.state.empty() && options.resume;
    if (options.m.empty() && !state_alone)
        throw UsageError("--m is required (or --state FILE --resume, to read a state out)");
    if (options.output.empty() && options.state.empty()) throw UsageError("--output is required (or --state, to add only)");
    if (options.output.empty() && options.m.empty()) throw UsageError("--output is required where no batch is added");
    if (!options.output.empty() && options.tau.empty() && options.uses_tau())
        throw UsageError(options.chosen() == clratio::Estimator::mean
                             ? "--tau is required for --bias and for --method fieller, which are of the ratio"
                             : "--tau is required for an output (but for --estimator mean)");
    if (!options.output.empty()) return;
    std::vector<std::pair<const char*, bool>> needing{{"--reference", !options.reference.empty()},
                                                      {"--fail-on-flag", options.fail_on_flag},
                                                      {"--until-error", options.until_error.has_value()}};
    for (const auto& [name, file] : extras(options)) needing.emplace_back(name, !file.empty());
    for (const auto& [name, given] : needing)
        if (given) throw UsageError(std::string(name) + " needs --output: without it batches are added to --state, no more");
}

/// With --watch they are read when the first batch comes, which may be hours from now.
void require_side_files(const Options& options) {
    if (options.watch.empty()) return;
    std::vector<std::string> files;
    if (!options.reference.empty()) files.push_back(options.reference);
    for (const auto& word : options.tau)
        if (!tau_number(word)) files.push_back(word);
    for (const auto& spec : files)
        if (is_missing(without_layer(spec))) throw clratio::IoError(without_layer(spec), "", "no such file");
}

void require_state(const Options& options) {
    if (options.state.empty() && options.resume) throw UsageError("--resume needs --state, the file to go on with");
    if (!options.state.empty() && !options.resume && std::filesystem::exists(options.state))
        throw UsageError("--state " + options.state +
                         ": exists already; --resume goes on with it, another name starts anew");
}

void require_watch(const Options& options) {
    if (options.watch.empty()) return;
    if (options.m.size() != 1 || options.t.size() != 1)
        throw UsageError("--watch takes one pattern for --m and one for --t; quote them, or the shell expands the *");
    if (options.m == options.t) throw UsageError(options.m.front() + ": the pattern of --m, and of --t");
    const Pattern patterns[] = {{"--m", options.m.front()}, {"--t", options.t.front()}};
    const auto watched = identity_of(options.watch);
    for (const auto& file : outputs(options)) {
        const auto path = identity_of(file);
        for (const Pattern& pattern : patterns)
            if (path.parent_path() == watched && pattern.number(path.filename().string()))
                throw UsageError(file + ": an output that --watch would take for a batch; choose another name or folder");
    }
}

}  // namespace

clratio::CombineOptions Options::combine() const {
    clratio::CombineOptions o{.estimator = chosen(), .zero = zeros.at(zero)};
    o.standard_error = !standard_error.empty() || until_error;
    o.bias = !bias.empty();
    o.interval = interval.has_value();
    o.gain = !gain.empty();
    o.needed = !needed.empty();
    o.level = interval.value_or(o.level);
    o.method = methods.at(method);
    o.target = target;
    o.relative_target = relative_target;
    return o;
}

Wanted Options::wanted() const {
    // A missing error bar is no defect of a run that asked for none, and batches that agree are none at all.
    Wanted wanted{combine(), !reference.empty()};
    wanted.options.flag_image = !flags.empty();
    wanted.options.counted = ~(CLR_FLAG_NO_SPREAD | (standard_error.empty() ? CLR_FLAG_NO_ERROR_BAR : 0u));
    return wanted;
}

Sums Options::sums() const {
    const auto needs = clratio::needs_of(chosen());
    constexpr std::uint32_t usual_groups = 8;
    Sums sums{{.nonfinite = nonfinites.at(nonfinite),
               .ratios = needs.ratios,
               .groups = groups.value_or(needs.groups ? usual_groups : 1),
               .weights = weightings.at(weights)},
              {}};
    if (!fixed) return sums;
    sums.fixed.emplace().nonfinite = sums.moments.nonfinite;
    sums.fixed->resolution = static_cast<int>(*fixed);
    if (range) sums.fixed->range = static_cast<int>(*range);
    return sums;
}

double Options::weight_of(std::uint64_t index) const {
    if (weight.size() < 2) return weight.empty() ? 1 : weight.front();
    return weight.at(index - first_batch);
}

void add_options(Command& command, const std::shared_ptr<Options>& o) {
    const auto choice = [&](const char* name, std::string& value, const auto& map, const char* help) {
        std::vector<std::string> words;
        for (const auto& entry : map) words.push_back(entry.first);
        return command.option(name, value, help).type("WORD").one_of(words).shows_default();
    };
    command.option("--m", o->m, "Batches of m, one file each; with --watch a pattern").type("FILE");
    command.option("--t", o->t, "Batches of t, in the same order; with --watch a pattern").type("FILE");
    command.option("--tau", o->tau, "The mean of t: a number, one for each channel, or files, which are averaged")
        .type("FILE|NUMBER");
    command.option("-o,--output", o->output, "The combined image").type("OUT.exr");
    choice("--estimator", o->estimator, estimators, "How batches become an estimate");
    choice("--zero", o->zero, zeros, "What a zero denominator gives");
    choice("--nonfinite", o->nonfinite, nonfinites, "What a NaN or an infinity in a batch does").tells(o->nonfinite_given);
    command
        .option("--groups", o->groups,
                "1 to 16 groups of batches for the estimators that need some (8, or those of --state)")
        .type("K");
    command.option("--weight", o->weight, "Samples of each batch: one number, or one for each batch").type("W");
    choice("--weights", o->weights, weightings, "What a weight says").tells(o->weights_given);
    const auto fixed =
        command.option("--fixed", o->fixed, "Sums of whole numbers: values to the nearest multiple of 2^-Q, 24 is usual")
            .type("Q")
            .within(0, clratio::FixedOptions::most_bits);
    command.option("--range", o->range, "With --fixed: values up to 2^R (16); larger ones count as not finite")
        .type("R")
        .within(0, clratio::FixedOptions::most_bits)
        .needs(fixed);
    const auto interval = command.option("--interval", o->interval, "A confidence interval of this level").type("LEVEL");
    choice("--method", o->method, methods, "How the interval is made").needs(interval);
    const auto image = [&](const char* name, std::string& file, const char* help) {
        command.option(name, file, help).type("FILE");
    };
    image("--lower", o->lower, "Write the lower ends of the intervals");
    image("--upper", o->upper, "Write the upper ends");
    image("--kind", o->kind, "Write what the two ends mean: 0 between, 1 outside, 2 everything");
    image("--gain", o->gain, "Write the predicted variance of the ratio over that of the plain mean");
    image("--bias", o->bias, "Write the predicted bias of the ratio");
    image("--needed", o->needed, "Write how many batches are still needed for the target");
    command.option("--target", o->target, "Standard error to reach, in units of m").type("E").positive();
    command.option("--relative-target", o->relative_target, "The same, as a share of the estimate").type("R").positive();
    command.option("--stderr", o->standard_error, "Also write the standard error of each value").type("FILE");
    command.option("--flags", o->flags, "Also write the flags of each value").type("FILE");
    command.option("--layer", o->layer, "The layer to read where a file names none").type("NAME");
    command.option("--reference", o->reference, "Print RMSE and bias of the plain mean and of the estimate against it")
        .type("FILE");
    const auto state =
        command.option("--state", o->state, "Keep the sums in this file, which later runs and machines can go on with")
            .type("STATE.exr");
    command.flag("--resume", o->resume, "Go on with --state; listed batches that it holds are skipped");
    command.option("--first-batch", o->first_batch, "The index of the first listed batch")
        .type("N")
        .within(0, std::uint64_t{1} << 62)
        .shows_default();
    command.option("--checkpoint", o->checkpoint, "Save the state every so many seconds; 0: after each launch")
        .type("SECONDS")
        .seconds()
        .shows_default()
        .needs(state);
    const auto watch =
        command.option("--watch", o->watch, "Add the files of this folder that fit the patterns --m and --t as they appear")
            .type("DIR");
    command.option("--settle", o->settle, "A file counts when its size and time have stood still for so long")
        .type("SECONDS")
        .seconds()
        .shows_default()
        .needs(watch);
    command.option("--until-batches", o->until_batches, "End --watch when the sums hold so many batches")
        .type("N")
        .positive()
        .needs(watch);
    command.option("--until-error", o->until_error, "End --watch when the RMS of the standard error is at most this")
        .type("E")
        .positive()
        .needs(watch);
    command.flag("--fail-on-flag", o->fail_on_flag, "Exit with code 3 if any value was flagged");
    command.flag("--json", o->json, "Print one JSON object instead of text");
    command.footer(footer);
}

void check(const Options& options) {
    require_enough(options);
    require_batches_to_add(options);
    require_counts(options);
    require_different(options);
    require_inputs_apart(options);
    require_error_bar(options);
    require_groups(options);
    require_weights(options);
    require_fixed(options);
    require_state(options);
    require_watch(options);
    require_side_files(options);
    for (const auto& file : outputs(options))
        file == options.state ? require_place_for_state(file) : require_place_for(file);
}

void require_batches(const Options& options) {
    for (const auto* list : {&options.m, &options.t})
        for (const auto& spec : *list)
            if (is_missing(without_layer(spec))) throw clratio::IoError(without_layer(spec), "", "no such file");
}

}  // namespace tool::combining
