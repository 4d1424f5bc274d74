// The text of tools/scenes/*.json.
#pragma once

#include <array>

namespace tool {

struct SceneFile {
    const char *name, *text;
};
extern const std::array<SceneFile, 4> scene_files;

}  // namespace tool
