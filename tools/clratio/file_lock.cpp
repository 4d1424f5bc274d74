#include "file_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "clratio/exception.hpp"
#include "output_target.hpp"

namespace tool {
namespace {

/// Is the file that was opened still the one of this name? Whoever held the lock before may have removed it.
bool still_there(int descriptor, const std::string& name) {
    struct stat opened {
    }, named{};
    return fstat(descriptor, &opened) == 0 && stat(name.c_str(), &named) == 0 && opened.st_ino == named.st_ino &&
           opened.st_dev == named.st_dev;
}

std::string lock_of(const std::string& file) {
    const auto target = std::filesystem::weakly_canonical(file);
    return (target.parent_path() / (clratio::short_name(target) + ".lock")).string();
}

}  // namespace

FileLock::FileLock(const std::string& file) : name_(lock_of(file)) {
    for (;;) {
        descriptor_ = open(name_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
        if (descriptor_ < 0) throw clratio::IoError(file, "", "cannot be locked: " + std::string(std::strerror(errno)));
        const bool locked = flock(descriptor_, LOCK_EX | LOCK_NB) == 0;
        if (locked && still_there(descriptor_, name_)) return;
        const int why = errno;
        close(descriptor_);
        if (!locked && why == EWOULDBLOCK)
            throw clratio::IoError(file, "", "another process works on it (it holds " + name_ + ")");
        if (!locked) throw clratio::IoError(file, "", "cannot be locked: " + std::string(std::strerror(why)));
    }
}

FileLock::~FileLock() {
    unlink(name_.c_str());
    close(descriptor_);
}

}  // namespace tool
