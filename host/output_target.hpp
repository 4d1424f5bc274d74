// Where a file goes that is written beside its place and renamed; private to clratio::io and the command line.
#pragma once

#include <cstdio>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "checksum.hpp"

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

/// The name of `path`, for files beside it whose names add to it: one of more than 200 bytes would leave them no room, and
/// gives way to its first 180 and a checksum of it.
inline std::string short_name(const std::filesystem::path& path) {
    std::string name = path.filename().string();
    if (name.size() <= 200) return name;
    Checksum checksum;
    checksum.add(std::span<const char>(name));
    char sum[17];
    std::snprintf(sum, sizeof sum, "%016llx", static_cast<unsigned long long>(checksum.sum()));
    return name.substr(0, 180) + "-" + sum;
}

}  // namespace clratio
