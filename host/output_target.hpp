// Where a file goes that is written beside its place and renamed; private to clratio::io and the command line.
#pragma once

#include <filesystem>
#include <stdexcept>

namespace clratio {

/// Links are followed, also one that leads nowhere yet. Throws std::runtime_error where what stands there is no file.
inline std::filesystem::path output_target(const std::filesystem::path& path) {
    namespace fs = std::filesystem;
    const auto status = fs::status(path);
    if (fs::exists(status) && !fs::is_regular_file(status)) throw std::runtime_error("exists and is not a regular file");
    if (fs::exists(status)) return fs::canonical(path);
    const bool leads_nowhere = fs::is_symlink(fs::symlink_status(path));
    return leads_nowhere ? output_target(path.parent_path() / fs::read_symlink(path)) : path;
}

}  // namespace clratio
