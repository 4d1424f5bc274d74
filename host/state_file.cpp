#include <ImfChannelList.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>
#include <ImfStringVectorAttribute.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <set>

#include "checksum.hpp"
#include "clratio/state.hpp"
#include "exr_file.hpp"
#include "exr_stream.hpp"
#include "output_target.hpp"

namespace clratio {
namespace {

namespace fs = std::filesystem;

using Names = std::vector<std::string>;
using Words = std::span<const std::uint32_t>;

constexpr auto version = "1";
constexpr std::string_view own = "clratio/";  // how the attributes of a state begin
constexpr auto checksum_name = "clratio/checksum";

std::size_t pixels_of(const Image& shape) {
    return static_cast<std::size_t>(shape.width()) * static_cast<std::size_t>(shape.height());
}

Imf::PixelType type_of(const std::string& plane) {
    return plane.ends_with(".hi") || plane.ends_with(".lo") ? Imf::FLOAT : Imf::UINT;
}

/// What a plane's channels are called in the file: a layer, so that viewers show it as an image.
Names channels_of(const std::string& plane, const Image& shape) {
    Names names;
    for (const auto& channel : shape.channels) names.push_back(plane + "." + channel);
    return names;
}

// ---- what must fit together, in a state to be written and in one that was read

void check_ranges(const StateFile& state) {
    const auto& groups = state.sums.groups;
    if (groups.empty()) throw InvalidArgument("state", "at least one group", "none");
    if (state.ranges.empty()) throw InvalidArgument("ranges", "at least one batch", "none");
    for (std::size_t g = 0; g < groups.size(); ++g) {
        const std::uint64_t count = state.ranges.count(g, groups.size());
        if (count != groups[g].batches)
            throw InvalidArgument("ranges", std::to_string(groups[g].batches) + " batches in group " + std::to_string(g),
                                  std::to_string(count) + " in " + state.ranges.text());
    }
}

void check_whole(const StateFile& state) {
    require_channels(state.shape);
    const std::uint64_t values = pixels_of(state.shape) * state.shape.channels.size();
    if (state.sums.values != values)
        throw InvalidArgument("state", std::to_string(values) + " values, pixels times channels",
                              std::to_string(state.sums.values));
    if (!state.shape.alpha.empty() && state.shape.alpha.size() != pixels_of(state.shape))
        throw InvalidArgument("alpha", std::to_string(pixels_of(state.shape)) + " values",
                              std::to_string(state.shape.alpha.size()));
    for (const auto& plane : state.sums.planes) {
        if (plane.words.size() != values)
            throw InvalidArgument("plane " + plane.name, std::to_string(values) + " values",
                                  std::to_string(plane.words.size()));
        for (const auto& name : channels_of(plane.name, state.shape))
            if (name.size() > longest_name)
                throw InvalidArgument(
                    "channels", "names that leave room for " + plane.name + " in " + std::to_string(longest_name) + " bytes",
                    name.substr(0, 32) + "..");
    }
    for (const auto* settings : {&state.settings, &state.sums.settings})
        for (const auto& [name, value] : *settings)
            if (name.find('=') != std::string::npos) throw InvalidArgument("settings", "names without =", name);
    check_ranges(state);
}

// ---- attributes

std::string text_of(double x) {
    std::array<char, 32> text{};
    return {text.data(), std::to_chars(text.data(), text.data() + text.size(), x).ptr};
}

Imf::StringVectorAttribute pairs_attribute(const std::vector<std::pair<std::string, std::string>>& pairs) {
    Names lines;
    for (const auto& [name, value] : pairs) lines.push_back(name + "=" + value);
    return {lines};
}

std::vector<std::pair<std::string, std::string>> pairs_of(const Names& lines) {
    std::vector<std::pair<std::string, std::string>> pairs;
    for (const auto& line : lines) {
        const auto equals = line.find('=');
        if (equals == std::string::npos) throw std::runtime_error("damaged: " + line + " is no setting");
        pairs.emplace_back(line.substr(0, equals), line.substr(equals + 1));
    }
    return pairs;
}

std::string text_of(const Snapshot::Group& g) {
    return std::to_string(g.batches) + " " + text_of(g.weight) + " " + text_of(g.weight_low) + " " + text_of(g.weight2) +
           " " + text_of(g.weight2_low);
}

/// Numbers with a space between them; anything else is damage.
class Numbers {
public:
    explicit Numbers(const std::string& text) : text_(text), at_(text_.data()) {}
    template <class T> T next() {
        T value{};
        const char* const last = text_.data() + text_.size();
        const auto [end, error] = std::from_chars(at_, last, value);
        if (error != std::errc() || (end != last && *end != ' ')) fail();
        at_ = end == last ? end : end + 1;
        return value;
    }
    void end() const {
        if (at_ != text_.data() + text_.size()) fail();
    }

private:
    [[noreturn]] void fail() const { throw std::runtime_error("damaged: '" + text_ + "' are not the numbers expected"); }
    std::string text_;
    const char* at_;
};

template <class T> T number(const std::string& text) {
    Numbers numbers(text);
    const T value = numbers.next<T>();
    numbers.end();
    return value;
}

Snapshot::Group group_of(const std::string& text) {
    Numbers n(text);
    Snapshot::Group g;
    g.batches = n.next<std::uint64_t>();
    g.weight = n.next<double>();
    g.weight_low = n.next<double>();
    g.weight2 = n.next<double>();
    g.weight2_low = n.next<double>();
    n.end();
    return g;
}

template <class Attribute> auto attribute(const Imf::Header& header, const std::string& name) {
    const auto* found = header.findTypedAttribute<Attribute>(std::string(own) + name);
    if (!found) throw std::runtime_error("damaged: it has no attribute " + std::string(own) + name);
    return found->value();
}

std::string string_of(const Imf::Header& header, const std::string& name) {
    return attribute<Imf::StringAttribute>(header, name);
}

Names strings_of(const Imf::Header& header, const std::string& name) {
    return attribute<Imf::StringVectorAttribute>(header, name);
}

void insert_attributes(Imf::Header& header, const StateFile& state) {
    const auto insert = [&](const char* name, const Imf::Attribute& value) {
        header.insert(std::string(own) + name, value);
    };
    const auto text = [&](const char* name, const std::string& value) { insert(name, Imf::StringAttribute(value)); };
    Names groups, planes;
    for (const auto& g : state.sums.groups) groups.push_back(text_of(g));
    for (const auto& p : state.sums.planes) planes.push_back(p.name);
    text("state", version);
    text("kind", state.sums.kind);
    text("ranges", state.ranges.text());
    text("negatives", std::to_string(state.sums.negatives));
    text("skipped", std::to_string(state.sums.skipped));
    insert("channels", Imf::StringVectorAttribute(state.shape.channels));
    insert("planes", Imf::StringVectorAttribute(planes));
    insert("groups", Imf::StringVectorAttribute(groups));
    insert("sums", pairs_attribute(state.sums.settings));
    insert("settings", pairs_attribute(state.settings));
}

Names own_names(const Imf::Header& header) {
    Names names;
    for (auto a = header.begin(); a != header.end(); ++a)
        if (std::string_view(a.name()).starts_with(own)) names.emplace_back(a.name());
    return names;
}

Imf::Header header_of(const StateFile& state) {
    const Image& shape = state.shape;
    const bool no_display = shape.display_window == Window{};
    Imf::Header header(box_of(no_display ? shape.data_window : shape.display_window), box_of(shape.data_window));
    if (shape.metadata) carry_metadata(*shape.metadata, header);
    for (const auto& name : own_names(header)) header.erase(name);
    header.compression() = Imf::NO_COMPRESSION;
    for (const auto& plane : state.sums.planes)
        for (const auto& name : channels_of(plane.name, shape))
            header.channels().insert(name, Imf::Channel(type_of(plane.name)));
    if (!shape.alpha.empty()) header.channels().insert("A", Imf::Channel(Imf::FLOAT));
    insert_attributes(header, state);
    return header;
}

// ---- the checksum: over the header, itself left out, then row by row over each plane and alpha

class MemoryOutput : public Imf::OStream {
public:
    MemoryOutput() : Imf::OStream("memory") {}
    void write(const char bytes[], int size) override { bytes_.insert(bytes_.end(), bytes, bytes + size); }
    std::uint64_t tellp() override { return bytes_.size(); }
    void seekp(std::uint64_t) override { throw std::logic_error("a header is written from front to back"); }
    const std::vector<char>& bytes() const { return bytes_; }

private:
    std::vector<char> bytes_;
};

Checksum checksum_of(Imf::Header header) {
    for (const char* name : {checksum_name, "type", "version", "chunkCount", "name"}) header.erase(name);  // OpenEXR's own
    MemoryOutput out;
    header.writeTo(out);
    Checksum sum;
    sum.add(out.bytes());
    return sum;
}

/// The planes and alpha of `rows` rows, or of all.
struct Rows {
    std::vector<Words> planes;
    Words alpha;
    std::size_t width, channels;

    void add_to(Checksum& sum, std::size_t rows) const {
        for (std::size_t y = 0; y < rows; ++y) {
            for (const Words& plane : planes) sum.add(plane.subspan(y * width * channels, width * channels));
            if (!alpha.empty()) sum.add(alpha.subspan(y * width, width));
        }
    }
};

Words words_of(const std::vector<float>& values) {
    return {reinterpret_cast<const std::uint32_t*>(values.data()), values.size()};
}

Rows rows_of(const StateFile& state) {
    Rows rows{{}, words_of(state.shape.alpha), static_cast<std::size_t>(state.shape.width()), state.shape.channels.size()};
    for (const auto& plane : state.sums.planes) rows.planes.emplace_back(plane.words);
    return rows;
}

Imf::FrameBuffer frame_of(const StateFile& state, const Rows& rows, const Imath::Box2i& window) {
    Imf::FrameBuffer frame;
    for (std::size_t p = 0; p < rows.planes.size(); ++p) {
        const auto& name = state.sums.planes[p].name;
        add_slices(frame, channels_of(name, state.shape), type_of(name), rows.planes[p].data(), window);
    }
    if (!rows.alpha.empty()) add_slices(frame, {"A"}, Imf::FLOAT, rows.alpha.data(), window);
    return frame;
}

std::string hexadecimal(std::uint64_t n) {
    std::array<char, 16> digits{};
    const auto length = std::to_chars(digits.data(), digits.data() + digits.size(), n, 16).ptr - digits.data();
    return std::string(digits.size() - static_cast<std::size_t>(length), '0') +
           std::string(digits.data(), static_cast<std::size_t>(length));
}

// ---- writing

/// Reads the file back, some rows at a time, and compares its checksum with the one written.
void verify(const fs::path& path, const StateFile& state, std::uint64_t wanted) {
    Imf::MultiPartInputFile file(path.c_str());
    Checksum sum = checksum_of(file.header(0));
    Imf::InputPart part(file, 0);
    const Image& shape = state.shape;
    const Window& w = shape.data_window;
    constexpr std::size_t bytes_at_once = std::size_t{16} << 20;
    const auto width = static_cast<std::size_t>(shape.width());
    const std::size_t row_words = width * (state.sums.planes.size() * shape.channels.size() + 1);
    const auto most = static_cast<int>(std::clamp<std::size_t>(bytes_at_once / 4 / row_words, 1, 1 << 20));
    std::vector<std::uint32_t> words;
    for (int y = w.y0; y <= w.y1; y += most) {
        const int last = std::min(w.y1, y + most - 1);
        const auto count = static_cast<std::size_t>(last - y) + 1;
        words.assign(count * row_words, 0);
        Words left = words;
        const auto take = [&](std::size_t n) { return std::exchange(left, left.subspan(n)).first(n); };
        Rows rows{{}, {}, width, shape.channels.size()};
        for (std::size_t p = 0; p < state.sums.planes.size(); ++p)
            rows.planes.push_back(take(count * width * shape.channels.size()));
        if (!shape.alpha.empty()) rows.alpha = take(count * width);
        part.setFrameBuffer(frame_of(state, rows, {{w.x0, y}, {w.x1, last}}));
        part.readPixels(y, last);
        rows.add_to(sum, count);
    }
    if (sum.sum() != wanted) throw std::runtime_error("read back, it holds other values than were written");
}

void write(const fs::path& path, const StateFile& state) {
    ExrStream stream(output_target(path));
    Imf::Header header = header_of(state);
    Checksum sum = checksum_of(header);
    const Rows rows = rows_of(state);
    rows.add_to(sum, static_cast<std::size_t>(state.shape.height()));
    header.insert(checksum_name, Imf::StringAttribute(hexadecimal(sum.sum())));
    {
        Imf::OutputFile file(stream, header);
        file.setFrameBuffer(frame_of(state, rows, box_of(state.shape.data_window)));
        file.writePixels(state.shape.height());
    }
    stream.file().begin_sync();
    verify(stream.file().path(), state, sum.sum());
    stream.file().close_synced();
    stream.file().rename_to_target();
}

// ---- reading

StateFile header_state(const Imf::Header& header) {
    const auto* state_version = header.findTypedAttribute<Imf::StringAttribute>("clratio/state");
    if (!state_version) throw std::runtime_error("is no state: it has no attribute clratio/state");
    if (state_version->value() != version)
        throw std::runtime_error("is a state of version " + state_version->value() + "; this program reads version " +
                                 version);
    StateFile state;
    state.sums.kind = string_of(header, "kind");
    state.sums.settings = pairs_of(strings_of(header, "sums"));
    for (const auto& text : strings_of(header, "groups")) state.sums.groups.push_back(group_of(text));
    state.sums.negatives = number<std::uint64_t>(string_of(header, "negatives"));
    state.sums.skipped = number<std::uint64_t>(string_of(header, "skipped"));
    state.settings = pairs_of(strings_of(header, "settings"));
    state.ranges = BatchRanges::parse(string_of(header, "ranges"));
    state.shape.channels = strings_of(header, "channels");
    state.shape.data_window = window_of(header.dataWindow());
    state.shape.display_window = window_of(header.displayWindow());
    Imf::Header metadata = header;
    for (const auto& name : own_names(header)) metadata.erase(name);
    state.shape.metadata = std::make_shared<Image::Metadata>(Image::Metadata{metadata});
    require_channels(state.shape);
    state.sums.values = pixels_of(state.shape) * state.shape.channels.size();
    return state;
}

void check_channels(const Imf::Header& header, const StateFile& state, const Names& planes) {
    std::set<std::string> wanted;
    const auto require = [&](const std::string& name, Imf::PixelType type) {
        const auto* channel = header.channels().findChannel(name);
        if (!channel) throw std::runtime_error("damaged: channel " + name + " is missing");
        if (channel->type != type || channel->xSampling != 1 || channel->ySampling != 1)
            throw std::runtime_error("damaged: channel " + name + " is of another type");
        wanted.insert(name);
    };
    for (const auto& plane : planes)
        for (const auto& name : channels_of(plane, state.shape)) require(name, type_of(plane));
    for (auto c = header.channels().begin(); c != header.channels().end(); ++c)
        if (std::string_view(c.name()) != "A" && wanted.count(c.name()) == 0)
            throw std::runtime_error("damaged: channel " + std::string(c.name()) + " is unknown");
}

StateFile read(const fs::path& path, bool whole) {
    require_exr(path);
    Imf::MultiPartInputFile file(path.c_str());
    const Imf::Header& header = file.header(0);
    StateFile state = header_state(header);
    const Names planes = strings_of(header, "planes");
    check_channels(header, state, planes);
    check_ranges(state);
    if (!file.partComplete(0)) throw std::runtime_error("incomplete: pixels are missing");
    require_plausible_size(header, fs::file_size(path));
    if (!whole) return state;

    for (const auto& name : planes) state.sums.planes.push_back({name, std::vector<std::uint32_t>(state.sums.values)});
    if (header.channels().findChannel("A")) state.shape.alpha.resize(pixels_of(state.shape));
    const Rows rows = rows_of(state);
    Imf::InputPart part(file, 0);
    part.setFrameBuffer(frame_of(state, rows, header.dataWindow()));
    part.readPixels(header.dataWindow().min.y, header.dataWindow().max.y);
    Checksum sum = checksum_of(header);
    rows.add_to(sum, static_cast<std::size_t>(state.shape.height()));
    if (hexadecimal(sum.sum()) != string_of(header, "checksum"))
        throw std::runtime_error("damaged: its values are not those that were written");
    check_whole(state);
    return state;
}

StateFile read_checked(const fs::path& path, bool whole) {
    try {
        StateFile state = read(path, whole);
        state.shape.path = path.string();
        return state;
    } catch (const std::bad_alloc&) {
        throw IoError(path.string(), "", "too large for the memory of this machine");
    } catch (const std::exception& e) {
        throw IoError(path.string(), "", e.what());
    }
}

}  // namespace

void write_state(const fs::path& path, const StateFile& state) {
    check_whole(state);
    try {
        write(path, state);
    } catch (const std::exception& e) {
        throw IoError(path.string(), "", std::string("cannot be written: ") + e.what());
    }
}

StateFile read_state(const fs::path& path) { return read_checked(path, true); }
StateFile inspect_state(const fs::path& path) { return read_checked(path, false); }

}  // namespace clratio
