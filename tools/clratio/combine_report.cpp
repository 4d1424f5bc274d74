#include "combine_report.hpp"

namespace tool::combining {

Json json_of(const Options& options, const Report& r) {
    const auto channels = r.shape.channels.size();
    Json out{{"batches", r.batches},
             {"pixels", static_cast<std::uint64_t>(r.shape.width()) * static_cast<std::uint64_t>(r.shape.height())},
             {"channels", channels},
             {"estimator", options.estimator},
             {"device", r.device},
             {"output", options.output},
             {"flags",
              {{"zero_denominator", r.flags.zero_denominator},
               {"zero_tau", r.flags.zero_tau},
               {"skipped", r.flags.skipped},
               {"no_data", r.flags.no_data},
               {"no_error_bar", r.flags.no_error_bar},
               {"nonfinite", r.flags.nonfinite},
               {"fell_back", r.flags.fell_back},
               {"no_spread", r.flags.no_spread},
               {"any", r.flags.any}}},
             {"negative_inputs", r.negatives},
             {"seconds", {{"decode", r.seconds.decode}, {"device", r.seconds.device}, {"encode", r.seconds.encode}}}};
    if (options.output.empty()) out["flags"] = out["negative_inputs"] = nullptr;
    if (r.outside) out["outside_range"] = *r.outside;
    if (!options.state.empty())
        out["state"] = {{"file", options.state}, {"ranges", r.ranges}, {"held", r.held}, {"added", r.batches - r.held}};
    if (r.intervals) {
        const auto& [bounded, exclusive, whole] = r.intervals->kinds;
        out["interval"] = {{"level", *options.interval}, {"method", options.method}, {"bounded", bounded},
                           {"exclusive", exclusive},     {"whole_line", whole},      {"points", r.intervals->points}};
        if (r.intervals->coverage) {
            out["interval"]["coverage"] = *r.intervals->coverage;
            out["interval"]["coverage_with_width"] = *r.intervals->coverage_with_width;
        }
    }
    if (r.scores) {
        out["rmse"] = r.scores->estimate.rmse;
        out["bias"] = r.scores->estimate.bias;
        out["rmse_mean"] = r.scores->mean.rmse;
        out["bias_mean"] = r.scores->mean.bias;
        out["compared"] = r.scores->estimate.compared;
    }
    return out;
}

namespace {

void print_flags(const Options& options, const Report& r) {
    fmt::print("{} of {} values flagged\n", r.flags.any,
               static_cast<std::uint64_t>(r.shape.width()) * static_cast<std::uint64_t>(r.shape.height()) *
                   r.shape.channels.size());
    const auto line = [](std::uint64_t count, const char* what) {
        if (count != 0) fmt::print("  {:>10}  {}\n", count, what);
    };
    line(r.flags.zero_denominator, clratio::needs_of(options.chosen()).ratios
                                       ? "t of some batch is 0"
                                       : "mean t is 0: the zero policy gave the value");
    line(r.flags.zero_tau, "tau is 0: the value is mean(m) / (mean(t) + 1)");
    line(r.flags.skipped, r.outside.value_or(0) > 0 ? "a batch was not finite, or outside the range of --fixed, and left out"
                                                    : "a batch was not finite and left out");
    line(r.flags.no_data, "no finite batch: the value is 0");
    line(options.standard_error.empty() ? 0 : r.flags.no_error_bar,
         "no error bar: fewer than two batches (a regression: three), or a constant by the zero policy");
    line(r.flags.nonfinite, "the estimate is not finite");
    line(r.flags.fell_back, "too few batches or groups, or others that do not vary: the ratio or the mean stands in");
    line(options.needed.empty() ? 0 : r.flags.no_spread,
         "all batches agree: none is needed, which says nothing of the next");
    line(r.negatives, "negative inputs (counted only)");
}

}  // namespace

void print_text(const Options& options, const Report& r) {
    if (!options.state.empty())
        fmt::print("{}: batches {}, {} of them added now\n", options.state, r.ranges, r.batches - r.held);
    if (options.output.empty()) return;
    fmt::print("{}: {} of {} batch{}, {}x{} pixels, {} channels, on {}\n", options.output, options.estimator, r.batches,
               r.batches == 1 ? "" : "es", r.shape.width(), r.shape.height(), r.shape.channels.size(), r.device);
    print_flags(options, r);
    if (r.intervals) {
        const auto& [bounded, exclusive, whole] = r.intervals->kinds;
        const bool of_ratio = options.method == "fieller" && options.estimator != "ratio";
        fmt::print(
            "{} intervals{} of level {}: {} bounded ({} of them points: all batches agree), {} exclusive, {} the whole "
            "line\n",
            options.method, of_ratio ? " of the ratio" : "", *options.interval, bounded, r.intervals->points, exclusive,
            whole);
        if (r.intervals->coverage)
            fmt::print("  {:.2f} % of the reference lies in them, {:.2f} % in those that are no points\n",
                       100 * *r.intervals->coverage, 100 * *r.intervals->coverage_with_width);
    }
    if (r.scores) {
        fmt::print("against {}\n  {:<15} {:>10} {:>12}\n", options.reference, "", "RMSE", "bias");
        for (const auto& [name, score] :
             {std::pair<std::string, Difference>{"plain mean", r.scores->mean}, {options.estimator, r.scores->estimate}}) {
            const std::uint64_t left_out = score.values - score.compared;
            fmt::print("  {:<15} {:>10.6f} {:>12.6f}{}\n", name, score.rmse, score.bias,
                       left_out ? fmt::format("   {} values not finite and left out", left_out) : "");
        }
    }
    fmt::print("decode {:.3f} s, device {:.3f} s, encode {:.3f} s\n", r.seconds.decode, r.seconds.device, r.seconds.encode);
}

}  // namespace tool::combining
