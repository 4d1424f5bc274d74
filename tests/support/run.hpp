// Runs a program as a shell would, and keeps what it said.
#pragma once

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "support/scratch.hpp"

namespace clratio::test {

struct Said {
    int code = -1;  ///< exit code, or 128 + signal
    std::string out, err;
    bool killed = false;  ///< by a signal that it did not handle
};

struct Surroundings {
    std::vector<std::pair<std::string, std::string>> environment{};
    std::optional<std::size_t> file_size_limit{};
    std::string out{};  ///< where stdout goes instead of Said::out
    int signal = 0;     ///< sent when `wait` comes back
    std::function<void()> wait{};
};

inline Said run(const std::string& program, const std::vector<std::string>& arguments, const Surroundings& around = {}) {
    const Scratch scratch;
    const std::string out = around.out.empty() ? scratch / "out" : around.out, err = scratch / "err";
    std::vector<char*> argv{const_cast<char*>(program.c_str())};
    for (const auto& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
    argv.push_back(nullptr);
    const pid_t child = fork();
    if (child == 0) {
        dup2(open(out.c_str(), O_WRONLY | O_CREAT, 0600), STDOUT_FILENO);
        dup2(open(err.c_str(), O_WRONLY | O_CREAT, 0600), STDERR_FILENO);
        for (const auto& [name, value] : around.environment) setenv(name.c_str(), value.c_str(), 1);
        if (around.file_size_limit) {
            const rlimit limit{*around.file_size_limit, *around.file_size_limit};
            setrlimit(RLIMIT_FSIZE, &limit);
        }
        execv(program.c_str(), argv.data());
        _exit(127);
    }
    if (around.signal != 0) {
        around.wait();
        kill(child, around.signal);
    }
    int status = 0;
    waitpid(child, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), around.out.empty() ? bytes_of(out) : "",
            bytes_of(err), WIFSIGNALED(status)};
}

}  // namespace clratio::test
