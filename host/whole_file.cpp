#include "whole_file.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <system_error>
#include <utility>

#include "output_target.hpp"

namespace clratio {
namespace {

namespace fs = std::filesystem;

std::string front(const fs::path& target) { return "." + short_name(target) + "."; }
constexpr std::string_view back = ".tmp";

fs::path beside(const fs::path& target) {
    static std::atomic<unsigned> count{0};
    const std::string mark = std::to_string(getpid()) + "-" + std::to_string(count++);
    return target.parent_path() / (front(target) + mark + std::string(back));
}

bool is_temporary(const std::string& name, const fs::path& target) {
    const std::string before = front(target);
    if (name.size() <= before.size() + back.size() || !name.starts_with(before) || !name.ends_with(back)) return false;
    const std::string mark = name.substr(before.size(), name.size() - before.size() - back.size());
    return mark.find_first_not_of("0123456789-") == std::string::npos;
}

// Writers hold a lock on their temporary file, which the system takes back when they die: what can be locked is nobody's.
void remove_left_behind(const fs::path& target) {
    std::error_code none;
    const fs::path folder = target.has_parent_path() ? target.parent_path() : ".";
    for (const auto& entry : fs::directory_iterator(folder, none)) {
        if (!is_temporary(entry.path().filename().string(), target)) continue;
        const int file = open(entry.path().c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
        if (file < 0) continue;
        if (flock(file, LOCK_EX | LOCK_NB) == 0) unlink(entry.path().c_str());
        close(file);
    }
}

/// Did another process take the new file for one left behind, before it was locked?
bool lost(int file) {
    struct stat now {};
    return (flock(file, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) || fstat(file, &now) != 0 || now.st_nlink == 0;
}

/// A file that others may not read stays so.
void keep_mode(const fs::path& from, int to) {
    struct stat old {};
    if (stat(from.c_str(), &old) == 0) (void)!fchmod(to, old.st_mode & 07777);
}

void sync_folder(const fs::path& folder) {
    const int file = open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (file < 0) throw std::system_error(errno, std::system_category());
    const int code = fsync(file) != 0 && errno != EINVAL ? errno : 0;  // EINVAL: a file system without such a thing
    close(file);
    if (code != 0) throw std::system_error(code, std::system_category());
}

}  // namespace

WholeFile::WholeFile(const fs::path& target) : target_(target) {
    remove_left_behind(target);
    do {
        if (file_ >= 0) close(file_);
        temporary_ = beside(target);
        file_ = open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (file_ < 0) throw std::system_error(errno, std::system_category());
    } while (lost(file_));
    exists_ = true;
    keep_mode(target, file_);
    lock_ = fcntl(file_, F_DUPFD_CLOEXEC, 0);
}

WholeFile::~WholeFile() {
    if (synced_.valid()) synced_.wait();
    if (file_ >= 0) close(file_);
    if (exists_) unlink(temporary_.c_str());
    if (lock_ >= 0) close(lock_);
}

void WholeFile::fail(int code) {
    if (failure_ == 0) failure_ = code;
    throw std::system_error(failure_, std::system_category());
}

void WholeFile::put(std::span<const char> bytes, std::uint64_t position) {
    while (!bytes.empty()) {
        const ssize_t done = pwrite(file_, bytes.data(), bytes.size(), static_cast<off_t>(position));
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) fail(done < 0 ? errno : EIO);
        bytes = bytes.subspan(static_cast<std::size_t>(done));
        position += static_cast<std::uint64_t>(done);
    }
}

void WholeFile::flush() {
    put(gathered_, gathered_at_);
    gathered_.clear();
}

void WholeFile::write(std::span<const char> bytes, std::uint64_t position) {
    constexpr std::size_t most = 1 << 16;
    if (failure_ != 0) fail(failure_);
    if (position != gathered_at_ + gathered_.size() || gathered_.size() + bytes.size() > most) flush();
    if (gathered_.empty()) gathered_at_ = position;
    if (bytes.size() > most)
        put(bytes, position);
    else
        gathered_.insert(gathered_.end(), bytes.begin(), bytes.end());
}

void WholeFile::begin_sync() {
    if (failure_ != 0) fail(failure_);
    flush();
    synced_ = std::async(std::launch::async, [file = file_] { return fsync(file) == 0 ? 0 : errno; });
}

void WholeFile::close_synced() {
    if (!synced_.valid()) begin_sync();
    failure_ = synced_.get();
    if (close(std::exchange(file_, -1)) != 0 && failure_ == 0) failure_ = errno;
    if (failure_ != 0) fail(failure_);
}

void WholeFile::rename_to_target() {
    if (rename(temporary_.c_str(), target_.c_str()) != 0) fail(errno);
    exists_ = false;
    sync_folder(target_.parent_path());
}

}  // namespace clratio
