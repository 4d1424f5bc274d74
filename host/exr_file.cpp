#include "exr_file.hpp"

#include <ImfChannelList.h>
#include <ImfTestFile.h>

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <set>
#include <stdexcept>

namespace clratio {
namespace {

namespace fs = std::filesystem;

// What describes the layout of the file read, not the picture. A preview would be stale; Blender would look for its
// layers where BlenderMultiChannel stands.
const std::set<std::string> not_carried{
    "channels", "compression", "dataWindow", "displayWindow",      "lineOrder",
    "tiles",    "type",        "version",    "chunkCount",         "name",
    "view",     "multiView",   "preview",    "maxSamplesPerPixel", "BlenderMultiChannel"};

}  // namespace

void carry_metadata(const Image::Metadata& from, Imf::Header& to) {
    for (auto a = from.header.begin(); a != from.header.end(); ++a)
        if (not_carried.count(a.name()) == 0) to.insert(a.name(), a.attribute());
}

void require_channels(const Image& image) {
    const std::set<std::string> unique(image.channels.begin(), image.channels.end());
    if (unique.empty() || unique.size() != image.channels.size() || unique.count("") != 0)
        throw InvalidArgument("channels", "one or more different names",
                              std::to_string(image.channels.size()) + " channels");
    for (const std::string& name : image.channels)
        if (name.size() > longest_name)
            throw InvalidArgument("channels", "names of at most " + std::to_string(longest_name) + " bytes",
                                  std::to_string(name.size()) + ": " + name.substr(0, 32) + "..");
    if (unique.count("A") != 0 && !image.alpha.empty())
        throw InvalidArgument("channels", "no A where alpha is given apart", "both");
    if (image.width() < 1 || image.height() < 1)
        throw InvalidArgument("data_window", "at least one pixel",
                              std::to_string(image.width()) + " x " + std::to_string(image.height()));
}

void require_plausible_size(const Imf::Header& header, std::uint64_t file_bytes) {
    const bool dwa = header.compression() == Imf::DWAA_COMPRESSION || header.compression() == Imf::DWAB_COMPRESSION;
    const double most = static_cast<double>(file_bytes) * (dwa ? 65536 : 2048);
    const auto& w = header.dataWindow();
    const double pixels = (1.0 + w.max.x - w.min.x) * (1.0 + w.max.y - w.min.y);
    double bytes = 0;
    const auto& list = header.channels();
    for (auto c = list.begin(); c != list.end(); ++c) bytes += c.channel().type == Imf::HALF ? 2 * pixels : 4 * pixels;
    if (bytes > most) throw std::runtime_error("damaged: its header asks for more pixels than the file can hold");
}

void require_exr(const std::string& path) {
    if (const auto status = fs::status(path); !fs::exists(status)) throw std::runtime_error("no such file");
    if (fs::is_directory(path)) throw std::runtime_error("is a folder");
    if (!fs::is_regular_file(path)) throw std::runtime_error("is not a regular file");
    if (access(path.c_str(), R_OK) != 0) throw std::runtime_error(std::string("cannot be read: ") + std::strerror(errno));
    if (!Imf::isOpenExrFile(path.c_str())) throw std::runtime_error("cannot be opened, or is not an OpenEXR file");
}

}  // namespace clratio
