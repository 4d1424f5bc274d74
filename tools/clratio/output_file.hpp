// A file that appears whole or not at all.
#pragma once

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

namespace tool {

/// Written beside `path` under another name, which commit() gives up for `path`; without it nothing is left. Every failure
/// is a clratio::IoError that names `path`.
class OutputFile {
public:
    explicit OutputFile(std::string path);
    ~OutputFile();
    OutputFile(const OutputFile&) = delete;
    OutputFile& operator=(const OutputFile&) = delete;

    void write(std::string_view bytes);
    void commit();

private:
    struct Close {
        void operator()(std::FILE* f) const { std::fclose(f); }
    };
    [[noreturn]] void fail() const;

    std::string path_, part_;
    std::unique_ptr<std::FILE, Close> file_;
};

/// A folder that is not there is said before the work, not after it: IoError. An empty name is none.
void require_folder_of(const std::string& file);

}  // namespace tool
