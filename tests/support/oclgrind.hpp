// Runs one of the test programs under oclgrind, which sees out-of-bounds accesses, races and uninitialised values.
// Unoptimised: its interpreter lacks some of what LLVM 14 makes of optimised code (freeze, noalias scopes).
#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <string>

namespace clratio::test {

struct OclgrindReport {
    int status = 0;
    std::string output;
    int complaints() const {
        int n = 0;
        for (const char* word : {"Invalid ", "Uninitialized ", "data race", "Error occurred", "OCLGRIND FATAL"})
            for (auto at = output.find(word); at != std::string::npos; at = output.find(word, at + 1)) ++n;
        return n;
    }
};

/// Nothing where oclgrind is not installed.
inline std::optional<OclgrindReport> under_oclgrind(const std::string& program, const std::string& filter,
                                                    const std::string& flags = "") {
    if (std::system("command -v oclgrind >/dev/null 2>&1") != 0) return std::nullopt;
    const std::string command =
        "env -u CLRATIO_DEVICE oclgrind --build-options -cl-opt-disable --check-api --data-races --uninitialized '" +
        std::string(CLRATIO_BINARY) + "/tests/" + program + "' '--gtest_filter=" + filter + "' " + flags + " 2>&1";
    OclgrindReport report;
    FILE* pipe = popen(command.c_str(), "r");
    if (!pipe) return std::nullopt;
    std::array<char, 4096> buffer{};
    while (const std::size_t n = std::fread(buffer.data(), 1, buffer.size(), pipe)) report.output.append(buffer.data(), n);
    const int status = pclose(pipe);
    report.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return report;
}

/// The one test that `filter` names runs there, and oclgrind finds nothing.
inline void expect_clean_under_oclgrind(const std::string& program, const std::string& filter) {
    const auto report = under_oclgrind(program, filter);
    if (!report) GTEST_SKIP() << "oclgrind is not installed (Debian: apt install oclgrind)";
    EXPECT_EQ(report->status, 0) << report->output;
    EXPECT_EQ(report->complaints(), 0) << report->output;
    EXPECT_NE(report->output.find("[  PASSED  ] 1 test."), std::string::npos) << report->output;
}

}  // namespace clratio::test
