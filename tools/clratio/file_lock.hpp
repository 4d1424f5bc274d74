// One process at a time.
#pragma once

#include <string>

namespace tool {

/// Holds `file`.lock, which goes with it, and which the system lets go of when the process dies. IoError that names `file`
/// where another process holds it.
class FileLock {
public:
    explicit FileLock(const std::string& file);
    ~FileLock();
    FileLock(const FileLock&) = delete;
    FileLock& operator=(const FileLock&) = delete;

private:
    std::string name_;
    int descriptor_ = -1;
};

}  // namespace tool
