// Scenes as JSON: files of the user's, and the four that come with the tool.
#pragma once

#include <string>
#include <vector>

#include "clratio/medium.hpp"

namespace tool {

struct NamedScene {
    std::string name;   ///< letters, digits, "-" and "_": part of files' names
    std::string title;  ///< for people
    double range = 0;   ///< errors are counted in bins on [-range, range)
    clratio::Scene scene;
};

/// Errors: IoError with `path` and the field: "scene.json: boxes[2].hi[0]: expected a number, got \"x\"". Fields that are
/// not known are refused.
NamedScene scene_of_json(const std::string& text, const std::string& path);

/// The text that scene_of_json() reads as the same scene, bit for bit.
std::string json_of(const NamedScene& scene);

/// louvres, window, spheres, dense.
std::vector<std::string> scene_names();

/// The medium with each sigma_t replaced by their mean; "-gray" is added to the name.
NamedScene gray(NamedScene scene);

/// A scene that comes with the tool by its name, its gray variant (NAME-gray), or a file whose name ends in .json.
/// Errors: UsageError for an unknown name, and those of scene_of_json().
NamedScene find_scene(const std::string& name_or_file);

}  // namespace tool
