#include "exr_stream.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <system_error>
#include <utility>

namespace clratio {
namespace {

std::filesystem::path beside(const std::filesystem::path& target) {
    static std::atomic<unsigned> count{0};
    const std::string mark = std::to_string(getpid()) + "-" + std::to_string(count++);
    return target.parent_path() / ("." + target.filename().string() + "." + mark + ".tmp");
}

void sync_folder(const std::filesystem::path& folder) {
    const int file = open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (file < 0) throw std::system_error(errno, std::system_category());
    const int code = fsync(file) != 0 && errno != EINVAL ? errno : 0;  // EINVAL: a file system without such a thing
    close(file);
    if (code != 0) throw std::system_error(code, std::system_category());
}

}  // namespace

FileOutput::FileOutput(const std::filesystem::path& target)
    : Imf::OStream(target.c_str()), target_(target), temporary_(beside(target)) {
    file_ = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file_ < 0) throw std::system_error(errno, std::system_category());
    exists_ = true;
}

FileOutput::~FileOutput() {
    if (file_ >= 0) close(file_);
    if (exists_) unlink(temporary_.c_str());
}

void FileOutput::fail(int code) {
    if (failure_ == 0) failure_ = code;
    throw std::system_error(failure_, std::system_category());
}

void FileOutput::write(const char bytes[], int size) {
    if (failure_ != 0) fail(failure_);
    while (size > 0) {
        const ssize_t done = pwrite(file_, bytes, static_cast<std::size_t>(size), static_cast<off_t>(position_));
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) fail(done < 0 ? errno : EIO);
        bytes += done;
        size -= static_cast<int>(done);
        position_ += static_cast<std::uint64_t>(done);
    }
}

void FileOutput::close_synced() {
    if (failure_ == 0 && fsync(file_) != 0) failure_ = errno;
    if (close(std::exchange(file_, -1)) != 0 && failure_ == 0) failure_ = errno;
    if (failure_ != 0) fail(failure_);
}

void FileOutput::rename_to_target() {
    if (rename(temporary_.c_str(), target_.c_str()) != 0) fail(errno);
    exists_ = false;
    sync_folder(target_.parent_path());
}

}  // namespace clratio
