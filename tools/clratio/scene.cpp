#include "scene.hpp"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <iterator>

#include "scene_files.hpp"
#include "tool.hpp"

namespace tool {
namespace {

/// What is wrong with a scene, before the file is known.
class Refused : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

[[noreturn]] void refuse(const std::string& field, const std::string& expected, const Json& got) {
    std::string text = got.dump();
    if (text.size() > 40) text = text.substr(0, 37) + "...";
    throw Refused(fmt::format("{}: expected {}, got {}", field, expected, text));
}

/// A value and where it stands in the file: "boxes[2].hi[0]".
struct Field {
    const Json& value;
    std::string name;

    Field operator[](const char* key) const {
        if (!value.contains(key)) throw Refused(child(key) + ": is missing");
        return {value.at(key), child(key)};
    }
    Field at(std::size_t i) const { return {value.at(i), fmt::format("{}[{}]", name, i)}; }

    /// An object with no fields but these.
    const Field& object(std::initializer_list<const char*> fields) const {
        if (!value.is_object()) refuse(name.empty() ? "the scene" : name, "an object", value);
        for (const auto& entry : value.items())
            if (std::none_of(fields.begin(), fields.end(), [&](const char* f) { return entry.key() == f; }))
                throw Refused(fmt::format("{}: no such field; there are {}", child(entry.key()), fmt::join(fields, ", ")));
        return *this;
    }
    double number() const {
        if (!value.is_number()) refuse(name, "a number", value);
        return value.get<double>();
    }
    clratio::Vector3 triple() const {
        if (!value.is_array() || value.size() != 3) refuse(name, "an array of 3 numbers", value);
        return {at(0).number(), at(1).number(), at(2).number()};
    }
    std::string text() const {
        if (!value.is_string() || value.get<std::string>().empty()) refuse(name, "a text", value);
        return value.get<std::string>();
    }

private:
    std::string child(const std::string& key) const { return name.empty() ? key : name + "." + key; }
};

template <class Read> auto each(const Field& object, const char* key, Read read) {
    std::vector<decltype(read(object))> out;
    if (!object.value.contains(key)) return out;
    const Field list = object[key];
    if (!list.value.is_array()) refuse(list.name, "an array", list.value);
    for (std::size_t i = 0; i < list.value.size(); ++i) out.push_back(read(list.at(i)));
    return out;
}

clratio::Box box_of(const Field& f) {
    f.object({"lo", "hi"});
    return {f["lo"].triple(), f["hi"].triple()};
}

clratio::Sphere sphere_of(const Field& f) {
    f.object({"centre", "radius"});
    return {f["centre"].triple(), f["radius"].number()};
}

clratio::Medium medium_of(const Field& f) {
    f.object({"box", "sigma_t", "sigma_s", "g", "irradiance", "light"});
    return {box_of(f["box"]), f["sigma_t"].triple(),    f["sigma_s"].triple(),
            f["g"].number(),  f["irradiance"].triple(), f["light"].triple()};
}

clratio::Camera camera_of(const Field& f) {
    f.object({"eye", "at", "fov_y"});
    return {f["eye"].triple(), f["at"].triple(), f["fov_y"].number()};
}

std::string checked_name(const Field& f) {
    const std::string name = f.text();
    if (!std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) || c == '-' || c == '_'; }))
        refuse(f.name, "letters, digits, - and _", f.value);
    return name;
}

double checked_range(const Field& f) {
    if (!(f.number() >= 1e-6 && f.number() <= 1e6)) refuse(f.name, "a number from 1e-6 to 1e6", f.value);
    return f.number();
}

NamedScene read(const Json& json) {
    const Field root{json, ""};
    root.object({"name", "title", "range", "medium", "camera", "spheres", "boxes"});
    NamedScene out{checked_name(root["name"]),
                   root["title"].text(),
                   checked_range(root["range"]),
                   {medium_of(root["medium"]), camera_of(root["camera"]), each(root, "spheres", sphere_of),
                    each(root, "boxes", box_of)}};
    clratio::check_scene(out.scene);
    return out;
}

std::string without(const std::string& text, const std::string& prefix) {
    return text.rfind(prefix, 0) == 0 ? text.substr(prefix.size()) : text;
}

/// nlohmann's sentence without its own error number.
std::string parse_error_of(const std::string& what) {
    const auto end = what.find("] ");
    return "is no JSON: " + (end == std::string::npos ? what : what.substr(end + 2));
}

std::string text_of_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in) throw clratio::IoError(path, "", "cannot be read");
    return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

bool ends_with(const std::string& text, const std::string& end) {
    return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

NamedScene scene_of_json(const std::string& text, const std::string& path) {
    try {
        return read(Json::parse(text));
    } catch (const Json::exception& e) {
        throw clratio::IoError(path, "", parse_error_of(e.what()));
    } catch (const Refused& e) {
        throw clratio::IoError(path, "", e.what());
    } catch (const clratio::InvalidArgument& e) {
        throw clratio::IoError(path, "", without(e.what(), "scene: "));
    }
}

std::string json_of(const NamedScene& s) {
    const auto& m = s.scene.medium;
    const auto box = [](const clratio::Box& b) { return Json{{"lo", b.lo}, {"hi", b.hi}}; };
    Json out{{"name", s.name},
             {"title", s.title},
             {"range", s.range},
             {"medium",
              {{"box", box(m.box)},
               {"sigma_t", m.sigma_t},
               {"sigma_s", m.sigma_s},
               {"g", m.g},
               {"irradiance", m.irradiance},
               {"light", m.light}}},
             {"camera", {{"eye", s.scene.camera.eye}, {"at", s.scene.camera.at}, {"fov_y", s.scene.camera.fov_y}}},
             {"spheres", Json::array()},
             {"boxes", Json::array()}};
    for (const auto& sphere : s.scene.spheres)
        out["spheres"].push_back({{"centre", sphere.centre}, {"radius", sphere.radius}});
    for (const auto& b : s.scene.boxes) out["boxes"].push_back(box(b));
    return out.dump();
}

std::vector<std::string> scene_names() {
    std::vector<std::string> names;
    for (const auto& file : scene_files) names.emplace_back(file.name);
    return names;
}

NamedScene gray(NamedScene scene) {
    if (ends_with(scene.name, "-gray")) return scene;
    scene.name += "-gray";
    scene.title += ", gray";
    scene.scene = clratio::gray(scene.scene);
    return scene;
}

NamedScene find_scene(const std::string& name) {
    if (ends_with(name, ".json")) return scene_of_json(text_of_file(name), name);
    if (ends_with(name, "-gray")) return gray(find_scene(name.substr(0, name.size() - 5)));
    for (const auto& file : scene_files)
        if (name == file.name) return scene_of_json(file.text, name);
    throw UsageError(fmt::format("{}: no such scene; there are {}, each with -gray behind it too, and files .json", name,
                                 fmt::join(scene_names(), ", ")));
}

}  // namespace tool
