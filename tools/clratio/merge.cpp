// clratio merge: the states of many machines to one.
#include "clratio/state.hpp"
#include "command.hpp"
#include "file_lock.hpp"
#include "output_file.hpp"

namespace tool {
namespace {

struct Options {
    std::vector<std::string> states;
    std::string output;
    bool json = false;
};

/// A state that stands where the output goes must not lose batches by it.
void require_nothing_lost(const std::string& output, const clratio::BatchRanges& merged) {
    if (!std::filesystem::exists(output)) return;
    const clratio::BatchRanges there = clratio::inspect_state(output).ranges;
    if (const auto lost = there.first_beyond(merged))
        throw clratio::IoError(
            output, "", "would lose batch " + std::to_string(*lost) + ", which it holds and the merged states do not");
}

int merge(const Options& options) {
    require_place_for_state(options.output);
    const FileLock lock(options.output);
    const clratio::Engine engine;
    const std::vector<std::filesystem::path> paths(options.states.begin(), options.states.end());
    const clratio::StateFile merged = clratio::merge_states(engine, paths);
    require_nothing_lost(options.output, merged.ranges);
    clratio::write_state(options.output, merged);
    const auto& shape = merged.shape;
    if (options.json)
        print({{"output", options.output},
               {"states", options.states.size()},
               {"batches", merged.sums.batches()},
               {"ranges", merged.ranges.text()},
               {"width", shape.width()},
               {"height", shape.height()},
               {"channels", shape.channels}});
    else
        fmt::print("{}: {} batches {} of {} state{}, {}x{} pixels, {} channels\n", options.output, merged.sums.batches(),
                   merged.ranges.text(), options.states.size(), options.states.size() == 1 ? "" : "s", shape.width(),
                   shape.height(), shape.channels.size());
    return ok;
}

constexpr auto footer =
    R"(A state is what combine --state writes: the sums of some batches, and which ones. Merging gives the sums of all of them,
as if one machine had added them. The states are taken in the order of the first batch each holds, whatever order they are
named in: the bytes of the output do not depend on it.

Refused, with the reason and both names: states that hold the same batch, that differ in size, windows, channels, layers or
settings, and files that are damaged. The output appears whole or not at all; one that holds other batches is not replaced.

Exit codes: 0 done, 1 failed, 2 usage.

Examples:
  clratio combine --m m_0*.exr --t t_0*.exr --state node0.exr                    (on one machine)
  clratio combine --m m_1*.exr --t t_1*.exr --state node1.exr --first-batch 1000 (on another)
  clratio merge node0.exr node1.exr -o all.exr
  clratio combine --state all.exr --resume --tau tau.exr -o out.exr)";

}  // namespace

void add_merge(CLI::App& app, Run& run) {
    auto o = std::make_shared<Options>();
    Command command(app, "merge", "Merge states of combine --state, from many machines, to one");
    command.option("states", o->states, "The states").required().type("STATE.exr");
    command.option("-o,--output", o->output, "The merged state").required().type("OUT.exr");
    command.flag("--json", o->json, "Print one JSON object instead of text");
    command.footer(footer);
    command.on_call(run, [o] { return merge(*o); });
}

}  // namespace tool
