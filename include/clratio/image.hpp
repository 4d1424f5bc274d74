// clratio::io: images in and out of OpenEXR files.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "clratio/combine.hpp"

namespace clratio {

/// An inclusive pixel rectangle, as OpenEXR stores windows.
struct Window {
    int x0 = 0, y0 = 0, x1 = -1, y1 = -1;
    bool operator==(const Window&) const = default;
};

/// Interleaved float32 values of the colour channels of one layer; alpha stands aside.
class Image {
public:
    Image() = default;

    std::vector<std::string> channels;  ///< without the layer: {"R", "G", "B"} or {"Y"}
    std::vector<float> values;          ///< channels.size() a pixel, rows from the top
    std::vector<float> alpha;           ///< one a pixel, or empty
    Window data_window, display_window;
    std::string path, layer;  ///< where it came from; both empty for an image made here

    /// What else the file's header said (attributes), carried to the file written from this image.
    struct Metadata;
    std::shared_ptr<const Metadata> metadata;

    int width() const { return data_window.x1 - data_window.x0 + 1; }
    int height() const { return data_window.y1 - data_window.y0 + 1; }
    std::uint64_t size() const { return values.size(); }
    operator std::span<const float>() const { return values; }
    operator Tau() const& { return Tau(std::span<const float>(values)); }
    operator Tau() && { return Tau::owning(std::move(values)); }  ///< the image's values are given away
};

/// Reads half, float or uint; Y, RGB, RGBA or named channels; scanline, tiled or multi-part; any compression.
/// `spec` is "FILE" or "FILE:LAYER"; `layer` is used where spec names none. With one colour layer in the file it is
/// found without asking; of several, the one without a name (plain R, G, B). A part of a multi-part file is a layer too,
/// called by the part's name. A layer that is no colour gives all its channels but alpha.
/// Shapes: the data window's pixels. Values: as stored, NaN and infinity too; uint becomes the nearest float.
/// Errors: IoError with path, layer and reason: missing, damaged, incomplete, subsampled, deep, no such layer,
/// several layers and none named (they are listed). Damage inside uncompressed or lossy pixel data cannot be seen:
/// OpenEXR has checksums only where zlib made them (ZIP, ZIPS, PXR24).
Image read_image(const std::string& spec, const std::string& layer = "");

struct WriteOptions {
    std::vector<std::pair<std::string, std::string>>
        attributes;  ///< string attributes to add, e.g. {"clratio/estimator", "ratio"}
};

/// Writes float32 channels (and alpha where there is one) under their plain names, ZIP, with windows and metadata of the
/// image; an empty display window means the data window. Bits are kept, those of NaN too. Written beside `path` through
/// checked writes, synced, reopened and compared, then renamed over it: either the whole new file stands there or what was
/// there before. A symbolic link is followed. Errors: InvalidArgument where counts do not fit the window, IoError.
/// Where a file-size limit is set, SIGXFSZ must be ignored, or the system ends the process instead.
void write_image(const std::filesystem::path& path, const Image& image, const WriteOptions& options = {});

/// The same for a flag image: one UINT channel for each channel of `like`.
void write_flags(const std::filesystem::path& path, const Image& like, std::span<const std::uint32_t> flags,
                 const WriteOptions& options = {});

/// From now on images are compressed and decompressed on so many threads of OpenEXR's own pool, which the whole process
/// shares; 0, as it starts, on the caller's thread. Changes no byte of any file.
void set_image_threads(unsigned count);

/// Throws InvalidArgument naming both files where windows or channels differ.
void require_same_shape(const Image& a, const Image& b);

/// A read-out in the shape of an image.
struct CombinedImage {
    Image estimate, standard_error;  ///< without values where not asked for, like those below
    std::vector<std::uint32_t> flag_image;
    FlagCounts flags;
    Image bias, lower, upper, gain, needed;
    std::vector<std::uint32_t> kind;
};
/// Gives a read-out the windows, channels, alpha and metadata of `like`. Errors: none; the counts are the caller's to match.
CombinedImage combined_image(Combined&& combined, const Image& like);
/// Reads out with an image of tau, whose shape and metadata the result takes.
CombinedImage combine(const Moments& moments, const Image& tau, CombineOptions options = {});

}  // namespace clratio
