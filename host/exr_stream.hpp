// A file that is written whole or not at all; private to clratio::io.
#pragma once

#include <ImfIO.h>

#include <cstdint>
#include <filesystem>
#include <future>
#include <span>
#include <string>
#include <vector>

namespace clratio {

/// A new file beside `target` under a passing name; what killed processes left there is removed. Every write is checked; the
/// first failure is remembered, because OpenEXR 3.1 writes its offset table in a destructor that swallows it. Small writes
/// are gathered: OpenEXR writes header and offset table a few bytes at a time.
class FileOutput : public Imf::OStream {
public:
    explicit FileOutput(const std::filesystem::path& target);
    ~FileOutput() override;  ///< removes the file unless it was renamed
    FileOutput(const FileOutput&) = delete;
    FileOutput& operator=(const FileOutput&) = delete;

    void write(const char bytes[], int size) override;
    std::uint64_t tellp() override { return position_; }
    void seekp(std::uint64_t position) override { position_ = position; }

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
    std::uint64_t position_ = 0;
    std::vector<char> gathered_;  ///< to be written at gathered_at_
    std::uint64_t gathered_at_ = 0;
    std::future<int> synced_;  ///< errno
};

}  // namespace clratio
