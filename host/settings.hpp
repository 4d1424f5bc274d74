// The settings of a state, as text and in errors. Private to the library.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace clratio {

using Settings = std::vector<std::pair<std::string, std::string>>;

inline std::string text_of(const Settings& settings) {
    std::string all;
    for (const auto& [name, value] : settings) all += (all.empty() ? "" : " ") + name + "=" + value;
    return all.empty() ? "none" : all;
}

}  // namespace clratio
