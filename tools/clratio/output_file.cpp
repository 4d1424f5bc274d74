#include "output_file.hpp"

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "clratio/exception.hpp"

namespace tool {

OutputFile::OutputFile(std::string path)
    : path_(std::move(path)), part_(path_ + "." + std::to_string(getpid()) + ".part"),
      file_(std::fopen(part_.c_str(), "wb")) {
    if (!file_) fail();
}

OutputFile::~OutputFile() {
    if (file_) std::remove(part_.c_str());
}

void OutputFile::fail() const {
    throw clratio::IoError(path_, "", std::string("cannot be written: ") + std::strerror(errno));
}

void OutputFile::write(std::string_view bytes) {
    if (std::fwrite(bytes.data(), 1, bytes.size(), file_.get()) != bytes.size()) fail();
}

void OutputFile::commit() {
    if (std::fflush(file_.get()) != 0 || fsync(fileno(file_.get())) != 0) fail();
    if (std::rename(part_.c_str(), path_.c_str()) != 0) fail();
    file_.reset();
}

void require_folder_of(const std::string& file) {
    const auto folder = std::filesystem::path(file).parent_path();
    if (!folder.empty() && !std::filesystem::is_directory(folder))
        throw clratio::IoError(file, "", "cannot be written: no folder " + folder.string());
}

}  // namespace tool
