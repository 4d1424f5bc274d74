#include <algorithm>

#include "clratio/state.hpp"
#include "exr_file.hpp"
#include "settings.hpp"

namespace clratio {
namespace {

using clratio::text_of;

std::string text_of(const std::string& text) { return text; }

std::string text_of(const std::vector<std::string>& names) {
    std::string all;
    for (const auto& name : names) all += (all.empty() ? "" : ",") + name;
    return all;
}

template <class T> std::string differs(const char* what, const T& a, const T& b) {
    return a == b ? "" : std::string(what) + ": " + text_of(a) + " and " + text_of(b);
}

/// The files in the order of the first batch each one holds.
std::vector<std::filesystem::path> in_order(std::span<const std::filesystem::path> paths) {
    struct Entry {
        StateFile state;
        std::filesystem::path path;
    };
    std::vector<Entry> all;
    for (const auto& path : paths) all.push_back({inspect_state(path), path});
    for (std::size_t b = 1; b < all.size(); ++b)
        for (std::size_t a = 0; a < b; ++a)
            if (const auto why = mismatch(all[a].state, all[b].state); !why.empty())
                throw IoError(all[b].path.string(), "", "cannot be merged with " + all[a].path.string() + ": " + why);
    std::sort(all.begin(), all.end(), [](const Entry& a, const Entry& b) {
        return a.state.ranges.ranges().front().begin < b.state.ranges.ranges().front().begin;
    });
    std::vector<std::filesystem::path> out;
    for (auto& entry : all) out.push_back(std::move(entry.path));
    return out;
}

}  // namespace

std::string mismatch(const StateFile& a, const StateFile& b) {
    for (const std::string& why :
         {differs("kind of sums", a.sums.kind, b.sums.kind), differs("channels", a.shape.channels, b.shape.channels),
          differs("data window", a.shape.data_window, b.shape.data_window),
          differs("display window", a.shape.display_window, b.shape.display_window),
          differs("settings of the sums", a.sums.settings, b.sums.settings), differs("settings", a.settings, b.settings)})
        if (!why.empty()) return why;
    if (a.sums.groups.size() != b.sums.groups.size()) return "another number of groups";
    if (const auto both = a.ranges.overlap(b.ranges)) {
        BatchRanges range;
        range.add(*both);
        return "both hold batches " + range.text();
    }
    return "";
}

StateFile merge_states(const Engine& engine, std::span<const std::filesystem::path> paths) {
    if (paths.empty()) throw InvalidArgument("merge", "at least one state", "none");
    StateFile out;
    for (const auto& path : in_order(paths)) {
        StateFile next = read_state(path);
        if (out.ranges.empty()) {
            out = std::move(next);
            continue;
        }
        if (const auto why = mismatch(out, next); !why.empty()) throw IoError(path.string(), "", "cannot be merged: " + why);
        merge(engine, out.sums, next.sums);
        for (const auto& range : next.ranges.ranges()) out.ranges.add(range);
    }
    return out;
}

}  // namespace clratio
