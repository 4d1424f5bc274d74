// A folder that a renderer writes pairs of files to, looked at now and then.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "combine_input.hpp"

namespace tool::combining {

/// A name with one * that stands for a number, and what was behind it: "m_*.exr:shadow" is a pattern and a layer.
class Pattern {
public:
    /// UsageError, naming `option`, unless there is exactly one * and no folder.
    Pattern(const char* option, const std::string& text);

    /// The number that * stands for in this file name; nothing where the name does not fit.
    std::optional<std::uint64_t> number(const std::string& file) const;
    const std::string& layer() const { return layer_; }  ///< with its colon, or empty

private:
    std::string before_, after_, layer_;
};

/// Pairs whose two files have the same number, which is the batch's index: the same after every restart.
class WatchFolder {
public:
    WatchFolder(std::filesystem::path folder, Pattern m, Pattern t, double settle);

    /// Pairs of which both files are there, and have kept size and time for `settle` seconds; by number. IoError where the
    /// folder cannot be read, or two files of a kind have the same number (m_1.exr, m_01.exr).
    std::vector<Job> settled();
    /// Not again, unless one of its files changes.
    void put_off(const Job& job);

private:
    struct Stamp {
        std::uintmax_t size = 0;
        std::filesystem::file_time_type time;
        bool operator==(const Stamp&) const = default;
    };
    struct Seen {
        std::string name;
        Stamp stamp;
        std::chrono::steady_clock::time_point since;
        bool put_off = false;
    };
    using Files = std::map<std::uint64_t, Seen>;
    void look(Files& files, const Pattern& pattern);

    std::filesystem::path folder_;
    Pattern m_pattern_, t_pattern_;
    std::chrono::duration<double> settle_;
    Files m_, t_;
};

}  // namespace tool::combining
