// A disk that is full, made with a limit on the size of files.
#pragma once

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <string>

#include "clratio/exception.hpp"

namespace clratio::test {

enum class Ended { wrote = 0, refused = 1, other = 2 };

/// Calls `write` in a child process whose files may not grow beyond `limit` bytes, as on a full disk.
template <class Write> inline Ended limited(std::size_t limit, const std::string& path, Write write) {
    const pid_t child = fork();
    if (child == 0) {
        std::signal(SIGXFSZ, SIG_IGN);
        const rlimit r{limit, limit};
        setrlimit(RLIMIT_FSIZE, &r);
        try {
            write();
            _exit(static_cast<int>(Ended::wrote));
        } catch (const IoError& e) {
            const bool named = e.path == path && e.reason.find("File too large") != std::string::npos;
            _exit(static_cast<int>(named ? Ended::refused : Ended::other));
        } catch (...) {
            _exit(static_cast<int>(Ended::other));
        }
    }
    int status = 0;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? static_cast<Ended>(WEXITSTATUS(status)) : Ended::other;
}

}  // namespace clratio::test
