// A file that is written whole or not at all; private to clratio::io and the command line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <future>
#include <span>
#include <vector>

namespace clratio {

/// A new file beside `target` under a passing name, with the mode of what it replaces; what killed processes left there is
/// removed. Every write is checked, and the first failure remembered and thrown again by whatever follows. Small writes are
/// gathered. Failures are std::system_error.
class WholeFile {
public:
    explicit WholeFile(const std::filesystem::path& target);
    ~WholeFile();  ///< removes the file unless it was renamed
    WholeFile(const WholeFile&) = delete;
    WholeFile& operator=(const WholeFile&) = delete;

    void write(std::span<const char> bytes, std::uint64_t position);
    void begin_sync();        ///< on a thread of its own: the file may be read meanwhile
    void close_synced();      ///< throws the first failure, if there was one
    void rename_to_target();  ///< and makes the rename durable
    const std::filesystem::path& path() const { return temporary_; }

private:
    [[noreturn]] void fail(int code);
    void flush();
    void put(std::span<const char> bytes, std::uint64_t position);

    std::filesystem::path target_, temporary_;
    int file_ = -1;
    int lock_ = -1;    ///< the same file, which stays locked when file_ is closed
    int failure_ = 0;  ///< errno of the first failure
    bool exists_ = false;
    std::vector<char> gathered_;  ///< to be written at gathered_at_
    std::uint64_t gathered_at_ = 0;
    std::future<int> synced_;  ///< errno
};

}  // namespace clratio
