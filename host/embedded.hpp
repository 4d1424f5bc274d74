// The kernels and device headers as they stand in the source tree, byte for byte.
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>

namespace clratio {

struct EmbeddedFile {
    std::string_view path;  ///< as an #include names it: "clratio/device/law.h", "kernels/law.cl"
    std::string_view text;
};
extern constinit const std::span<const EmbeddedFile> embedded_files;  ///< there before anything static is made

/// The source of kernels/WORD.cl with its includes put in, each once, after a #line that names the file.
std::string flatten_kernel(std::string_view word);

}  // namespace clratio
