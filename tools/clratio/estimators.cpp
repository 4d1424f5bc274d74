// clratio estimators: bias, error and coverage of every estimator on models whose mean is known, by simulation.
#include <cmath>
#include <filesystem>

#include "clratio/combine.hpp"
#include "command.hpp"
#include "estimator_models.hpp"
#include "output_file.hpp"
#include "plot.hpp"
#include "progress_line.hpp"

namespace tool {
namespace {

using clratio::CombineOptions, clratio::Estimator, clratio::IntervalMethod, clratio::Moments;

struct Options {
    std::vector<std::string> models{"A", "B", "C"};
    std::uint64_t samples = 20'000'000, most = 1024, seed = 1;
    bool unequal = false, json = false;
    std::string folder;
};

/// A mean of independent numbers and its standard error.
struct Measured {
    double mean = 0, error = 0;
};

/// One estimator after N batches, relative to mu: N bias, sqrt(N) RMSE, share outside [0, tau].
struct Cell {
    std::uint64_t batches = 0;
    double weight = 0;  ///< of all of them
    Measured bias, rmse;
    double outside = 0;
};

struct Row {
    std::string name;
    Estimator estimator;
    std::uint32_t groups = 0;  ///< 0: any number serves
    std::uint32_t joined = 0;  ///< batches that the samples are joined to; 0: they stay as they come
    std::vector<Cell> cells = {};
};

struct Coverage {
    std::uint64_t batches = 0;
    Measured mean, delta, fieller;
    double unbounded = 0;
};

struct Result {
    PairModel model;
    std::vector<Row> rows;
    std::vector<Coverage> coverage;
};

constexpr std::uint64_t most_replicates = 1 << 18;
constexpr std::uint32_t few_groups = 2, many_groups = 8, few_batches = 8;

std::vector<Row> rows() {
    return {{"mean", Estimator::mean},
            {"ratio", Estimator::ratio},
            {"beale", Estimator::beale},
            {"tin", Estimator::tin},
            {"jackknife, 2 groups", Estimator::jackknife, few_groups},
            {"jackknife, 8 groups", Estimator::jackknife, many_groups},
            {"hartley-ross", Estimator::hartley_ross},
            {"mickey, 8 groups", Estimator::mickey, many_groups},
            {"regression", Estimator::regression},
            {"crossfit-regression, 8", Estimator::crossfit_regression, many_groups},
            {"mean-of-ratios, 8 batches", Estimator::mean_of_ratios, 0, few_batches},
            {"mean-of-ratios", Estimator::mean_of_ratios}};
}

/// Fewer batches than this leave an estimator without meaning, or without a mean.
std::uint64_t least_batches(const Row& row) {
    if (row.estimator == Estimator::regression) return 4;
    return std::max<std::uint64_t>({row.groups, row.joined, clratio::needs_of(row.estimator).batches});
}

std::uint32_t weight_of(std::uint64_t batch, bool unequal) { return unequal ? 1 + batch % 4 : 1; }

std::uint64_t weight_of_all(std::uint64_t batches, bool unequal) {
    std::uint64_t sum = 0;
    for (std::uint64_t k = 0; k < batches; ++k) sum += weight_of(k, unequal);
    return sum;
}

bool has_cell(const Row& row, std::uint64_t batches, std::uint64_t weight) {
    return batches >= least_batches(row) && (row.joined == 0 || weight % row.joined == 0);
}

/// Sums over replicates, merged over rounds.
struct Tally {
    double count = 0, first = 0, second = 0, fourth = 0, outside = 0;

    void add(const std::vector<float>& estimates, const PairModel& model) {
        for (const float x : estimates) {
            const double e = static_cast<double>(x) / model.mu - 1, square = e * e;
            first += e;
            second += square;
            fourth += square * square;
            outside += x < 0 || static_cast<double>(x) > model.tau * (1 + 0x1p-22);
        }
        count += static_cast<double>(estimates.size());
    }
    Cell cell(std::uint64_t batches, double weight) const {
        const double bias = first / count, square = second / count, root = std::sqrt(square);
        const double of_square = std::sqrt(std::max(0.0, fourth / count - square * square) / count);
        return {batches,
                weight,
                {bias * weight, weight * std::sqrt(std::max(0.0, square - bias * bias) / count)},
                {root * std::sqrt(weight), std::sqrt(weight) * of_square / (2 * root)},
                outside / count};
    }
};

struct CoverageTally {
    double count = 0, covered = 0, unbounded = 0;

    void add(const clratio::Combined& out, double mu) {
        for (std::size_t i = 0; i < out.kind.size(); ++i) {
            const auto lower = static_cast<double>(out.lower[i]), upper = static_cast<double>(out.upper[i]);
            const bool outside = out.kind[i] == CLR_KIND_EXCLUSIVE;
            covered += outside ? mu <= lower || mu >= upper : mu >= lower && mu <= upper;
            unbounded += out.kind[i] != CLR_KIND_BOUNDED;
        }
        count += static_cast<double>(out.kind.size());
    }
    Measured measured() const {
        const double p = covered / count;
        return {p, std::sqrt(p * (1 - p) / count)};
    }
};

/// All rows after N batches.
class Simulation {
public:
    Simulation(const clratio::Engine& engine, const PairModel& model, const Options& options)
        : engine_(engine), model_(model), options_(options) {}

    void run(std::uint64_t batches, Result& result) {
        const std::uint64_t replicates = std::max<std::uint64_t>(1, options_.samples / batches);
        std::vector<Tally> tallies(result.rows.size());
        CoverageTally mean, delta, fieller;
        const std::uint64_t weight = weight_of_all(batches, options_.unequal);
        for (std::uint64_t done = 0; done < replicates; done += most_replicates) {
            const std::uint64_t count = std::min(most_replicates, replicates - done);
            const std::uint64_t seed = options_.seed * 1'000'003 + round_++;
            const auto states = grouped(seed, batches, count);
            const Moments &few = states[0], &many = states[1];
            for (std::size_t r = 0; r < tallies.size(); ++r) {
                const Row& row = result.rows[r];
                if (!has_cell(row, batches, weight)) continue;
                const CombineOptions of_row{.estimator = row.estimator};
                const auto out = row.joined ? read(joined(seed, row.joined, weight, count), of_row)
                                            : read(row.groups == few_groups ? few : many, of_row);
                tallies[r].add(out.estimate, model_);
            }
            if (batches < 4) continue;
            mean.add(read(many, interval(Estimator::mean, IntervalMethod::delta)), model_.mu);
            delta.add(read(many, interval(Estimator::ratio, IntervalMethod::delta)), model_.mu);
            fieller.add(read(many, interval(Estimator::ratio, IntervalMethod::fieller)), model_.mu);
        }
        for (std::size_t r = 0; r < tallies.size(); ++r)
            if (tallies[r].count > 0) result.rows[r].cells.push_back(tallies[r].cell(batches, static_cast<double>(weight)));
        if (fieller.count > 0)
            result.coverage.push_back(
                {batches, mean.measured(), delta.measured(), fieller.measured(), fieller.unbounded / fieller.count});
    }

private:
    static CombineOptions interval(Estimator estimator, IntervalMethod method) {
        CombineOptions o{.estimator = estimator};
        o.interval = true;
        o.method = method;
        return o;
    }

    Moments empty(std::uint64_t count, std::uint32_t groups) const {
        return {engine_, count, {.nonfinite = clratio::NonFinite::propagate, .ratios = true, .groups = groups}};
    }

    /// Samples 0, 1, .. of a seed, so many to a batch.
    void fill(std::span<Moments> states, std::uint64_t seed, const std::vector<std::uint32_t>& weights) const {
        PairSampler sampler(engine_, model_, states[0].size(), seed);
        cl_event last = nullptr;
        for (const std::uint32_t weight : weights) {
            const clratio::Batch batch = sampler.next(weight);
            for (Moments& s : states) {
                if (last) clReleaseEvent(last);
                last = s.add(std::span(&batch, 1), {});
            }
        }
        clWaitForEvents(1, &last);
        clReleaseEvent(last);
    }

    /// States of few and of many groups.
    std::vector<Moments> grouped(std::uint64_t seed, std::uint64_t batches, std::uint64_t count) const {
        std::vector<Moments> states;
        for (const std::uint32_t groups : {few_groups, many_groups}) states.push_back(empty(count, groups));
        std::vector<std::uint32_t> weights;
        for (std::uint64_t k = 0; k < batches; ++k) weights.push_back(weight_of(k, options_.unequal));
        fill(states, seed, weights);
        return states;
    }

    /// The same samples in few batches of equal weight.
    Moments joined(std::uint64_t seed, std::uint32_t batches, std::uint64_t weight, std::uint64_t count) const {
        Moments sum = empty(count, 1);
        fill({&sum, 1}, seed, std::vector(batches, static_cast<std::uint32_t>(weight / batches)));
        return sum;
    }

    clratio::Combined read(const Moments& s, const CombineOptions& options) const {
        return combine(s, static_cast<float>(model_.tau), options);
    }

    const clratio::Engine& engine_;
    const PairModel& model_;
    const Options& options_;
    std::uint64_t round_ = 0;
};

// ---- what comes out

std::vector<std::uint64_t> columns(std::uint64_t most) {
    std::vector<std::uint64_t> all;
    for (std::uint64_t n = 1; n <= most; n *= 2) all.push_back(n);
    return all;
}

const Cell* cell_at(const Row& row, std::uint64_t batches) {
    for (const Cell& c : row.cells)
        if (c.batches == batches) return &c;
    return nullptr;
}

template <class Text> void print_rows(const Result& result, const std::vector<std::uint64_t>& at, Text text) {
    std::string head = "| |", line = "|---|";
    for (const auto n : at) {
        head += fmt::format(" {} |", n);
        line += "---|";
    }
    fmt::print("{}\n{}\n", head, line);
    for (const Row& row : result.rows) {
        std::string cells = fmt::format("| {} |", row.name);
        for (const auto n : at) cells += fmt::format(" {} |", cell_at(row, n) ? text(*cell_at(row, n)) : std::string("-"));
        fmt::print("{}\n", cells);
    }
}

void print_markdown(const Result& result, const Options& options) {
    const auto at = columns(options.most);
    fmt::print("\n## Model {}: {}\n\nE[m] = {:.6f}, tau = {:.6f}\n", result.model.name, result.model.text, result.model.mu,
               result.model.tau);
    const char* const weight = options.unequal ? "W" : "N";
    fmt::print("\n{} · bias / E[m] ± standard error, after N batches{}\n\n", weight,
               options.unequal ? " of weight W in all" : "");
    print_rows(result, at, [](const Cell& c) { return fmt::format("{:+.3f} ± {:.3f}", c.bias.mean, c.bias.error); });
    fmt::print("\n√{} · RMSE / E[m] ± standard error\n\n", weight);
    print_rows(result, at, [](const Cell& c) { return fmt::format("{:.3f} ± {:.3f}", c.rmse.mean, c.rmse.error); });
    fmt::print("\nShare of estimates outside [0, tau]\n\n");
    print_rows(result, at, [](const Cell& c) { return fmt::format("{:.4f}", c.outside); });
    if (result.coverage.empty()) return;
    fmt::print("\nCoverage of intervals of level .95\n\n| N | mean, delta | ratio, delta | ratio, Fieller | not bounded |\n"
               "|---|---|---|---|---|\n");
    const auto share = [](const Measured& m) { return fmt::format("{:.4f} ± {:.4f}", m.mean, m.error); };
    for (const Coverage& c : result.coverage)
        fmt::print("| {} | {} | {} | {} | {:.4f} |\n", c.batches, share(c.mean), share(c.delta), share(c.fieller),
                   c.unbounded);
}

Json json_of(const Measured& m) { return {{"mean", m.mean}, {"standard_error", m.error}}; }

Json json_of(const Result& result) {
    Json out{{"model", result.model.name}, {"mu", result.model.mu}, {"tau", result.model.tau}};
    for (const Row& row : result.rows) {
        Json cells = Json::array();
        for (const Cell& c : row.cells)
            cells.push_back({{"n", c.batches},
                             {"weight", c.weight},
                             {"bias_times_weight", json_of(c.bias)},
                             {"rmse_times_root_weight", json_of(c.rmse)},
                             {"outside", c.outside}});
        out["estimators"][row.name] = cells;
    }
    out["coverage"] = Json::array();
    for (const Coverage& c : result.coverage)
        out["coverage"].push_back({{"n", c.batches},
                                   {"mean", json_of(c.mean)},
                                   {"delta", json_of(c.delta)},
                                   {"fieller", json_of(c.fieller)},
                                   {"unbounded", c.unbounded}});
    return out;
}

Panel panel_of(const Result& result, const Options& options) {
    Panel panel{
        "Model " + result.model.name, std::log2(static_cast<double>(options.most)), 0, 0, {}, "N", "RMSE · √N / E[m]", true};
    const std::vector<std::pair<std::string, std::string>> shown{
        {"mean", "#7f7f7f"},         {"ratio", "#d1495b"},
        {"beale", "#e0952c"},        {"jackknife, 8 groups", "#66a182"},
        {"hartley-ross", "#2e4057"}, {"mickey, 8 groups", "#0088a0"},
        {"regression", "#8e5ea2"},   {"mean-of-ratios", "#202020"}};
    for (const auto& [name, colour] : shown)
        for (const Row& row : result.rows) {
            if (row.name != name) continue;
            const bool biased = row.estimator == Estimator::mean_of_ratios;
            Curve curve{name, biased ? Curve::Style::dashed : Curve::Style::line, colour, {}};
            for (const Cell& c : row.cells) {
                curve.points.push_back({std::log2(static_cast<double>(c.batches)), c.rmse.mean});
                if (!biased) panel.most_error = std::max(panel.most_error, c.rmse.mean);
            }
            panel.curves.push_back(curve);
        }
    panel.most_error *= 1.6;  // room for the key
    return panel;
}

std::vector<Result> simulate(const Options& options) {
    const clratio::Engine engine;
    ProgressLine line;
    std::vector<Result> results;
    for (const auto& name : options.models) {
        const auto models = pair_models();
        const auto model = std::find_if(models.begin(), models.end(), [&](const PairModel& m) { return m.name == name; });
        results.push_back({*model, rows(), {}});
        Simulation simulation(engine, *model, options);
        for (const auto n : columns(options.most)) {
            line.show(fmt::format("model {}: {} batches", name, n));
            simulation.run(n, results.back());
        }
    }
    line.clear();
    return results;
}

int estimators(const Options& options) {
    const std::filesystem::path folder = options.folder;
    if (!options.folder.empty()) {
        std::error_code error;
        std::filesystem::create_directories(folder, error);
        if (error) throw clratio::IoError(options.folder, "", "cannot be made a folder: " + error.message());
        require_gnuplot(options.folder);
    }
    const auto results = simulate(options);
    if (options.json) {
        Json all = Json::array();
        for (const Result& r : results) all.push_back(json_of(r));
        print(all);
    } else {
        for (const Result& r : results) print_markdown(r, options);
    }
    if (options.folder.empty()) return ok;
    Drawing drawing{"Estimators of E[m] after N samples", {}};
    for (const Result& r : results) drawing.panels.push_back(panel_of(r, options));
    for (const char* name : {"estimators.svg", "estimators.png"}) draw(drawing, (folder / name).string());
    return ok;
}

}  // namespace

void add_estimators(CLI::App& app, Run& run) {
    auto o = std::make_shared<Options>();
    Command command(app, "estimators", "Simulate every estimator: bias, error and coverage on models of known mean");
    std::vector<std::string> names;
    for (const auto& m : pair_models()) names.push_back(m.name);
    command.option("--models", o->models, "Which models, with commas or blanks between").commas().type("NAME").one_of(names);
    command.option("--samples", o->samples, "Samples for each column of a table")
        .type("WHOLE")
        .within(1024, std::uint64_t{1} << 40)
        .shows_default();
    command.option("--most", o->most, "The largest N; N = 1, 2, 4, ..")
        .type("N")
        .within(1, std::uint64_t{1} << 20)
        .shows_default();
    command.option("--seed", o->seed, "Of the streams").type("N").shows_default();
    command.flag("--unequal", o->unequal, "Batches of 1, 2, 3, 4, 1, .. samples; tables then go by total weight");
    command.flag("--json", o->json, "Print one JSON array instead of tables");
    command.option("-o,--output", o->folder, "Also draw estimators.svg and .png here").type("DIR");
    std::string footer = "Tables in Markdown, each number with its standard error.\n\nModels:\n";
    for (const auto& m : pair_models()) footer += fmt::format("  {:<3} {}\n", m.name, m.text);
    command.footer(footer +
                   "\nExamples:\n  clratio estimators --models A --samples 1000000\n  clratio estimators -o pictures");
    command.on_call(run, [o] { return estimators(*o); });
}

}  // namespace tool
