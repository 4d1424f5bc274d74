#include "output_file.hpp"

#include <system_error>

#include "clratio/state.hpp"
#include "output_target.hpp"
#include "tool.hpp"

namespace tool {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void cannot_write(const std::string& file, const std::string& reason) {
    throw clratio::IoError(file, "", "cannot be written: " + reason);
}

template <class Work> auto named(const std::string& file, Work work) {
    try {
        return work();
    } catch (const std::system_error& e) {
        cannot_write(file, e.code().message());
    }
}

}  // namespace

OutputFile::OutputFile(std::string path)
    : path_(std::move(path)), file_(named(path_, [&] {
          require_place_for(path_);
          return clratio::WholeFile(clratio::output_target(path_));
      })) {}

void OutputFile::write(std::string_view bytes) {
    named(path_, [&] { file_.write(bytes, size_); });
    size_ += bytes.size();
}

void OutputFile::commit() {
    named(path_, [&] {
        file_.close_synced();
        file_.rename_to_target();
    });
}

void require_place_for_state(const std::string& file) {
    const auto folder = fs::path(file).parent_path();
    if (!folder.empty() && !fs::is_directory(folder)) cannot_write(file, "no folder " + folder.string());
    std::error_code failed;
    const auto there = fs::status(file, failed);
    if (there.type() == fs::file_type::none) cannot_write(file, failed.message());
    if (fs::exists(there) && !fs::is_regular_file(there)) cannot_write(file, "exists and is not a regular file");
}

void require_place_for(const std::string& file) {
    require_place_for_state(file);
    try {
        clratio::inspect_state(file);
    } catch (const clratio::Error&) {
        return;
    }
    throw UsageError(file + ": holds a state, which another file would replace; remove it first");
}

fs::path identity_of(const std::string& file) {
    if (file.empty()) return {};
    const fs::path plain = fs::absolute(file).lexically_normal();
    std::error_code failed;
    const fs::path real = fs::weakly_canonical(plain, failed);
    return failed ? plain : real;
}

}  // namespace tool
