// A file that appears whole or not at all.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "whole_file.hpp"

namespace tool {

/// Written beside `path` under another name, which commit() gives up for `path`; without it nothing is left. A symbolic link
/// is followed. Every failure is a clratio::IoError that names `path`.
class OutputFile {
public:
    explicit OutputFile(std::string path);

    void write(std::string_view bytes);
    void commit();

private:
    std::string path_;
    clratio::WholeFile file_;
    std::uint64_t size_ = 0;
};

/// Said before the work, not after it: an IoError that `file` has no folder, or that what stands there is no file; a
/// UsageError that it holds a state, whose batches would be lost. An empty name is none.
void require_place_for(const std::string& file);
/// The same of a file that is to be a state itself.
void require_place_for_state(const std::string& file);

/// The same for all names that lead to one file, whether it exists or not.
std::filesystem::path identity_of(const std::string& file);

}  // namespace tool
