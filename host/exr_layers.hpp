// Which layers a file holds, and which one is meant; private to clratio::io.
#pragma once

#include <ImfMultiPartInputFile.h>

#include <string>
#include <vector>

namespace clratio {

/// The channels of one part that share a prefix: "ViewLayer.Combined" of "ViewLayer.Combined.R".
struct Layer {
    int part = 0;
    std::string prefix;
    std::vector<std::string> names;     ///< that --layer may call it by; none for the unnamed layer of a single part
    std::vector<std::string> channels;  ///< what is combined, without the prefix: R G B, or Y, or all but alpha
    bool alpha = false;                 ///< has an A beside them
    bool colour = false;                ///< R G B or luminance, not depth, normals, ids
    bool deep = false;
    std::string subsampled;  ///< the first subsampled channel, or empty

    std::string in_file(const std::string& channel) const { return prefix.empty() ? channel : prefix + "." + channel; }
};

std::vector<Layer> layers_of(const Imf::MultiPartInputFile& file);

/// The layer called `wanted`. Where that is empty: the only colour layer, else the only unnamed colour layer, else the
/// only layer. Throws std::runtime_error with the layers to choose from.
Layer choose_layer(const std::vector<Layer>& layers, const std::string& wanted);

}  // namespace clratio
