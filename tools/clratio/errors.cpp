// clratio errors: error samples of a model, counted on the device, and whether they follow the laws.
#include <algorithm>
#include <cmath>

#include "command.hpp"
#include "error_options.hpp"

namespace tool {
namespace {

struct Options {
    clratio::ErrorModel model;
    std::vector<std::string> n{"1"};
    std::string count, first = "0", estimator = "ratio", csv, plot;
    std::vector<double> range{-1.5, 1.5};
    std::uint32_t bins = 1024;
    StreamOptions stream;
    bool json = false;
};

struct Plan {
    Estimator estimator;
    std::vector<clratio::ErrorModel> models;
    Sampling sampling;
};

Plan plan_of(const Options& o) {
    Plan plan{o.estimator == "mc" ? Estimator::mc : Estimator::ratio, {}, {}};
    for (const auto& n : o.n) {
        plan.models.push_back(o.model);
        plan.models.back().n = whole_number("--n", n);
        canonical_of(plan.estimator, plan.models.back());
    }
    plan.sampling = {o.stream.stream(),
                     {whole_number("--first", o.first), whole_number("--count", o.count)},
                     {o.range[0], o.range[1], o.bins}};
    return plan;
}

void require_outputs(const Options& o) {
    if (!o.csv.empty() && identity_of(o.csv) == identity_of(o.plot)) throw UsageError(o.csv + ": named for two outputs");
    require_place_for(o.csv);
    if (o.plot.empty()) return;
    require_picture_name(o.plot);
    require_place_for(o.plot);
    require_gnuplot(o.plot);
}

std::vector<ErrorCounts> count_all(const clratio::Engine& engine, const Plan& plan) {
    Sampling sampling = plan.sampling;
    if (plan.models.size() - 1 > 0xffffffffu - sampling.stream.id) throw UsageError("--stream: ids beyond 2^32 - 1");
    const auto one = [&](const clratio::ErrorModel& model, const clratio::Progress& progress) {
        return with_usage_errors([&] { return count_errors(engine, plan.estimator, model, sampling, progress); });
    };
    const clratio::IndexRange range = sampling.range;
    sampling.range.count = std::min<std::uint64_t>(range.count, 1);
    one(plan.models.front(), {});  // programs are built here, so that no model's time has it
    sampling.range = range;

    SampleProgress progress(static_cast<double>(range.count) * static_cast<double>(plan.models.size()));
    std::vector<ErrorCounts> all;
    for (const auto& model : plan.models) {
        all.push_back(one(model, progress.next(range.count)));
        ++sampling.stream.id;
    }
    return all;
}

// ---- what comes out

void write_all_csv(const std::string& file, const std::vector<ErrorCounts>& all) {
    OutputFile out(file);
    out.write(csv_header);
    for (const auto& counts : all) write_csv(out, counts);
    out.commit();
}

Drawing drawing_of(const Plan& plan, const std::vector<ErrorCounts>& all) {
    const auto& bins = plan.sampling.bins;
    const auto& m = plan.models.front();
    Panel panel{.title = fmt::format("μ {:.4g}, τ {:.4g}, σ_m {:.4g}, σ_t {:.4g}, ρ {:.4g}", m.mu, m.tau, m.sigma_m,
                                     m.sigma_t, m.rho),
                .most_density = 0,
                .least_error = bins.lo,
                .most_error = bins.hi,
                .curves = {}};
    for (std::size_t i = 0; i < all.size(); ++i) {
        const auto colour = scale_colour(i, all.size());
        const auto points = density_points(all[i], 256);
        for (const auto& p : points) panel.most_density = std::max(panel.most_density, 1.08 * p.density);
        panel.curves.push_back({"", Curve::Style::dashed, colour, density_curve(all[i].published(), bins.lo, bins.hi)});
        panel.curves.push_back({"", Curve::Style::thin, colour, density_curve(all[i].exact(), bins.lo, bins.hi)});
        panel.curves.push_back({fmt::format("N = {}", all[i].model.n), Curve::Style::dots, colour, points});
    }
    if (!(panel.most_density > 0)) panel.most_density = 1;
    panel.curves.push_back({"samples", Curve::Style::dots, "#606060", {}});
    panel.curves.push_back({"exact law", Curve::Style::thin, "#606060", {}});
    panel.curves.push_back({all[0].estimator == Estimator::mc ? "published eq. (23)" : "published eq. (22)",
                            Curve::Style::dashed,
                            "#606060",
                            {}});
    return {fmt::format("error of the {} estimator, {} samples", plan.estimator == Estimator::mc ? "Monte Carlo" : "ratio",
                        power_of_ten(plan.sampling.range.count)),
            {panel}};
}

Json optional_number(const std::optional<clratio::Fit>& fit, double clratio::Fit::*field) {
    return fit && std::isfinite((*fit).*field) ? Json((*fit).*field) : Json();
}

Json json_of(const ErrorCounts& c) {
    const auto exact = c.fit(c.exact()), published = c.fit(c.published());
    const auto samples = static_cast<double>(c.histogram.total());
    return {{"n", c.model.n},
            {"counts",
             {{"total", c.histogram.total()},
              {"underflow", c.histogram.underflow},
              {"overflow", c.histogram.overflow},
              {"nonfinite", c.histogram.nonfinite}}},
            {"chi2", optional_number(exact, &clratio::Fit::statistic)},
            {"dof", exact ? Json(exact->dof) : Json()},
            {"p_exact", optional_number(exact, &clratio::Fit::p)},
            {"chi2_published", optional_number(published, &clratio::Fit::statistic)},
            {"p_published", optional_number(published, &clratio::Fit::p)},
            {"seconds", c.seconds},
            {"samples_per_second", samples / c.seconds}};
}

void print_json(const Options& o, const Plan& plan, const std::vector<ErrorCounts>& all, const std::string& device) {
    const auto& s = plan.sampling;
    Json out{{"estimator", o.estimator},        {"mu", o.model.mu},           {"tau", o.model.tau},
             {"sigma_m", o.model.sigma_m},      {"sigma_t", o.model.sigma_t}, {"rho", o.model.rho},
             {"first", s.range.first},          {"count", s.range.count},     {"bins", s.bins.count},
             {"range", {s.bins.lo, s.bins.hi}}, {"rng", o.stream.rng},        {"seed", s.stream.seed},
             {"stream", s.stream.id},           {"device", device},           {"results", Json::array()}};
    for (const auto& counts : all) out["results"].push_back(json_of(counts));
    print(out);
}

std::string p_text(const std::optional<clratio::Fit>& fit) { return fit ? fmt::format("{:.3g}", fit->p) : "-"; }

void print_text(const Options& o, const Plan& plan, const std::vector<ErrorCounts>& all, const std::string& device) {
    const auto& s = plan.sampling;
    fmt::print("{} estimator, mu {}, tau {}, sigma_m {}, sigma_t {}, rho {}: samples {} to {} of {}, seed {}\n", o.estimator,
               o.model.mu, o.model.tau, o.model.sigma_m, o.model.sigma_t, o.model.rho, s.range.first,
               s.range.first + s.range.count - 1, o.stream.rng, s.stream.seed);
    fmt::print("{} bins on [{}, {}), on {}\n\n", s.bins.count, s.bins.lo, s.bins.hi, device);
    fmt::print("{:>8} {:>13} {:>13} {:>6} {:>11} {:>6} {:>9} {:>11} {:>9} {:>7}\n", "n", "underflow", "overflow", "NaN",
               "chi2", "dof", "p exact", "p published", "seconds", "M/s");
    for (const auto& c : all) {
        const auto exact = c.fit(c.exact());
        fmt::print("{:>8} {:>13} {:>13} {:>6} {:>11} {:>6} {:>9} {:>11} {:>9.3f} {:>7.0f}\n", c.model.n,
                   c.histogram.underflow, c.histogram.overflow, c.histogram.nonfinite,
                   exact ? fmt::format("{:.1f}", exact->statistic) : "-", exact ? std::to_string(exact->dof) : "-",
                   p_text(exact), p_text(c.fit(c.published())), c.seconds,
                   static_cast<double>(c.histogram.total()) / c.seconds / 1e6);
    }
}

int errors(const Options& options) {
    const Plan plan = with_usage_errors([&] { return plan_of(options); });
    require_outputs(options);
    const clratio::Engine engine;
    const auto all = count_all(engine, plan);
    if (!options.csv.empty()) write_all_csv(options.csv, all);
    if (!options.plot.empty()) draw(drawing_of(plan, all), options.plot);
    options.json ? print_json(options, plan, all, engine.info().name) : print_text(options, plan, all, engine.info().name);
    return ok;
}

constexpr auto footer =
    R"(The error of an estimate from n samples of (m, t), eq. (14): of the ratio tau mean(m) / mean(t), or of the plain mean
(--estimator mc). Draws --count of them for each n, from index --first on, and counts them in --bins half-open bins; nothing else
is kept, so memory does not grow with --count. Parts of a run (--first) add up, count for count.

p exact      chi-square of the counts, underflow and overflow included, against the exact law; neighbours are pooled to 25
p published  the same against the law that the supplement prints, eq. (22), or (23) for mc (which is exact)
A p below 1e-6 rejects a law, and so does one above 1 - 1e-6. "-" (null): too few samples. M/s: millions of samples a second.

--json prints the settings, device, and results: an array with one object for each n: n, counts (total, underflow, overflow,
nonfinite), chi2, dof, p_exact, chi2_published, p_published, seconds, samples_per_second.
--csv: a row for each cell, those of underflow (lo = -inf), overflow (hi = inf) and NaN (nan, nan) included: edges, count,
density = count / (all samples * width), and the averages of the exact and the published density over the bin.
--plot: dots are the samples, lines the exact law, dashes the published one.

Ctrl-C stops between launches of some tenths of a second: nothing is written, exit code 130.

Examples:
  clratio errors --mu .5 --tau 1 --sigma-m .5 --sigma-t .35 --n 1,4,16 --count 1e9
  clratio errors --mu .5 --tau 1 --sigma-m .5 --sigma-t .35 --count 1e8 --range -2 4 --csv errors.csv --plot errors.svg)";

}  // namespace

void add_errors(CLI::App& app, Run& run) {
    auto o = std::make_shared<Options>();
    Command command(app, "errors", "Sample an estimator's error, count it, and test it against the laws");
    command.option("--mu", o->model.mu, "Mean of m").required();
    command.option("--tau", o->model.tau, "Mean of t").required();
    command.option("--sigma-m", o->model.sigma_m, "Standard deviation of one sample of m").required();
    command.option("--sigma-t", o->model.sigma_t, "Standard deviation of one sample of t").required();
    command.option("--rho", o->model.rho, "Correlation of m and t").shows_default();
    command.option("--n", o->n, "Samples in an estimate: one number, or several with commas")
        .commas()
        .type("WHOLE")
        .shows_default();
    command.option("--count", o->count, "Errors to draw for each n, such as 1e9").required().type("WHOLE");
    command.option("--first", o->first, "Index of the first one").type("WHOLE").shows_default();
    command.option("--bins", o->bins, "Bins of equal width").shows_default();
    command.option("--range", o->range, "Ends of the bins, LO HI; write -0.5, not -.5").takes(2).shows_default();
    o->stream.add_to(command);
    command.option("--estimator", o->estimator, "ratio, or mc (the plain mean)")
        .one_of({"ratio", "mc"})
        .type("WORD")
        .shows_default();
    command.option("--csv", o->csv, "Write the histograms").type("FILE");
    command.option("--plot", o->plot, "Draw them and the laws with gnuplot").type("FILE.svg|png");
    command.flag("--json", o->json, "Print one JSON object instead of text");
    command.footer(footer);
    command.on_call(run, [o] { return errors(*o); });
}

}  // namespace tool
