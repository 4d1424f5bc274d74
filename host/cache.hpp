// Files of built programs. An entry is checked before any driver sees it: drivers crash on damaged binaries.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace clratio::cache {

std::uint64_t fnv1a(const void* bytes, std::size_t size, std::uint64_t hash = 14695981039346656037u);

/// $XDG_CACHE_HOME/clratio or ~/.cache/clratio; empty where neither variable is set.
std::filesystem::path folder();
std::filesystem::path entry(const std::filesystem::path& folder, const std::string& key);

/// The payload stored under `key`, or nothing where the entry is missing, damaged or another key's.
std::optional<std::vector<unsigned char>> load(const std::filesystem::path& entry, const std::string& key);
/// Makes the folder. False where it would take no entry.
bool prepare(const std::filesystem::path& folder);
/// Written beside the entry, then renamed over it. False where the disk does not take it: a cache may fail in silence.
bool store(const std::filesystem::path& entry, const std::string& key, const std::vector<unsigned char>& payload);

}  // namespace clratio::cache
