#include "output_file.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "clratio/state.hpp"
#include "output_target.hpp"
#include "tool.hpp"

namespace tool {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void cannot_write(const std::string& file, const std::string& reason) {
    throw clratio::IoError(file, "", "cannot be written: " + reason);
}

std::string target_of(const std::string& file) {
    require_place_for(file);
    return clratio::output_target(file).string();
}

std::string part_of(const fs::path& target) {
    return (target.parent_path() / (clratio::short_name(target) + "." + std::to_string(getpid()) + ".part")).string();
}

}  // namespace

OutputFile::OutputFile(std::string path)
    : path_(std::move(path)), target_(target_of(path_)), part_(part_of(target_)), file_(std::fopen(part_.c_str(), "wb")) {
    if (!file_) fail();
}

OutputFile::~OutputFile() {
    if (file_) std::remove(part_.c_str());
}

void OutputFile::fail() const { cannot_write(path_, std::strerror(errno)); }

void OutputFile::write(std::string_view bytes) {
    if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) fail();
}

void OutputFile::commit() {
    if (std::fflush(file_.get()) != 0 || fsync(fileno(file_.get())) != 0) fail();
    if (std::rename(part_.c_str(), target_.c_str()) != 0) fail();
    file_.reset();
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
