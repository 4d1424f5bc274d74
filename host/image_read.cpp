#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>

#include <filesystem>
#include <stdexcept>

#include "exr_file.hpp"
#include "exr_layers.hpp"
#include "large.hpp"

namespace clratio {
namespace {

namespace fs = std::filesystem;

struct Source {
    std::string path, layer;
};

// A colon may stand in a file's name: the whole spec is tried first.
Source split(const std::string& spec, const std::string& layer) {
    const auto colon = spec.rfind(':');
    std::error_code ignored;
    if (colon == std::string::npos || colon == 0 || fs::exists(spec, ignored)) return {spec, layer};
    return {spec.substr(0, colon), spec.substr(colon + 1)};
}

Image read(const Source& source) {
    require_exr(source.path);
    Imf::MultiPartInputFile file(source.path.c_str());
    const Layer layer = choose_layer(layers_of(file), source.layer);
    if (layer.deep) throw std::runtime_error("deep images cannot be combined");
    if (!layer.subsampled.empty()) throw std::runtime_error("channel " + layer.subsampled + " is subsampled");
    if (!file.partComplete(layer.part)) throw std::runtime_error("incomplete: pixels are missing");
    const Imf::Header& header = file.header(layer.part);
    require_plausible_size(header, fs::file_size(source.path));

    Image image;
    image.path = source.path;
    image.layer = layer.names.empty() ? "" : layer.names.back();
    image.channels = layer.channels;
    image.data_window = window_of(header.dataWindow());
    image.display_window = window_of(header.displayWindow());
    image.metadata = std::make_shared<Image::Metadata>(Image::Metadata{header});

    const auto pixels = static_cast<std::size_t>(image.width()) * static_cast<std::size_t>(image.height());
    resize_large(image.values, pixels * layer.channels.size());
    resize_large(image.alpha, layer.alpha ? pixels : 0);
    std::vector<std::string> names;
    for (const auto& channel : layer.channels) names.push_back(layer.in_file(channel));
    Imf::FrameBuffer frame;
    add_slices(frame, names, Imf::FLOAT, image.values.data(), header.dataWindow());
    if (layer.alpha) add_slices(frame, {layer.in_file("A")}, Imf::FLOAT, image.alpha.data(), header.dataWindow());
    Imf::InputPart part(file, layer.part);
    part.setFrameBuffer(frame);
    part.readPixels(image.data_window.y0, image.data_window.y1);
    return image;
}

}  // namespace

Image read_image(const std::string& spec, const std::string& layer) {
    const Source source = split(spec, layer);
    try {
        return read(source);
    } catch (const std::bad_alloc&) {
        throw IoError(source.path, source.layer, "too large for the memory of this machine");
    } catch (const std::exception& e) {
        throw IoError(source.path, source.layer, e.what());
    }
}

}  // namespace clratio
