// clratio audit: the supplement's equations and sentences, each with a number computed now.
#include "audit.hpp"

#include <algorithm>
#include <chrono>
#include <iterator>

#include "command.hpp"
#include "progress_line.hpp"

namespace tool {

audit::Report audit::examine(const Work& work, const std::function<void(const char* part)>& tell) {
    Report report{work.engine.info().name, work.samples};
    const auto start = std::chrono::steady_clock::now();
    const auto examine_part = [&](const char* name, auto findings) {
        tell(name);
        std::ranges::move(findings(work), std::back_inserter(report.findings));
    };
    examine_part("equations (1) to (13)", estimator_findings);
    examine_part("equations (14) to (23)", law_findings);
    examine_part("the figures", figure_findings);
    report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return report;
}

namespace {

struct Options {
    std::uint64_t samples = 10'000'000;
    bool quick = false, json = false, markdown = false;
};

constexpr std::uint64_t quick_samples = 1'000'000;

int audit_command(const Options& options) {
    ProgressLine line;
    const audit::Report report = audit::examine({clratio::Engine{}, options.quick ? quick_samples : options.samples},
                                                [&](const char* part) { line.show(fmt::format("audit: {} ...", part)); });
    line.clear();
    fmt::print("{}", options.json       ? audit::json_of(report)
                     : options.markdown ? audit::markdown_of(report)
                                        : audit::text_of(report));
    return audit::all_hold(report) ? ok : failed;
}

}  // namespace

void add_audit(CLI::App& app, Run& run) {
    auto options = std::make_shared<Options>();
    Command command(app, "audit", "Check equations (1) to (23) of the supplement, with numbers computed now");
    const Option samples =
        command.option("--samples", options->samples, "Error samples for each number; pairs (m, t) are 10^7 at most")
            .shows_default()
            .within(quick_samples, 100'000'000);
    command.flag("-q,--quick", options->quick, "10^6 samples: a tenth of the work").excludes(samples);
    const Option json = command.flag("--json", options->json, "Print one JSON array, an object for each number");
    command.flag("--markdown", options->markdown, "Print the page docs/audit.md").excludes(json);
    command.footer(
        "The supplement is 'Ratio Estimator Properties' by Velinov and Mitchell. A sampled number has its standard\n"
        "error behind +- and must be within 5 of them of what is expected; a computed one has a bound, in brackets where "
        "it\n"
        "shows. Exit code 1: a number is not what it should be. The seeds are fixed.\n\n"
        "Example: clratio audit --quick");
    command.on_call(run, [options] { return audit_command(*options); });
}

}  // namespace tool
