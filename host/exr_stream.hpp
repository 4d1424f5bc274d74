// A file that is written whole or not at all; private to clratio::io.
#pragma once

#include <ImfIO.h>

#include <cstdint>
#include <filesystem>
#include <string>

namespace clratio {

/// A new file beside `target` under a passing name; what killed processes left there is removed. Every write is checked; the
/// first failure is remembered, because OpenEXR 3.1 writes its offset table in a destructor that swallows it.
class FileOutput : public Imf::OStream {
public:
    explicit FileOutput(const std::filesystem::path& target);
    ~FileOutput() override;  ///< removes the file unless it was renamed
    FileOutput(const FileOutput&) = delete;
    FileOutput& operator=(const FileOutput&) = delete;

    void write(const char bytes[], int size) override;
    std::uint64_t tellp() override { return position_; }
    void seekp(std::uint64_t position) override { position_ = position; }

    void close_synced();      ///< throws the first failure, if there was one
    void rename_to_target();  ///< and makes the rename durable
    const std::filesystem::path& path() const { return temporary_; }

private:
    [[noreturn]] void fail(int code);

    std::filesystem::path target_, temporary_;
    int file_ = -1;
    int lock_ = -1;    ///< the same file, which stays locked when file_ is closed
    int failure_ = 0;  ///< errno of the first failure
    bool exists_ = false;
    std::uint64_t position_ = 0;
};

}  // namespace clratio
