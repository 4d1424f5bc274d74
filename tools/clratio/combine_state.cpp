#include "combine_state.hpp"

namespace tool::combining {
namespace {

using Settings = std::vector<std::pair<std::string, std::string>>;

Settings settings_of(const Pair& pair) { return {{"layer.m", pair.m.layer}, {"layer.t", pair.t.layer}}; }

clratio::Image without_values(clratio::Image image) {
    image.values = {};
    return image;
}

std::string text_of(const Settings& settings) {
    std::string all;
    for (const auto& [name, value] : settings)
        all += (all.empty() ? "" : ", ") + name + " " + (value.empty() ? "(unnamed)" : value);
    return all.empty() ? "no layer.m and layer.t, which clratio combine records and a program can set" : all;
}

void require_fitting(const Options& options, const clratio::Snapshot& snapshot) {
    const auto [recorded, fixed] = sums_of(snapshot);
    const auto named = [](const auto& entry, auto value) { return entry.second == value; };
    const auto refuse = [&](const std::string& option, const std::string& how) {
        throw UsageError(option + " does not fit --state " + options.state + ", which was recorded " + how);
    };
    if (options.fixed && !fixed) refuse("--fixed", "without it");
    const auto require_bits = [&](const char* name, std::optional<std::uint32_t> asked, int kept) {
        if (asked && static_cast<int>(*asked) != kept)
            refuse(fmt::format("{} {}", name, *asked), fmt::format("with {} {}", name, kept));
    };
    if (fixed) {
        require_bits("--fixed", options.fixed, fixed->resolution);
        require_bits("--range", options.range, fixed->range);
    }
    const auto was = std::find_if(nonfinites.begin(), nonfinites.end(),
                                  [&](const auto& entry) { return named(entry, recorded.nonfinite); });
    if (options.nonfinite_given && nonfinites.at(options.nonfinite) != recorded.nonfinite)
        refuse("--nonfinite " + options.nonfinite, "with --nonfinite " + was->first);
    const auto needs = clratio::needs_of(options.chosen());
    const std::string without = "without what that needs; begin a state with this option";
    if (needs.ratios && !recorded.ratios) refuse("--estimator " + options.estimator, without);
    if (needs.groups && recorded.groups < 2) refuse("--estimator " + options.estimator, without + " or with --groups");
    if (options.groups && *options.groups != recorded.groups)
        refuse(fmt::format("--groups {}", *options.groups), fmt::format("with --groups {}", recorded.groups));
    if (options.weights_given && weightings.at(options.weights) != recorded.weights)
        refuse("--weights " + options.weights, "with the other kind");
}

}  // namespace

StateKeeper::StateKeeper(const Options& options) : options_(options) {
    if (options.state.empty()) return;
    if (!options.m.empty()) lock_.emplace(options.state);
    if (!options.m.empty() && !std::filesystem::exists(options.state)) return;
    state_ = clratio::read_state(options.state);
    require_fitting(options, state_.sums);
}

std::optional<clratio::Snapshot> StateKeeper::take_sums() {
    if (state_.ranges.empty()) return std::nullopt;
    return std::exchange(state_.sums, {});
}

void StateKeeper::fit(const Pair& pair) {
    const auto settings = settings_of(pair);
    if (state_.shape.channels.empty()) {
        state_.shape = without_values(pair.m);
        state_.settings = settings;
    }
    clratio::require_same_shape(state_.shape, pair.m);
    clratio::require_same_shape(pair.m, pair.t);
    if (!options_.state.empty() && settings != state_.settings)
        throw clratio::IoError(pair.m.path, pair.m.layer,
                               text_of(settings) + ", but " + options_.state + " holds " + text_of(state_.settings));
}

void StateKeeper::added(const Pair& pair) {
    if (!state_.ranges.empty() && pair.index < state_.ranges.ranges().front().begin) state_.shape = without_values(pair.m);
    state_.ranges.add({pair.index, pair.index + 1});
    changed_ = true;
}

bool StateKeeper::due() const {
    return !options_.state.empty() && changed_ &&
           std::chrono::steady_clock::now() - saved_ >= std::chrono::duration<double>(options_.checkpoint);
}

void StateKeeper::save(const Bands& bands) {
    if (options_.state.empty() || !changed_) return;
    state_.sums = bands.snapshot();
    clratio::write_state(options_.state, state_);
    state_.sums = {};
    changed_ = false;
    saved_ = std::chrono::steady_clock::now();
}

}  // namespace tool::combining
