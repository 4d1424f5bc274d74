#include "combine_run.hpp"

#include <chrono>
#include <cmath>
#include <limits>

namespace tool::combining {
namespace {

using clratio::NonFinite;

template <class Work> auto timed(double& seconds, Work work) {
    struct Add {
        double& to;
        std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
        ~Add() { to += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); }
    } add{seconds};
    return work();
}

template <class Words, class Value> std::string name_of(const Words& words, Value value) {
    return std::find_if(words.begin(), words.end(), [&](const auto& word) { return word.second == value; })->first;
}

clratio::WriteOptions settings(const Options& options, const Sums& sums, const Report& report) {
    clratio::WriteOptions all{{{"clratio/version", CLRATIO_VERSION},
                               {"clratio/estimator", options.estimator},
                               {"clratio/zero", options.zero},
                               {"clratio/nonfinite", report.nonfinite},
                               {"clratio/batches", std::to_string(report.batches)},
                               {"clratio/ranges", report.ranges},
                               {"clratio/device", report.device}}};
    const auto tell = [&](const char* name, const std::string& value) {
        all.attributes.emplace_back(std::string("clratio/") + name, value);
    };
    if (!options.tau.empty()) tell("tau", fmt::format("{}", fmt::join(options.tau, " ")));
    if (sums.moments.groups > 1) tell("groups", std::to_string(sums.moments.groups));
    if (sums.fixed) {
        tell("fixed", std::to_string(sums.fixed->resolution));
        tell("range", std::to_string(sums.fixed->range));
    }
    if (!options.weight.empty()) tell("weight", fmt::format("{}", fmt::join(options.weight, " ")));
    if (sums.moments.weights != clratio::Weights::samples) tell("weights", name_of(weightings, sums.moments.weights));
    if (options.interval) {
        tell("interval", fmt::format("{}", *options.interval));
        tell("method", options.method);
    }
    if (options.target > 0) tell("target", fmt::format("{}", options.target));
    if (options.relative_target > 0) tell("relative-target", fmt::format("{}", options.relative_target));
    if (!options.layer.empty()) tell("layer", options.layer);
    return all;
}

double root_mean_square(const std::vector<float>& errors) {
    double sum = 0;
    std::uint64_t finite = 0;
    for (const float e : errors) {
        if (!std::isfinite(e)) continue;
        sum += static_cast<double>(e) * e;
        ++finite;
    }
    return finite == 0 ? std::numeric_limits<double>::infinity() : std::sqrt(sum / static_cast<double>(finite));
}

/// The library refuses such a batch too, and those beside it, but knows neither its file nor the options.
void require_room(const clratio::Image& m, double weight, double sum, const clratio::FixedOptions& fixed) {
    if (sum <= static_cast<double>(fixed.most_weight())) return;
    throw clratio::IoError(
        m.path, m.layer,
        fmt::format("its --weight {} brings the sum to {}, and sums of --fixed {} --range {} have room for "
                    "{}; smaller ones have more",
                    weight, sum, fixed.resolution, fixed.range, fixed.most_weight()));
}

/// How many intervals are of each kind, and in how many the reference lies.
Intervals summary(const clratio::CombinedImage& out, const clratio::Image& reference) {
    Intervals sum;
    std::uint64_t covered = 0, covered_points = 0, compared = 0, compared_points = 0;
    for (std::size_t i = 0; i < out.kind.size(); ++i) {
        const float lower = out.lower.values[i], upper = out.upper.values[i];
        const bool point = lower == upper && out.kind[i] == CLR_KIND_BOUNDED;
        ++sum.kinds.at(out.kind[i]);
        sum.points += point;
        if (reference.values.empty() || !std::isfinite(reference.values[i])) continue;
        ++compared;
        compared_points += point;
        const float x = reference.values[i];
        const bool in = out.kind[i] == CLR_KIND_EXCLUSIVE ? x <= lower || x >= upper : x >= lower && x <= upper;
        covered += in;
        covered_points += in && point;
    }
    const auto share = [](std::uint64_t part, std::uint64_t all) {
        return all == 0 ? 0 : static_cast<double>(part) / static_cast<double>(all);
    };
    if (reference.values.empty()) return sum;
    sum.coverage = share(covered, compared);
    sum.coverage_with_width = share(covered - covered_points, compared - compared_points);
    return sum;
}

}  // namespace

CombineRun::CombineRun(const Options& options)
    : options_(options),
      tau_(options.tau.empty() ? std::vector<std::string>{"1"} : options.tau, options.layer, !options.output.empty()),
      reference_file_(options.reference.empty() ? std::vector<std::string>() : std::vector{options.reference},
                      options.layer),
      keeper_(options), engine_(timed(report_.seconds.device, [] { return clratio::Engine{}; })), sums_(options.sums()) {
    report_.device = engine_.info().name;
    report_.held = batches();
    if (const auto sums = keeper_.take_sums()) {
        sums_ = sums_of(*sums);
        bands_.emplace(engine_, *sums, keeper_.shape().channels.size());
    }
    report_.nonfinite = name_of(nonfinites, sums_.moments.nonfinite);
    if (bands_) fit_tau();
}

// What depends on the size of the images: said before the batches are added, not after.
void CombineRun::fit_tau() {
    if (!options_.output.empty()) tau_.fit(keeper_.shape());
    if (reference_file_.done()) return;
    reference_ = reference_file_.next_like(keeper_.shape());
    if (std::none_of(reference_.values.begin(), reference_.values.end(), [](float x) { return std::isfinite(x); }))
        throw clratio::IoError(reference_.path, reference_.layer, "has no finite value to compare with");
}

void CombineRun::fit(const Pair& pair) {
    const bool first = !is_begun();
    keeper_.fit(pair);
    if (first) fit_tau();
}

void CombineRun::require_fit(const Pair& pair) {
    fit(pair);
    if (sums_.moments.nonfinite != NonFinite::fail) return;
    require_finite(pair.m);
    require_finite(pair.t);
}

CombineRun::Accepted CombineRun::accept(const std::vector<Pair>& pairs) {
    Accepted accepted;
    double sum = bands_ ? static_cast<double>(bands_->whole_weight()) : 0;
    try {
        for (const Pair& pair : pairs) {
            const double weight = options_.weight_of(pair.index);
            require_fit(pair);
            if (sums_.fixed) require_room(pair.m, weight, sum += weight, *sums_.fixed);
            accepted.batches.push_back({pair.m, pair.t, weight, pair.index});
        }
    } catch (...) {
        accepted.misfit = std::current_exception();
    }
    return accepted;
}

void CombineRun::add(const std::vector<Pair>& pairs) {
    const Accepted accepted = accept(pairs);
    const auto& batches = accepted.batches;
    if (!batches.empty()) {
        if (!bands_) bands_.emplace(engine_, pairs.front().m.size(), keeper_.shape().channels.size(), sums_);
        whole_ = false;
        timed(report_.seconds.device, [&] { bands_->add(batches); });
        whole_ = true;
        for (std::size_t k = 0; k < batches.size(); ++k) keeper_.added(pairs[k]);
        if (keeper_.due()) save();
    }
    if (accepted.misfit) std::rethrow_exception(accepted.misfit);
}

void CombineRun::read_out_at_once(const std::vector<Pair>& pairs) {
    const Accepted accepted = accept(pairs);
    if (accepted.misfit) std::rethrow_exception(accepted.misfit);
    for (const Pair& pair : pairs) keeper_.added(pair);
    const clratio::BatchOptions how{sums_.moments.nonfinite, sums_.moments.weights};
    const clratio::Tau tau = tau_;  // a large image takes as long to find new memory as to be combined
    write(timed(report_.seconds.device,
                [&] { return read_at_once(engine_, accepted.batches, tau, options_.wanted(), how, tau_.give_away()); }));
}

void CombineRun::save() {
    if (bands_ && whole_) timed(report_.seconds.encode, [&] { keeper_.save(*bands_); });
}

std::string CombineRun::what_is_held() const {
    return fmt::format("{} holds batches {}; the same command with --resume goes on", options_.state,
                       keeper_.ranges().text());
}

std::string CombineRun::how_to_go_on() const {
    if (options_.state.empty()) return fmt::format("stopped after {} batch{}", batches(), batches() == 1 ? "" : "es");
    if (batches() == 0) return "stopped before the first batch; there is no state to go on with";
    return "stopped: " + what_is_held();
}

void CombineRun::read_out() {
    write(timed(report_.seconds.device, [&] { return bands_->read_out(tau_, options_.wanted()); }));
}

void CombineRun::write(ReadOut&& read_out) {
    report_.negatives = read_out.chosen.negatives;
    const auto out = clratio::combined_image(std::move(read_out.chosen), keeper_.shape());
    report_.batches = batches();
    report_.ranges = keeper_.ranges().text();
    report_.flags = out.flags;
    if (options_.interval) report_.intervals = summary(out, reference_);
    rms_error_ = root_mean_square(out.standard_error.values);
    if (!options_.reference.empty()) {
        const auto mean = clratio::combined_image(std::move(read_out.mean), keeper_.shape());
        report_.scores = {difference(out.estimate, reference_), difference(mean.estimate, reference_)};
    }
    timed(report_.seconds.encode, [&] {
        const auto with = settings(options_, sums_, report_);
        clratio::write_image(options_.output, out.estimate, with);
        const auto image = [&](const std::string& file, const clratio::Image& values) {
            if (!file.empty()) clratio::write_image(file, values, with);
        };
        image(options_.standard_error, out.standard_error);
        image(options_.lower, out.lower);
        image(options_.upper, out.upper);
        image(options_.bias, out.bias);
        image(options_.gain, out.gain);
        image(options_.needed, out.needed);
        if (!options_.flags.empty()) clratio::write_flags(options_.flags, out.estimate, out.flag_image, with);
        if (!options_.kind.empty()) clratio::write_flags(options_.kind, out.estimate, out.kind, with);
    });
}

int CombineRun::report(double decode) {
    report_.seconds.decode += decode + tau_.seconds() + reference_file_.seconds();
    report_.shape = keeper_.shape();
    report_.batches = batches();
    report_.ranges = keeper_.ranges().text();
    if (sums_.fixed && bands_) report_.outside = bands_->outside();
    if (options_.json)
        print(json_of(options_, report_));
    else
        print_text(options_, report_);
    return options_.fail_on_flag && report_.flags.any > 0 ? flagged : ok;
}

}  // namespace tool::combining
