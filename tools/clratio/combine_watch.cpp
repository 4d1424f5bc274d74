#include "combine_watch.hpp"

#include <algorithm>
#include <thread>

#include "combine_run.hpp"
#include "interrupt.hpp"
#include "progress_line.hpp"
#include "watch_folder.hpp"

namespace tool::combining {
namespace {

class Watch {
public:
    explicit Watch(const Options& options)
        : options_(options), run_(options),
          folder_(options.watch, Pattern("--m", options.m.front()), Pattern("--t", options.t.front()), options.settle) {}

    int until_done() {
        run_.saved_at_the_end([&] {
            if (run_.batches() > 0) refresh();
            while (!target_met() && !interrupt_.asked())
                if (!add_what_is_new()) std::this_thread::sleep_for(pause_);
        });
        line_.clear();
        if (!target_met()) throw Stopped(run_.how_to_go_on());
        return run_.report(seconds_);
    }

private:
    bool target_met() const {
        return (options_.until_batches && run_.batches() >= *options_.until_batches) ||
               (options_.until_error && run_.batches() > 0 && run_.rms_error() <= *options_.until_error);
    }

    std::uint64_t wanted() const {
        return options_.until_batches ? *options_.until_batches - run_.batches() : std::uint64_t{8};
    }

    bool add_what_is_new() {
        std::vector<Pair> pairs;
        for (Job& job : folder_.settled()) {
            const std::uint64_t index = options_.first_batch + job.index;
            if (run_.holds(index)) continue;
            auto pair = read(job, index);
            if (!pair || !fits(*pair, job)) continue;
            pairs.push_back(std::move(*pair));
            if (pairs.size() >= std::min<std::uint64_t>(wanted(), pairs_in_a_launch(pairs.front().m))) break;
        }
        if (pairs.empty()) return false;
        run_.add(pairs);
        refresh();
        return true;
    }

    // A file that stands still but does not open may be half of one whose renderer died, or waits.
    std::optional<Pair> read(const Job& job, std::uint64_t index) {
        const auto start = std::chrono::steady_clock::now();
        try {
            Pair pair{index, clratio::read_image(job.m, options_.layer), clratio::read_image(job.t, options_.layer)};
            seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
            return pair;
        } catch (const clratio::IoError& e) {
            put_off(job, e.what());
            return std::nullopt;
        }
    }

    // One of another size may be of another render. The first, which nothing has to be like yet, must fit tau.
    bool fits(const Pair& pair, const Job& job) {
        const bool is_first = !run_.is_begun();
        try {
            run_.fit(pair);
            return true;
        } catch (const clratio::InvalidArgument& e) {
            if (is_first) throw;
            put_off(job, e.what());
            return false;
        }
    }

    // Until it has changed.
    void put_off(const Job& job, const std::string& why) {
        folder_.put_off(job);
        line_.clear();
        fmt::print(stderr, "clratio: batch {} waits for other files: {}\n", job.index, why);
    }

    void refresh() {
        if (!options_.output.empty()) run_.read_out();
        line_.show(fmt::format("{} batches from {}", run_.batches(), options_.watch));
    }

    const Options& options_;
    const Interrupt interrupt_;
    CombineRun run_;
    WatchFolder folder_;
    ProgressLine line_;
    std::chrono::milliseconds pause_{100};
    double seconds_ = 0;
};

}  // namespace

int combine_watch(const Options& options) { return Watch(options).until_done(); }

}  // namespace tool::combining
