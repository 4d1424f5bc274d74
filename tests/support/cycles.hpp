// The real renders of tests/data, as words of the command line, and images made up beside them.
#pragma once

#include <string>

#include "clratio/image.hpp"
#include "support/tool.hpp"

namespace clratio::test {

inline const std::string cycles = CLRATIO_TEST_DATA "/cycles/";

inline Words files(const std::string& scene, const char* kind, int count) {
    Words all;
    for (int k = 0; k < count; ++k) all.push_back(cycles + scene + "/" + kind + "_00" + std::to_string(k % 8) + ".exr");
    return all;
}

inline Words pairs(const std::string& scene, int count) {
    return Words{"combine", "--m"} + files(scene, "m", count) + Words{"--t"} + files(scene, "t", count);
}

inline std::string reference(const std::string& scene, const char* kind) { return cycles + scene + "/" + kind + "_ref.exr"; }

inline Image made(int width, int height, float value) {
    Image image;
    image.channels = {"R", "G", "B"};
    image.data_window = image.display_window = {0, 0, width - 1, height - 1};
    image.values.assign(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), value);
    return image;
}

}  // namespace clratio::test
