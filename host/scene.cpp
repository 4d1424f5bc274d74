#include "scene.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "vector3.hpp"

namespace clratio {
namespace {

[[noreturn]] void refuse(const std::string& field, const std::string& expected, const std::string& got) {
    throw InvalidArgument("scene: " + field, expected, got);
}

std::string text(const Vector3& v) {
    return "(" + std::to_string(v[0]) + ", " + std::to_string(v[1]) + ", " + std::to_string(v[2]) + ")";
}

template <class Good> void each(const std::string& field, const Vector3& v, const std::string& expected, Good good) {
    for (const double x : v)
        if (!std::isfinite(x) || !good(x)) refuse(field, expected, text(v));
}

void finite(const std::string& field, const Vector3& v) {
    each(field, v, "finite numbers below 1e9", [](double x) { return std::abs(x) < 1e9; });
}

void check_box(const std::string& field, const Box& box) {
    finite(field + ".lo", box.lo);
    finite(field + ".hi", box.hi);
    for (std::size_t k = 0; k < 3; ++k)
        if (!(box.lo[k] < box.hi[k])) refuse(field + ".hi", "more than lo = " + text(box.lo), text(box.hi));
}

void check_medium(const Medium& m) {
    check_box("medium.box", m.box);
    each("medium.sigma_t", m.sigma_t, "numbers from 1e-9 to 1e9", [](double x) { return x >= 1e-9 && x <= 1e9; });
    each("medium.sigma_s", m.sigma_s, "numbers from 0 to 1e9", [](double x) { return x >= 0 && x <= 1e9; });
    each("medium.irradiance", m.irradiance, "numbers from 0 to 1e9", [](double x) { return x >= 0 && x <= 1e9; });
    double most = 0;
    for (std::size_t c = 0; c < 3; ++c) most = std::max(most, m.sigma_s[c] * m.irradiance[c]);
    if (most < 1e-12) refuse("medium.irradiance", "scattered light in some channel", text(m.irradiance));
    if (!(std::abs(m.g) < 1)) refuse("medium.g", "a number in (-1, 1)", std::to_string(m.g));
    finite("medium.light", m.light);
    if (!(std::hypot(m.light[0], m.light[1], m.light[2]) > 1e-9)) refuse("medium.light", "a direction", text(m.light));
}

void check_camera(const Camera& c) {
    finite("camera.eye", c.eye);
    finite("camera.at", c.at);
    if (!(c.fov_y > 0 && c.fov_y < 180)) refuse("camera.fov_y", "degrees in (0, 180)", std::to_string(c.fov_y));
    const Vector3 view = difference(c.at, c.eye);
    if (!(std::hypot(view[0], view[2]) > 1e-9 * std::abs(view[1])))
        refuse("camera.at", "a point away from the eye, and not straight above or below it", text(c.at));
}

template <class Name> struct Named {
    Name value;
    std::string_view name;
};
constexpr std::array<Named<Sampling>, 7> samplings{{{Sampling::uni, "uni"},
                                                    {Sampling::ds, "ds"},
                                                    {Sampling::dsa, "dsa"},
                                                    {Sampling::dsm, "dsm"},
                                                    {Sampling::wvds_mean, "wvds-mean"},
                                                    {Sampling::wvds_min, "wvds-min"},
                                                    {Sampling::wvds_mis, "wvds-mis"}}};
constexpr std::array<Named<Pattern>, 3> patterns{
    {{Pattern::iid, "iid"}, {Pattern::stratified, "stratified"}, {Pattern::offset, "offset"}}};

template <class Table> auto by_name(const Table& table, const char* what, std::string_view name) {
    std::string known;
    for (const auto& entry : table) {
        if (entry.name == name) return entry.value;
        known += (known.empty() ? "" : ", ") + std::string(entry.name);
    }
    throw InvalidArgument(what, "one of " + known, std::string(name));
}

template <class Table, class Value> std::string_view name_in(const Table& table, const char* what, Value value) {
    for (const auto& entry : table)
        if (entry.value == value) return entry.name;
    throw InvalidArgument(what, "one that has a name", std::to_string(static_cast<std::uint32_t>(value)));
}

}  // namespace

std::string_view name_of(Sampling sampling) { return name_in(samplings, "sampling", sampling); }
std::string_view name_of(Pattern pattern) { return name_in(patterns, "pattern", pattern); }
Sampling sampling_of(std::string_view name) { return by_name(samplings, "sampling", name); }
Pattern pattern_of(std::string_view name) { return by_name(patterns, "pattern", name); }

void check_scene(const Scene& scene) {
    check_medium(scene.medium);
    check_camera(scene.camera);
    for (const auto& [name, size] : {std::pair{"spheres", scene.spheres.size()}, {"boxes", scene.boxes.size()}})
        if (size > most_occluders) refuse(name, "at most " + std::to_string(most_occluders), std::to_string(size));
    for (std::size_t i = 0; i < scene.spheres.size(); ++i) {
        const std::string name = "spheres[" + std::to_string(i) + "]";
        const Sphere& s = scene.spheres[i];
        finite(name + ".centre", s.centre);
        if (!(s.radius > 0 && s.radius < 1e9))
            refuse(name + ".radius", "a number above 0 and below 1e9", std::to_string(s.radius));
    }
    for (std::size_t i = 0; i < scene.boxes.size(); ++i) check_box("boxes[" + std::to_string(i) + "]", scene.boxes[i]);
}

std::array<std::size_t, 3> channel_order(const Medium& m) {
    std::array<std::size_t, 3> order{0, 1, 2};
    const auto dark = [&](std::size_t c) { return m.sigma_s[c] * m.irradiance[c] == 0; };
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return dark(a) != dark(b) ? dark(b) : m.sigma_t[a] < m.sigma_t[b];
    });
    return order;
}

Scene gray(Scene scene) {
    auto& sigma = scene.medium.sigma_t;
    sigma.fill((sigma[0] + sigma[1] + sigma[2]) / 3);
    return scene;
}

CameraAxes axes_of(const Camera& camera, Frame frame) {
    const Vector3 forward = unit(difference(camera.at, camera.eye));
    const Vector3 right = unit(cross(forward, {0, 1, 0}));
    const double reach = std::tan(camera.fov_y * std::numbers::pi / 360);
    return {forward, times(right, reach * frame.width / frame.height), times(cross(right, forward), reach)};
}

void check_frame(Frame frame) {
    if (frame.width < 1 || frame.height < 1 || frame.width > 65536 || frame.height > 65536 ||
        std::uint64_t{frame.width} * frame.height >= 1ull << 31)
        throw InvalidArgument("frame", "1 to 65536 columns and rows, below 2^31 pixels",
                              std::to_string(frame.width) + " x " + std::to_string(frame.height));
}

Ray camera_ray(const Camera& camera, Frame frame, std::uint32_t x, std::uint32_t y) {
    check_frame(frame);
    const CameraAxes axes = axes_of(camera, frame);
    const double a = 2 * (x + 0.5) / frame.width - 1, b = 1 - 2 * (y + 0.5) / frame.height;
    Vector3 w = axes.forward;
    for (std::size_t k = 0; k < 3; ++k) w[k] += a * axes.right[k] + b * axes.up[k];
    return {camera.eye, unit(w)};
}

ExactImage exact_image(const Scene& scene, Frame frame) {
    check_frame(frame);
    ExactImage image{frame, {}, {}, {}};
    for (std::uint32_t y = 0; y < frame.height; ++y)
        for (std::uint32_t x = 0; x < frame.width; ++x) {
            const Sightline line(scene, camera_ray(scene.camera, frame, x, y));
            const Rgb tau = line.tau(), mu = line.mu();
            image.tau.insert(image.tau.end(), tau.begin(), tau.end());
            image.mu.insert(image.mu.end(), mu.begin(), mu.end());
            image.hit.push_back(line.hit());
        }
    return image;
}

}  // namespace clratio
