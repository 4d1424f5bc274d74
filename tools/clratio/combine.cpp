// clratio combine: batches of image pairs to one image.
#include <algorithm>
#include <thread>

#include "combine_run.hpp"
#include "combine_watch.hpp"
#include "command.hpp"
#include "interrupt.hpp"
#include "progress_line.hpp"

namespace tool {
namespace {

using namespace combining;

std::vector<Job> jobs_of(const Options& options) {
    std::vector<Job> jobs;
    for (std::size_t k = 0; k < options.m.size(); ++k) jobs.push_back({options.first_batch + k, options.m[k], options.t[k]});
    return jobs;
}

std::vector<Job> missing_in(const CombineRun& run, std::vector<Job> jobs) {
    jobs.erase(std::remove_if(jobs.begin(), jobs.end(), [&](const Job& job) { return run.holds(job.index); }), jobs.end());
    return jobs;
}

int combine_without_state(const Options& options) {
    // Images are decoded while the device is opened, which takes as long and has a processor to itself.
    const unsigned processors = std::thread::hardware_concurrency();
    clratio::set_image_threads(std::max(2u, processors) - 1);
    PairReader reader(jobs_of(options), options.layer);
    CombineRun run(options);
    require_batches(options);
    clratio::set_image_threads(processors);
    auto pairs = reader.next();
    if (reader.done() && !run.needs_sums()) {
        run.read_out_at_once(pairs);
        return run.report(reader.seconds());
    }
    const Interrupt interrupt;
    ProgressLine line;
    for (;; pairs = reader.next()) {
        run.add(pairs);
        if (reader.done()) break;
        if (interrupt.asked()) throw Stopped(run.how_to_go_on());
        line.show(fmt::format("{} of {} batches", run.batches(), options.m.size()));
    }
    run.read_out();
    line.clear();
    return run.report(reader.seconds());
}

int combine_into_state(const Options& options) {
    const Interrupt interrupt;
    CombineRun run(options);
    PairReader reader(missing_in(run, jobs_of(options)), options.layer);
    ProgressLine line;
    run.saved_at_the_end([&] {
        while (!reader.done() && !interrupt.asked()) {
            run.add(reader.next());
            line.show(fmt::format("{} batches in {}", run.batches(), options.state));
        }
    });
    line.clear();
    if (interrupt.asked()) throw Stopped(run.how_to_go_on());
    if (!options.output.empty()) run.read_out();
    return run.report(reader.seconds());
}

int combine(const Options& options) {
    check(options);
    if (!options.watch.empty()) return combine_watch(options);
    return options.state.empty() ? combine_without_state(options) : combine_into_state(options);
}

}  // namespace

void add_combine(CLI::App& app, Run& run) {
    auto options = std::make_shared<Options>();
    Command command(app, "combine", "Combine batches of image pairs (m, t) and the known mean tau of t to one image");
    add_options(command, options);
    command.on_call(run, [options] { return combine(*options); });
}

}  // namespace tool
