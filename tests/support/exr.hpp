// OpenEXR files of every kind, written with OpenEXR itself and read back channel by channel, as an oracle for clratio::io.
#pragma once

#include <ImfChannelList.h>
#include <ImfDeepFrameBuffer.h>
#include <ImfDeepScanLineOutputPart.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfInputPart.h>
#include <ImfMultiPartInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfTileDescription.h>
#include <ImfTiledOutputPart.h>
#include <half.h>

#include <cstring>
#include <string>
#include <vector>

namespace clratio::test {

struct ExrPart {
    std::vector<std::string> channels{"B", "G", "R"};  // as OpenEXR sorts them
    Imf::PixelType type = Imf::FLOAT;
    Imf::Compression compression = Imf::ZIP_COMPRESSION;
    Imath::Box2i data{{0, 0}, {36, 22}};
    Imath::Box2i display{{0, 0}, {36, 22}};
    int tile = 0;  // 0: scanlines
    Imf::LevelMode levels = Imf::ONE_LEVEL;
    int sampling = 1;
    std::string name{};

    int width() const { return data.max.x - data.min.x + 1; }
    int height() const { return data.max.y - data.min.y + 1; }
};

/// Channel c at column x, row y of the data window. A value that half, float and uint all hold exactly.
inline float exact_value(std::size_t c, int x, int y) {
    return static_cast<float>((static_cast<std::size_t>(131 * x + 37 * y + x * y) + 501 * c) % 2048);
}

/// The same numbers as the pixel type stores them, one plane a channel.
inline std::vector<char> plane_of(const ExrPart& part, std::size_t c, float add = 0) {
    const std::size_t bytes = part.type == Imf::HALF ? 2 : 4;
    std::vector<char> plane(bytes * static_cast<std::size_t>(part.width() * part.height()));
    for (int y = 0; y < part.height(); ++y)
        for (int x = 0; x < part.width(); ++x) {
            const float v = exact_value(c, x, y) + add;
            const half h(v);
            const auto u = static_cast<unsigned>(v);
            const void* from = part.type == Imf::HALF   ? static_cast<const void*>(&h)
                               : part.type == Imf::UINT ? static_cast<const void*>(&u)
                                                        : static_cast<const void*>(&v);
            std::memcpy(&plane[bytes * static_cast<std::size_t>(y * part.width() + x)], from, bytes);
        }
    return plane;
}

inline Imf::Header header_of(const ExrPart& part) {
    Imf::Header header(part.display, part.data);
    header.compression() = part.compression;
    for (const auto& name : part.channels)
        header.channels().insert(name, Imf::Channel(part.type, part.sampling, part.sampling));
    header.setType(part.tile ? Imf::TILEDIMAGE : Imf::SCANLINEIMAGE);
    if (part.tile) {
        const auto tile = static_cast<unsigned>(part.tile);
        header.setTileDescription({tile, tile, part.levels});
    }
    if (!part.name.empty()) header.setName(part.name);
    return header;
}

inline Imf::FrameBuffer frame_of(const ExrPart& part, const std::vector<std::vector<char>>& planes) {
    const std::size_t bytes = part.type == Imf::HALF ? 2 : 4;
    Imf::FrameBuffer frame;
    for (std::size_t c = 0; c < planes.size(); ++c)
        frame.insert(part.channels[c],
                     Imf::Slice::Make(part.type, planes[c].data(), part.data, bytes,
                                      bytes * static_cast<std::size_t>(part.width()), part.sampling, part.sampling));
    return frame;
}

/// Writes exact_value()s to level 0 and other numbers to the further levels.
inline void write_part(Imf::MultiPartOutputFile& file, int index, const ExrPart& part) {
    std::vector<std::vector<char>> planes, wrong;
    for (std::size_t c = 0; c < part.channels.size(); ++c) {
        planes.push_back(plane_of(part, c));
        wrong.push_back(plane_of(part, c, 5000));
    }
    if (!part.tile) {
        Imf::OutputPart out(file, index);
        out.setFrameBuffer(frame_of(part, planes));
        out.writePixels(part.height());
        return;
    }
    Imf::TiledOutputPart out(file, index);
    for (int ly = 0; ly < out.numYLevels(); ++ly)
        for (int lx = 0; lx < out.numXLevels(); ++lx) {
            if (!out.isValidLevel(lx, ly)) continue;
            out.setFrameBuffer(frame_of(part, lx + ly == 0 ? planes : wrong));
            out.writeTiles(0, out.numXTiles(lx) - 1, 0, out.numYTiles(ly) - 1, lx, ly);
        }
}

inline void write_exr(const std::string& path, const std::vector<ExrPart>& parts) {
    std::vector<Imf::Header> headers;
    for (const auto& part : parts) headers.push_back(header_of(part));
    Imf::MultiPartOutputFile file(path.c_str(), headers.data(), static_cast<int>(headers.size()));
    for (std::size_t i = 0; i < parts.size(); ++i) write_part(file, static_cast<int>(i), parts[i]);
}

/// A deep file of one sample a pixel.
inline void write_deep_exr(const std::string& path) {
    constexpr int size = 4;
    Imf::Header header(size, size);
    header.channels().insert("R", Imf::Channel(Imf::FLOAT));
    header.channels().insert("G", Imf::Channel(Imf::FLOAT));
    header.channels().insert("B", Imf::Channel(Imf::FLOAT));
    header.setType(Imf::DEEPSCANLINE);
    header.compression() = Imf::ZIPS_COMPRESSION;
    std::vector<unsigned> counts(size * size, 1);
    std::vector<float> samples(size * size, 1);
    std::vector<float*> pointers;
    for (auto& s : samples) pointers.push_back(&s);
    Imf::DeepFrameBuffer frame;
    frame.insertSampleCountSlice(Imf::Slice(Imf::UINT, reinterpret_cast<char*>(counts.data()), 4, 4 * size));
    for (const char* name : {"R", "G", "B"})
        frame.insert(name, Imf::DeepSlice(Imf::FLOAT, reinterpret_cast<char*>(pointers.data()), sizeof(float*),
                                          sizeof(float*) * size, sizeof(float)));
    Imf::MultiPartOutputFile file(path.c_str(), &header, 1);
    Imf::DeepScanLineOutputPart part(file, 0);
    part.setFrameBuffer(frame);
    part.writePixels(size);
}

/// One channel of level 0, as floats.
inline std::vector<float> read_channel(const std::string& path, int part, const std::string& channel) {
    Imf::MultiPartInputFile file(path.c_str());
    const auto window = file.header(part).dataWindow();
    const auto width = static_cast<std::size_t>(window.max.x - window.min.x + 1);
    std::vector<float> values(width * static_cast<std::size_t>(window.max.y - window.min.y + 1));
    Imf::FrameBuffer frame;
    frame.insert(channel, Imf::Slice::Make(Imf::FLOAT, values.data(), window, 4, 4 * width));
    Imf::InputPart in(file, part);
    in.setFrameBuffer(frame);
    in.readPixels(window.min.y, window.max.y);
    return values;
}

/// Where the header of a single-part file ends and its offset table begins.
inline std::size_t header_end(const std::string& file) {
    std::size_t at = 8;
    while (file[at] != 0) {
        at = file.find('\0', file.find('\0', at) + 1) + 1;
        std::uint32_t size = 0;
        std::memcpy(&size, &file[at], 4);
        at += 4 + size;
    }
    return at + 1;
}

}  // namespace clratio::test
