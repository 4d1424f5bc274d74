// Scenes as JSON: the four that come with the tool are those of the tests' data, and what is wrong in a file is named.
#include "../tools/clratio/scene.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "../tools/clratio/tool.hpp"
#include "support/scenes.hpp"
#include "support/scratch.hpp"

using namespace clratio;
using clratio::test::Scratch;

namespace {

const std::string good = R"({
  "name": "mine", "title": "Mine", "range": 0.5,
  "medium": {"box": {"lo": [-1, -1, -1], "hi": [1, 1, 1]}, "sigma_t": [1, 2, 3], "sigma_s": [1, 1, 1], "g": 0.1,
             "irradiance": [1, 1, 1], "light": [0, 1, 0.5]},
  "camera": {"eye": [0, 1, -5], "at": [0, 0, 0], "fov_y": 40},
  "boxes": [{"lo": [0, 0, 0], "hi": [1, 1, 1]}, {"lo": [0, 0, 0], "hi": [1, 1, 1]}],
  "spheres": [{"centre": [0, 0, 0], "radius": 1}]
})";

/// `good` with one piece of it replaced.
std::string with(const std::string& old, const std::string& fresh) {
    std::string text = good;
    const auto at = text.find(old);
    EXPECT_NE(at, std::string::npos) << old;
    return text.replace(at, old.size(), fresh);
}

std::string complaint_of(const std::string& text) {
    try {
        tool::scene_of_json(text, "scene.json");
    } catch (const IoError& e) {
        EXPECT_EQ(e.path, "scene.json");
        return e.what();
    }
    return "none";
}

void expect_complaint(const std::string& text, const std::string& words) {
    EXPECT_EQ(complaint_of(text).rfind("scene.json: " + words, 0), 0u) << words << "\nis not how this begins:\n"
                                                                       << complaint_of(text);
}

void expect_same(const Scene& a, const Scene& b) {
    EXPECT_EQ(a.camera.eye, b.camera.eye);
    EXPECT_EQ(a.camera.at, b.camera.at);
    EXPECT_EQ(a.camera.fov_y, b.camera.fov_y);
    EXPECT_EQ(a.medium.box.lo, b.medium.box.lo);
    EXPECT_EQ(a.medium.box.hi, b.medium.box.hi);
    EXPECT_EQ(a.medium.sigma_t, b.medium.sigma_t);
    EXPECT_EQ(a.medium.sigma_s, b.medium.sigma_s);
    EXPECT_EQ(a.medium.g, b.medium.g);
    EXPECT_EQ(a.medium.irradiance, b.medium.irradiance);
    EXPECT_EQ(a.medium.light, b.medium.light);
    ASSERT_EQ(a.boxes.size(), b.boxes.size());
    for (std::size_t i = 0; i < a.boxes.size(); ++i)
        for (std::size_t k = 0; k < 3; ++k) {  // sums such as 1.06 + .08 there
            EXPECT_NEAR(a.boxes[i].lo[k], b.boxes[i].lo[k], 1e-15);
            EXPECT_NEAR(a.boxes[i].hi[k], b.boxes[i].hi[k], 1e-15);
        }
    ASSERT_EQ(a.spheres.size(), b.spheres.size());
    for (std::size_t i = 0; i < a.spheres.size(); ++i) {
        EXPECT_EQ(a.spheres[i].centre, b.spheres[i].centre);
        EXPECT_EQ(a.spheres[i].radius, b.spheres[i].radius);
    }
}

struct Sums {
    int hits = 0;
    Rgb tau{}, mu{};
};

Sums sums_of(const Scene& scene) {
    const ExactImage image = exact_image(scene, {200, 150});
    Sums sums;
    for (std::size_t p = 0; p < image.hit.size(); ++p) {
        sums.hits += image.hit[p];
        for (std::size_t c = 0; c < 3; ++c) {
            sums.tau[c] += image.tau[3 * p + c] / 30000;
            sums.mu[c] += image.mu[3 * p + c] / 30000;
        }
    }
    return sums;
}

/// Half of the eighth decimal, to which the table is rounded.
bool agree(const Sums& a, const Sums& b) {
    bool same = a.hits == b.hits;
    for (std::size_t c = 0; c < 3; ++c)
        same = same && std::abs(a.tau[c] - b.tau[c]) < 0.51e-8 && std::abs(a.mu[c] - b.mu[c]) < 0.51e-8;
    return same;
}

const std::vector<Sums> table{
    {25025, {.19954095, .20040102, .18754980}, {.14523466, .14610943, .13706585}},
    {30000, {1.08266588, 1.03058591, .88193308}, {.13962618, .12908768, .10502027}},
    {20661, {.18284523, .18228779, .17368212}, {.17935388, .17929451, .17162046}},
    {22457, {.17475065, .12352584, .08699202}, {.12477231, .09421624, .07131709}},
};

}  // namespace

TEST(SceneFiles, hold_the_four_scenes) {
    const auto names = tool::scene_names();
    ASSERT_EQ(names, (std::vector<std::string>{"louvres", "window", "spheres", "dense"}));
    for (std::size_t i = 0; i < 4; ++i) expect_same(tool::find_scene(names[i]).scene, test::scenes()[i]);
}

TEST(SceneFiles, have_the_tables_means) {
    for (std::size_t i = 0; i < 4; ++i)
        EXPECT_TRUE(agree(sums_of(tool::find_scene(tool::scene_names()[i]).scene), table[i])) << i;
}

// A slat that is thicker by 1 mm is seen.
TEST(SceneFiles, a_planted_fault_is_seen) {
    auto louvres = tool::find_scene("louvres").scene;
    louvres.boxes[2].hi[1] += 0.001;
    EXPECT_FALSE(agree(sums_of(louvres), table[0]));
}

TEST(SceneFiles, gray_variants_have_one_extinction) {
    const auto gray = tool::find_scene("dense-gray");
    EXPECT_EQ(gray.name, "dense-gray");
    EXPECT_DOUBLE_EQ(gray.scene.medium.sigma_t[0], 14. / 3);
    EXPECT_EQ(gray.scene.medium.sigma_t[0], gray.scene.medium.sigma_t[2]);
    EXPECT_EQ(gray.scene.medium.sigma_s, tool::find_scene("dense").scene.medium.sigma_s);
}

TEST(SceneFiles, are_read_from_disk_and_written_back) {
    const Scratch scratch;
    test::put_bytes(scratch / "mine.json", good);
    const auto mine = tool::find_scene(scratch / "mine.json");
    EXPECT_EQ(mine.name, "mine");
    EXPECT_EQ(mine.range, 0.5);
    const auto again = tool::scene_of_json(tool::json_of(mine), "again");
    EXPECT_EQ(tool::json_of(again), tool::json_of(mine));
    expect_same(again.scene, mine.scene);
    EXPECT_THROW(tool::find_scene(scratch / "none.json"), IoError);
    EXPECT_THROW(tool::find_scene("nowhere"), tool::UsageError);
}

TEST(SceneFiles, faults_are_named_by_their_field) {
    EXPECT_EQ(complaint_of(good), "none");
    expect_complaint(with(R"("hi": [1, 1, 1]}, {"lo": [0, 0, 0], "hi": [1, 1, 1]})",
                          R"("hi": [1, 1, 1]}, {"lo": [0, 0, 0], "hi": ["x", 1, 1]})"),
                     "boxes[1].hi[0]: expected a number, got \"x\"");
    expect_complaint(with("\"radius\": 1", "\"radius\": true"), "spheres[0].radius: expected a number, got true");
    expect_complaint(with("\"radius\": 1", "\"radius\": -1"), "spheres[0].radius: expected a number above 0");
    expect_complaint(with("\"radius\": 1", "\"r\": 1"), "spheres[0].r: no such field; there are centre, radius");
    expect_complaint(with(", \"radius\": 1", ""), "spheres[0].radius: is missing");
    expect_complaint(with("\"light\": [0, 1, 0.5]", "\"light\": [0, 1]"), "medium.light: expected an array of 3 numbers");
    expect_complaint(with("\"light\": [0, 1, 0.5]", "\"light\": [0, 0, 0]"), "medium.light: expected a direction");
    expect_complaint(with("\"fov_y\": 40", "\"fov_y\": 180"), "camera.fov_y: expected degrees");
    expect_complaint(with("\"sigma_t\": [1, 2, 3]", "\"sigma_t\": 1"),
                     "medium.sigma_t: expected an array of 3 numbers, got 1");
    expect_complaint(with("\"hi\": [1, 1, 1]}, \"sigma_t\"", "\"hi\": [1, -2, 1]}, \"sigma_t\""),
                     "medium.box.hi: expected more");
    expect_complaint(with("\"title\"", "\"titel\""), "titel: no such field; there are name, title, range");
    expect_complaint(with("\"Mine\"", "\"\""), "title: expected a text");
    expect_complaint(with("\"mine\"", "\"../mine\""), "name: expected letters, digits, - and _");
    expect_complaint(with("\"range\": 0.5", "\"range\": 0"), "range: expected a number from 1e-6");
    expect_complaint("[]", "the scene: expected an object, got []");
    expect_complaint(with("\"boxes\": [", "\"boxes\": [3, "), "boxes[0]: expected an object, got 3");
    expect_complaint("{\"name\": ", "is no JSON: parse error at line 1, column 10");
    expect_complaint("", "is no JSON");
}
