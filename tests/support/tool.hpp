// The command line, run as a user runs it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "support/run.hpp"

namespace clratio::test {

using nlohmann::json;
using Words = std::vector<std::string>;

inline Words operator+(Words a, const Words& b) {
    a.insert(a.end(), b.begin(), b.end());
    return a;
}

inline Said clratio_tool(const Words& words, const Surroundings& around = {}) { return run(CLRATIO_TOOL, words, around); }

/// The JSON of a run without an error; nothing may stand on stderr.
inline json answer(const Words& words) {
    const Said said = clratio_tool(words + Words{"--json"});
    EXPECT_EQ(said.code, 0) << said.err;
    EXPECT_EQ(said.err, "");
    return json::parse(said.out, nullptr, false);
}

inline void expect_in(const std::string& part, const std::string& text) {
    EXPECT_NE(text.find(part), std::string::npos) << "'" << part << "' is not in: " << text;
}

/// The named exit code, `part` in one line on stderr, nothing on stdout.
inline void expect_refused(const Words& words, int code, const std::string& part, const Surroundings& around = {}) {
    const Said said = clratio_tool(words, around);
    EXPECT_EQ(said.code, code) << said.err;
    EXPECT_EQ(said.out, "");
    expect_in(part, said.err);
    EXPECT_EQ(std::count(said.err.begin(), said.err.end(), '\n'), 1) << said.err;
    EXPECT_EQ(said.err.rfind("clratio: ", 0), 0u) << said.err;
}

}  // namespace clratio::test
