// Errors of a scene's estimates: rendered, compared and counted in one pass.
#include <algorithm>
#include <cmath>

#include "draws.hpp"
#include "medium_state.hpp"
#include "scene.hpp"

namespace clratio {
namespace {

constexpr std::uint64_t samples_a_launch = std::uint64_t{1} << 27;

device::clr_tally device_tally(const Bins& bins, std::uint32_t levels, double unit) {
    if (bins.count < 1 || bins.count > 4096) throw InvalidArgument("bins", "1 to 4096 bins", std::to_string(bins.count));
    const auto lo = static_cast<float>(bins.lo), hi = static_cast<float>(bins.hi);
    const float inverse_width = static_cast<float>(bins.count) / (hi - lo);
    if (!(lo < hi) || !std::isfinite(hi - lo) || !std::isfinite(inverse_width))
        throw InvalidArgument("bins", "lo < hi, both and the bins' width in the range of float",
                              "[" + std::to_string(bins.lo) + ", " + std::to_string(bins.hi) + ")");
    return {{lo, hi, inverse_width, bins.count}, static_cast<float>(1 / unit), levels};
}

double unit_of(const Bins& bins) {
    const double end = std::max(std::abs(bins.lo), std::abs(bins.hi));
    if (!(end > 1e-20 && end < 1e20)) throw InvalidArgument("bins", "ends in the range of float", std::to_string(end));
    return std::exp2(std::ceil(std::log2(end)) - 22);
}

IndexRange checked_seeds(const IndexRange& seeds, Generator generator) {
    const std::uint64_t most = generator == Generator::philox ? ~std::uint64_t{0} : 0xffffffffu;
    if (seeds.count < 1 || seeds.count > 1u << 24 || seeds.first > most || seeds.count - 1 > most - seeds.first)
        throw InvalidArgument("seeds", "1 to 2^24 seeds of 64 bits, or of 32 with pcg4d3x",
                              std::to_string(seeds.count) + " from " + std::to_string(seeds.first));
    return seeds;
}

/// The images of a range of seeds, some of them at a time.
class ErrorCounter {
public:
    ErrorCounter(const MediumScene& scene, const Sampler& sampler, const Bins& bins, const MediumErrorOptions& options,
                 MediumErrors& out)
        : scene_(scene), sampler_(sampler), options_(options), out_(out), tally_(device_tally(bins, out.levels, out.unit)),
          values_(out.levels * CLR_LEVEL_VALUES), slots_(bins.count + CLR_ERROR_SLOTS), counted_(values_ * slots_) {}

    void run() {
        const std::uint64_t pixels = std::uint64_t{scene_.frame().width} * out_.rows.count;
        const std::uint64_t at_once = std::max<std::uint64_t>(1, samples_a_launch / (pixels << out_.levels));
        for (std::uint64_t done = 0; done < out_.seeds.count; done += at_once) {
            report(done);
            launch(done, std::min(at_once, out_.seeds.count - done));
        }
        report(out_.seeds.count);
        take_counts();
    }

private:
    void report(std::uint64_t seeds) const {
        if (options_.progress && !options_.progress(seeds * out_.rows.count, out_.seeds.count * out_.rows.count))
            throw Cancelled();
    }

    void launch(std::uint64_t first, std::uint64_t seeds) {
        const auto& s = scene_.state();
        const std::uint64_t tasks = seeds * out_.rows.count, size = s.engine.grouped() ? s.engine.work_items() : 1;
        const std::uint64_t wanted = s.engine.grouped() ? (tasks + size - 1) / size : s.engine.work_items();
        const std::uint64_t groups = std::min({tasks, wanted, std::max<std::uint64_t>(1, (1u << 22) / counted_.size())});
        std::vector<std::uint32_t> counts(groups * counted_.size());
        const Buffer counters = Buffer::zeroed(s.engine, counts.size() * sizeof(std::uint32_t));
        const Buffer sums(s.engine, tasks * values_ * sizeof(MediumErrorSums));
        wait(Launch(s.engine, "medium", "clr_medium_tally", options_of(sampler_, options_.generator))
                 .arg(counters)
                 .arg(sums)
                 .arg(s.device)
                 .arg(s.occluder_buffer)
                 .arg(s.share_buffer)
                 .arg(scene_stream({out_.seeds.first + first, options_.stream_id, options_.generator}))
                 .arg(device_sampler(sampler_, 1))
                 .arg(tally_)
                 .arg(cl_uint{out_.rows.first})
                 .arg(cl_uint{out_.rows.count})
                 .arg(cl_ulong{tasks})
                 .arg(cl_ulong{(tasks + groups - 1) / groups})
                 .run_groups(groups, size));
        counters.read(std::as_writable_bytes(std::span(counts)));
        for (std::size_t i = 0; i < counts.size(); ++i) counted_[i % counted_.size()] += counts[i];
        sums.read(std::as_writable_bytes(std::span(out_.sums).subspan(first * out_.rows.count * values_, tasks * values_)));
    }

    void take_counts() {
        out_.counts.resize(values_);
        for (std::size_t v = 0; v < values_; ++v) {
            const auto row = std::span(counted_).subspan(v * slots_, slots_);
            const std::size_t bins = tally_.bins.count;
            MediumErrorCounts& h = out_.counts[v];
            h.lo = out_.bins.lo;
            h.hi = out_.bins.hi;
            h.bins.assign(row.begin(), row.begin() + static_cast<std::ptrdiff_t>(bins));
            h.underflow = row[bins + CLR_UNDERFLOW];
            h.overflow = row[bins + CLR_OVERFLOW];
            h.nonfinite = row[bins + CLR_NONFINITE];
            h.atom = row[bins + CLR_ATOM_SLOT];
            h.zero_denominators = row[bins + CLR_ZERO_SLOT];
        }
    }

    const MediumScene& scene_;
    Sampler sampler_;
    const MediumErrorOptions& options_;
    MediumErrors& out_;
    device::clr_tally tally_;
    std::size_t values_, slots_;
    std::vector<std::uint64_t> counted_;
};

}  // namespace

std::uint64_t MediumErrorCounts::total() const { return Histogram::total() + atom; }

MediumErrorCounts& MediumErrorCounts::operator+=(const MediumErrorCounts& other) {
    Histogram::operator+=(other);
    atom += other.atom;
    zero_denominators += other.zero_denominators;
    return *this;
}

MediumErrors medium_errors(const MediumScene& scene, const Sampler& sampler, IndexRange seeds, Rows rows, Bins bins,
                           const MediumErrorOptions& options) {
    const auto& s = scene.state();
    check_sampler(sampler);
    check_levels(options.levels);
    MediumErrors out;
    out.levels = options.levels;
    out.rows = checked(rows, s.frame);
    out.unit = unit_of(bins);
    out.bins = bins;
    out.seeds = checked_seeds(seeds, options.generator);
    scene_stream({seeds.first, options.stream_id, options.generator});
    ErrorCounter counter(scene, sampler, bins, options, out);
    out.sums.resize(seeds.count * out.rows.count * out.levels * CLR_LEVEL_VALUES);
    out.pixels.assign(s.row_hits.begin() + out.rows.first, s.row_hits.begin() + out.rows.first + out.rows.count);
    counter.run();
    return out;
}

}  // namespace clratio
