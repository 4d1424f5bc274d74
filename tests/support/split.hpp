// Text cut into lines, lines into cells.
#pragma once

#include <sstream>
#include <string>
#include <vector>

namespace clratio::test {

/// The parts between separators. A last one that is empty counts in a row of cells, not at the end of lines.
inline std::vector<std::string> split(const std::string& text, char by) {
    std::vector<std::string> parts;
    std::istringstream in(text);
    for (std::string part; std::getline(in, part, by);) parts.push_back(part);
    if (by == ',' && text.ends_with(',')) parts.emplace_back();
    return parts;
}

}  // namespace clratio::test
