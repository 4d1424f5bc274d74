#include <algorithm>
#include <charconv>
#include <limits>

#include "clratio/state.hpp"

namespace clratio {
namespace {

using Range = BatchRanges::Range;

std::string text_of(const Range& r) { return "[" + std::to_string(r.begin) + "," + std::to_string(r.end) + ")"; }

bool apart(const Range& a, const Range& b) { return a.end <= b.begin || b.end <= a.begin; }

std::uint64_t below(std::uint64_t end, std::uint64_t group, std::uint64_t groups) {
    return end / groups + (end % groups > group ? 1 : 0);
}

/// The number at the front of `text`, which is taken off with the character that must follow.
std::uint64_t take(std::string_view& text, char after) {
    std::uint64_t n = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), n);
    if (error != std::errc() || end == text.data() + text.size() || *end != after)
        throw InvalidArgument("ranges", std::string("a number and ") + after, std::string(text));
    text.remove_prefix(static_cast<std::size_t>(end - text.data()) + 1);
    return n;
}

}  // namespace

void BatchRanges::add(Range range) {
    if (range.begin >= range.end) throw InvalidArgument("ranges", "at least one batch", text_of(range));
    for (const Range& r : ranges_)
        if (!apart(r, range))
            throw InvalidArgument("ranges", "batches that are not there yet", text_of(range) + " beside " + text_of(r));
    const auto later = [](const Range& a, const Range& b) { return a.begin < b.begin; };
    auto at = ranges_.insert(std::upper_bound(ranges_.begin(), ranges_.end(), range, later), range);
    const auto join_next = [&](auto r) {
        if (r + 1 == ranges_.end() || r[1].begin != r->end) return;
        r->end = r[1].end;
        ranges_.erase(r + 1);
    };
    join_next(at);
    if (at != ranges_.begin()) join_next(at - 1);
}

bool BatchRanges::contains(std::uint64_t index) const {
    return std::any_of(ranges_.begin(), ranges_.end(), [&](const Range& r) { return r.begin <= index && index < r.end; });
}

std::uint64_t BatchRanges::count() const { return count(0, 1); }

std::uint64_t BatchRanges::count(std::uint64_t group, std::uint64_t groups) const {
    if (groups == 0) throw InvalidArgument("groups", "at least 1", "0");
    std::uint64_t sum = 0;
    for (const Range& r : ranges_) sum += below(r.end, group, groups) - below(r.begin, group, groups);
    return sum;
}

std::optional<Range> BatchRanges::overlap(const BatchRanges& other) const {
    for (const Range& a : ranges_)
        for (const Range& b : other.ranges_)
            if (!apart(a, b)) return Range{std::max(a.begin, b.begin), std::min(a.end, b.end)};
    return std::nullopt;
}

std::optional<std::uint64_t> BatchRanges::first_beyond(const BatchRanges& other) const {
    for (const Range& r : ranges_) {
        std::uint64_t k = r.begin;
        for (const Range& o : other.ranges_)
            if (o.begin <= k && k < o.end) k = o.end;
        if (k < r.end) return k;
    }
    return std::nullopt;
}

std::string BatchRanges::text() const {
    std::string all;
    for (const Range& r : ranges_) all += (all.empty() ? "" : " ") + text_of(r);
    return all;
}

BatchRanges BatchRanges::parse(const std::string& text) {
    BatchRanges out;
    std::string_view left = text;
    while (!left.empty()) {
        if (left.front() != '[') throw InvalidArgument("ranges", "[begin,end)", std::string(left));
        left.remove_prefix(1);
        const std::uint64_t begin = take(left, ','), end = take(left, ')');
        out.add({begin, end});
        if (!left.empty() && left.front() == ' ') left.remove_prefix(1);
    }
    if (out.text() != text) throw InvalidArgument("ranges", out.text(), text);
    return out;
}

}  // namespace clratio
