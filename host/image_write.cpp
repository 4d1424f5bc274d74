#include <ImfChannelList.h>
#include <ImfInputFile.h>
#include <ImfOutputFile.h>
#include <ImfStringAttribute.h>

#include <cstring>
#include <set>

#include "exr_file.hpp"
#include "exr_stream.hpp"
#include "output_target.hpp"

namespace clratio {
namespace {

namespace fs = std::filesystem;

/// The values of a file to be: interleaved 4-byte numbers, and alpha beside them.
struct Planes {
    const Image& shape;
    Imf::PixelType type;
    const void* values;
    const float* alpha;  ///< or null

    std::uint64_t pixels() const {
        return static_cast<std::uint64_t>(shape.width()) * static_cast<std::uint64_t>(shape.height());
    }
    std::uint64_t bytes() const { return 4 * pixels() * shape.channels.size(); }
    Imf::FrameBuffer frame() const {
        Imf::FrameBuffer f;
        add_slices(f, shape.channels, type, values, box_of(shape.data_window));
        if (alpha) add_slices(f, {"A"}, Imf::FLOAT, alpha, box_of(shape.data_window));
        return f;
    }
};

void require_count(const char* name, std::uint64_t expected, std::uint64_t got) {
    if (expected != got) throw InvalidArgument(name, std::to_string(expected) + " values", std::to_string(got));
}

Imf::Header header_of(const Planes& planes, const WriteOptions& options) {
    const Image& image = planes.shape;
    const bool no_display = image.display_window == Window{};
    Imf::Header header(box_of(no_display ? image.data_window : image.display_window), box_of(image.data_window));
    if (image.metadata) carry_metadata(*image.metadata, header);
    for (const auto& [name, text] : options.attributes) header.insert(name, Imf::StringAttribute(text));
    header.compression() = Imf::ZIP_COMPRESSION;
    for (const auto& channel : image.channels) header.channels().insert(channel, Imf::Channel(planes.type));
    if (planes.alpha) header.channels().insert("A", Imf::Channel(Imf::FLOAT));
    return header;
}

void verify(const fs::path& path, const Planes& wanted) {
    std::vector<char> values(wanted.bytes());
    std::vector<float> alpha(wanted.alpha ? wanted.pixels() : 0);
    Imf::InputFile file(path.c_str());
    file.setFrameBuffer(Planes{wanted.shape, wanted.type, values.data(), wanted.alpha ? alpha.data() : nullptr}.frame());
    file.readPixels(wanted.shape.data_window.y0, wanted.shape.data_window.y1);
    const bool same = std::memcmp(values.data(), wanted.values, values.size()) == 0 &&
                      (alpha.empty() || std::memcmp(alpha.data(), wanted.alpha, alpha.size() * sizeof(float)) == 0);
    if (!same) throw std::runtime_error("read back, it holds other values than were written");
}

void write(const fs::path& path, const Planes& planes, const WriteOptions& options) {
    ExrStream stream(output_target(path));
    {
        Imf::OutputFile file(stream, header_of(planes, options));
        file.setFrameBuffer(planes.frame());
        file.writePixels(planes.shape.height());
    }
    stream.file().begin_sync();
    verify(stream.file().path(), planes);
    stream.file().close_synced();
    stream.file().rename_to_target();
}

void write_checked(const fs::path& path, const Planes& planes, const WriteOptions& options) {
    try {
        write(path, planes, options);
    } catch (const std::exception& e) {
        throw IoError(path.string(), "", std::string("cannot be written: ") + e.what());
    }
}

}  // namespace

void write_image(const fs::path& path, const Image& image, const WriteOptions& options) {
    require_channels(image);
    const Planes planes{image, Imf::FLOAT, image.values.data(), image.alpha.empty() ? nullptr : image.alpha.data()};
    require_count("values", planes.bytes() / 4, image.values.size());
    if (planes.alpha) require_count("alpha", planes.pixels(), image.alpha.size());
    write_checked(path, planes, options);
}

void write_flags(const fs::path& path, const Image& like, std::span<const std::uint32_t> flags,
                 const WriteOptions& options) {
    require_channels(like);
    const Planes planes{like, Imf::UINT, flags.data(), nullptr};
    require_count("flags", planes.bytes() / 4, flags.size());
    write_checked(path, planes, options);
}

}  // namespace clratio
