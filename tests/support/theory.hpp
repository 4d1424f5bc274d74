// tests/data/theory_vectors.json: numbers of 40-digit arithmetic, rounded to double.
#pragma once

#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "clratio/error.hpp"

namespace clratio::test {

inline const nlohmann::json& theory(const std::string& group) {
    static const auto all = nlohmann::json::parse(std::ifstream(std::string(CLRATIO_TEST_DATA) + "/theory_vectors.json"));
    return all.at(group);
}

inline ErrorModel model_of(const nlohmann::json& v) { return {v["mu"], v["tau"], v["sm"], v["st"], v["rho"]}; }

inline std::string text(const ErrorModel& e) {
    return nlohmann::json{{"mu", e.mu}, {"tau", e.tau}, {"sm", e.sigma_m}, {"st", e.sigma_t}, {"rho", e.rho}, {"n", e.n}}
        .dump();
}

}  // namespace clratio::test
