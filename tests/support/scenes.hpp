// The four scenes of tests/data/medium_vectors.json, and its cases of one ray each.
#pragma once

#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "clratio/medium.hpp"

namespace clratio::test {

inline const nlohmann::json& medium_vectors() {
    static const auto all = nlohmann::json::parse(std::ifstream(std::string(CLRATIO_TEST_DATA) + "/medium_vectors.json"));
    return all;
}

inline void add_occluders(Scene& scene, const nlohmann::json& occluders) {
    for (const auto& o : occluders)
        if (o.at("type") == "sphere")
            scene.spheres.push_back({o.at("c"), o.at("r")});
        else
            scene.boxes.push_back({o.at("lo"), o.at("hi")});
}

inline Scene scene_of(const nlohmann::json& j) {
    Scene scene;
    scene.medium = {{j.at("bmin"), j.at("bmax")}, j.at("sigma_t"), j.at("sigma_s"), j.at("g"), j.at("L"), j.at("light")};
    scene.camera = {j.at("eye"), j.at("at"), j.at("fov_y")};
    add_occluders(scene, j.at("occ"));
    return scene;
}

/// S1 louvres, S2 window, S3 spheres, S4 dense: index 0 to 3.
inline std::vector<Scene> scenes() {
    std::vector<Scene> out;
    for (const auto& j : medium_vectors().at("scenes")) out.push_back(scene_of(j));
    return out;
}

/// Isotropic with strength 1: tau is the integral of exp(-sigma_t phi) alone.
inline Scene case_scene(const nlohmann::json& j) {
    Scene scene;
    const double full = 4 * std::numbers::pi;
    scene.medium = {{j.at("bmin"), j.at("bmax")}, j.at("sigma_t"), {1, 1, 1}, 0, {full, full, full}, j.at("light")};
    scene.camera = {{0, 0, 0}, {0, 0, 1}, 40};
    add_occluders(scene, j.at("occ"));
    return scene;
}

}  // namespace clratio::test
