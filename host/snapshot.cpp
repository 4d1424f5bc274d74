#include "clratio/snapshot.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <map>

#include "clratio/fixed.hpp"
#include "moments_state.hpp"
#include "settings.hpp"

namespace clratio {
namespace {

const std::map<std::string, NonFinite> nonfinites{
    {"skip", NonFinite::skip}, {"propagate", NonFinite::propagate}, {"fail", NonFinite::fail}};

const std::map<std::string, Weights> weights{{"samples", Weights::samples}, {"reliability", Weights::reliability}};

const std::map<std::string, bool> yes_or_no{{"0", false}, {"1", true}};

template <class Map, class Value> std::string name_in(const Map& map, const Value& value) {
    return std::find_if(map.begin(), map.end(), [&](const auto& entry) { return entry.second == value; })->first;
}

Settings settings_of(const MomentsOptions& o) {
    return {{"nonfinite", name_in(nonfinites, o.nonfinite)},
            {"ratios", name_in(yes_or_no, o.ratios)},
            {"groups", std::to_string(o.groups)},
            {"weights", name_in(weights, o.weights)}};
}

/// Settings taken one by one, until none is left.
class SettingsReader {
public:
    explicit SettingsReader(const Settings& settings) : left_(settings.begin(), settings.end()) {}
    template <class Map> auto take(const char* name, const Map& map) {
        const std::string value = take(name);
        const auto found = map.find(value);
        if (found == map.end()) throw unknown(name, value);
        return found->second;
    }
    std::uint32_t take_number(const char* name) {
        const std::string value = take(name);
        std::uint32_t number = 0;
        const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
        if (error != std::errc() || end != value.data() + value.size()) throw unknown(name, value);
        return number;
    }
    void require_none_left() const {
        if (!left_.empty()) throw unknown(left_.begin()->first, left_.begin()->second);
    }

private:
    std::string take(const char* name) {
        const auto found = left_.extract(name);
        if (!found) throw InvalidArgument("snapshot", std::string("the setting ") + name, "none");
        return found.mapped();
    }
    static InvalidArgument unknown(const std::string& name, const std::string& value) {
        return {"snapshot", "settings of this version", name + "=" + value};
    }
    std::map<std::string, std::string> left_;
};

// ---- planes: words of a snapshot, and where they lie on the device

struct Place {
    const char* name;
    cl_mem StatePlanes::*plane;
    std::size_t part;  ///< 0: hi, 1: lo
};

constexpr std::array places{
    Place{"m.hi", &StatePlanes::m, 0},
    Place{"m.lo", &StatePlanes::m, 1},
    Place{"t.hi", &StatePlanes::t, 0},
    Place{"t.lo", &StatePlanes::t, 1},
    Place{"mm.hi", &StatePlanes::mm, 0},
    Place{"mm.lo", &StatePlanes::mm, 1},
    Place{"tt.hi", &StatePlanes::tt, 0},
    Place{"tt.lo", &StatePlanes::tt, 1},
    Place{"mt.hi", &StatePlanes::mt, 0},
    Place{"mt.lo", &StatePlanes::mt, 1},
    Place{"weight.hi", &StatePlanes::weight, 0},
    Place{"weight.lo", &StatePlanes::weight, 1},
    Place{"batches", &StatePlanes::batches, 0},
    Place{"weight2.hi", &StatePlanes::weight2, 0},
    Place{"weight2.lo", &StatePlanes::weight2, 1},
    Place{"quotient.hi", &StatePlanes::quotient, 0},
    Place{"quotient.lo", &StatePlanes::quotient, 1},
    Place{"zero_m.hi", &StatePlanes::zero_m, 0},
    Place{"zero_m.lo", &StatePlanes::zero_m, 1},
    Place{"zero_share.hi", &StatePlanes::zero_share, 0},
    Place{"zero_share.lo", &StatePlanes::zero_share, 1},
};

bool recorded(const Place& place, const MomentsOptions& o) {
    const auto p = place.plane;
    if (p == &StatePlanes::weight || p == &StatePlanes::batches) return o.nonfinite == NonFinite::skip;
    if (p == &StatePlanes::weight2) return o.nonfinite == NonFinite::skip && o.weights == Weights::reliability;
    if (p == &StatePlanes::quotient || p == &StatePlanes::zero_m || p == &StatePlanes::zero_share) return o.ratios;
    return true;
}

std::vector<Place> places_of(const MomentsOptions& o) {
    std::vector<Place> some;
    std::copy_if(places.begin(), places.end(), std::back_inserter(some), [&](const Place& p) { return recorded(p, o); });
    return some;
}

std::string in_group(std::size_t group, const std::string& name) {
    return group == 0 ? name : "g" + std::to_string(group) + "." + name;
}

/// Calls each(group, name of the plane, its part of the device memory), group by group.
template <class Each> void for_planes(const Moments::State& s, Each each) {
    for (std::size_t g = 0; g < s.groups.size(); ++g)
        for (const Place& place : places_of(s.options)) {
            const std::size_t parts = place.plane == &StatePlanes::batches ? 1 : 2;
            each(g, in_group(g, place.name), PlanePart{s.planes.*place.plane, parts, g * parts + place.part});
        }
}

std::vector<std::string> plane_names(const Snapshot& snapshot) {
    std::vector<std::string> names;
    const auto some = places_of(moments_options(snapshot));
    for (std::size_t g = 0; g < snapshot.groups.size(); ++g)
        for (const Place& place : some) names.push_back(in_group(g, place.name));
    return names;
}

void check_size(const Snapshot& s, const Snapshot::Plane& plane) {
    if (plane.words.size() != s.values)
        throw InvalidArgument("snapshot plane " + plane.name, std::to_string(s.values) + " values",
                              std::to_string(plane.words.size()));
}

void check_planes(const Snapshot& s) {
    const auto names = plane_names(s);
    if (s.planes.size() != names.size())
        throw InvalidArgument("snapshot", std::to_string(names.size()) + " planes", std::to_string(s.planes.size()));
    for (std::size_t i = 0; i < names.size(); ++i) {
        if (s.planes[i].name != names[i]) throw InvalidArgument("snapshot", "plane " + names[i], s.planes[i].name);
        check_size(s, s.planes[i]);
    }
}

device::clr_two two_floats(double high, double low, std::uint64_t batches) {
    const device::clr_two w{static_cast<float>(high), static_cast<float>(low)};
    const bool exact = static_cast<double>(w.hi) == high && static_cast<double>(w.lo) == low;
    if (!exact || (batches == 0) != (high == 0) || !(high >= 0))
        throw InvalidArgument("snapshot", "a weight that is the sum of two floats, above 0 where there are batches",
                              std::to_string(high) + " + " + std::to_string(low));
    return w;
}

Moments::State::Group group_of(const Snapshot::Group& g) {
    check_room(0, g.batches);
    return {g.batches, two_floats(g.weight, g.weight_low, g.batches), two_floats(g.weight2, g.weight2_low, g.batches)};
}

void check_alike(const char* call, const Snapshot& a, const Snapshot& b) {
    if (a.kind != b.kind) throw InvalidArgument(call, "a state of kind " + a.kind, b.kind);
    if (a.groups.size() != b.groups.size())
        throw InvalidArgument(call, std::to_string(a.groups.size()) + " groups", std::to_string(b.groups.size()));
    if (a.settings != b.settings) throw InvalidArgument(call, "settings " + text_of(a.settings), text_of(b.settings));
}

}  // namespace

std::uint64_t Snapshot::batches() const {
    std::uint64_t sum = 0;
    for (const Group& g : groups) sum += g.batches;
    return sum;
}

MomentsOptions moments_options(const Snapshot& snapshot) {
    if (snapshot.kind != "moments") throw InvalidArgument("snapshot", "kind moments", snapshot.kind);
    SettingsReader settings(snapshot.settings);
    const MomentsOptions options{settings.take("nonfinite", nonfinites), settings.take("ratios", yes_or_no),
                                 settings.take_number("groups"), settings.take("weights", weights)};
    settings.require_none_left();
    return options;
}

Snapshot Moments::snapshot() const {
    const State& s = *state_;
    wait(s.last);
    Snapshot out{"moments", s.values, settings_of(s.options), {}, negatives(), skipped(), {}};
    for (const auto& g : s.groups) out.groups.push_back({g.batches, g.weight.hi, g.weight.lo, g.weight2.hi, g.weight2.lo});
    for_planes(s, [&](std::size_t group, const std::string& name, const PlanePart& part) {
        const bool empty = s.groups[group].batches == 0;  // then its planes hold anything
        out.planes.push_back({name, empty ? std::vector<std::uint32_t>(s.values) : s.read_plane(part)});
    });
    return out;
}

Moments::Moments(const Engine& engine, const Snapshot& snapshot)
    : Moments(engine, snapshot.values, moments_options(snapshot)) {
    State& s = *state_;
    if (snapshot.groups.size() != s.groups.size())
        throw InvalidArgument("snapshot", std::to_string(s.groups.size()) + " groups",
                              std::to_string(snapshot.groups.size()));
    check_planes(snapshot);
    check_room(0, snapshot.batches());
    std::transform(snapshot.groups.begin(), snapshot.groups.end(), s.groups.begin(), group_of);
    auto plane = snapshot.planes.begin();
    for_planes(s, [&](std::size_t, const std::string&, const PlanePart& part) { s.write_plane(part, (plane++)->words); });
    std::array<std::uint64_t, CLR_TALLY_ADD> tallies{};
    tallies[CLR_TALLY_NEGATIVE] = snapshot.negatives;
    tallies[CLR_TALLY_SKIPPED] = snapshot.skipped;
    s.add_rows.write(std::as_bytes(std::span(tallies)));
}

Snapshot slice(const Snapshot& snapshot, std::uint64_t begin, std::uint64_t count) {
    if (begin > snapshot.values || count > snapshot.values - begin)
        throw InvalidArgument("slice", "values of a snapshot that has " + std::to_string(snapshot.values),
                              std::to_string(begin) + " to " + std::to_string(begin + count));
    Snapshot out{snapshot.kind, count, snapshot.settings, snapshot.groups, 0, 0, {}};
    for (const auto& plane : snapshot.planes) {
        check_size(snapshot, plane);
        const auto first = plane.words.begin() + static_cast<std::ptrdiff_t>(begin);
        out.planes.push_back({plane.name, {first, first + static_cast<std::ptrdiff_t>(count)}});
    }
    return out;
}

void append(Snapshot& to, const Snapshot& more) {
    if (to.values == 0) {
        to = more;
        return;
    }
    check_alike("append", to, more);
    if (to.groups != more.groups) throw InvalidArgument("append", "the same batches", "others");
    if (to.planes.size() != more.planes.size()) throw InvalidArgument("append", "the same planes", "others");
    for (std::size_t i = 0; i < to.planes.size(); ++i)
        if (to.planes[i].name != more.planes[i].name)
            throw InvalidArgument("append", "plane " + to.planes[i].name, more.planes[i].name);
    for (std::size_t i = 0; i < to.planes.size(); ++i) {
        auto& words = to.planes[i].words;
        words.reserve(words.size() + more.planes[i].words.size());  // so that `more` may be `to`
        std::copy_n(more.planes[i].words.begin(), more.planes[i].words.size(), std::back_inserter(words));
    }
    to.values += more.values;
    to.negatives += more.negatives;
    to.skipped += more.skipped;
}

namespace {

/// Slice by slice, so that the device holds little.
template <class Kind> void merge_planes(const Engine& engine, Snapshot& into, const Snapshot& more) {
    constexpr std::uint64_t values_at_once = std::uint64_t{1} << 20;
    std::vector<Snapshot::Group> groups;
    for (std::uint64_t begin = 0; begin < into.values; begin += values_at_once) {
        const std::uint64_t count = std::min(values_at_once, into.values - begin);
        Kind sum(engine, slice(into, begin, count));
        sum.merge(Kind(engine, slice(more, begin, count)));
        const Snapshot part = sum.snapshot();
        for (std::size_t p = 0; p < part.planes.size(); ++p)
            std::copy(part.planes[p].words.begin(), part.planes[p].words.end(),
                      into.planes[p].words.begin() + static_cast<std::ptrdiff_t>(begin));
        groups = part.groups;
    }
    into.groups = groups;
}

}  // namespace

void merge(const Engine& engine, Snapshot& into, const Snapshot& more) {
    if (into.values != more.values)
        throw InvalidArgument("merge", std::to_string(into.values) + " values", std::to_string(more.values));
    check_alike("merge", into, more);
    if (into.values == 0) throw InvalidArgument("merge", "at least 1 value", "0");
    into.kind == "fixed" ? merge_planes<FixedMoments>(engine, into, more) : merge_planes<Moments>(engine, into, more);
    into.negatives += more.negatives;
    into.skipped += more.skipped;
}

}  // namespace clratio
