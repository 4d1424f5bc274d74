#include "clratio/medium.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/refused.hpp"
#include "support/scenes.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

constexpr double vector_tolerance = 1e-12;

void near_in_units(double got, double want, double unit, const std::string& what) {
    EXPECT_NEAR(got, want, vector_tolerance * unit) << what;
}

Sightline case_line(const nlohmann::json& j) { return Sightline(case_scene(j), {j.at("origin"), j.at("dir")}); }

}  // namespace

TEST(Medium, exact_integrals_are_the_vectors) {
    for (const auto& j : medium_vectors().at("cases")) {
        const Sightline line = case_line(j);
        const std::string what = "case " + j.at("id").dump();
        ASSERT_TRUE(line.hit()) << what;
        const double far = std::max(1.0, j.at("s1").get<double>());
        near_in_units(line.enter(), j.at("s0"), far, what + " s0");
        near_in_units(line.leave(), j.at("s1"), far, what + " s1");
        EXPECT_EQ(line.stopped(), j.at("opaque_hit").get<bool>()) << what;
        for (std::size_t c = 0; c < 3; ++c) {
            const double tau = j.at("A_unoccluded")[c];
            near_in_units(line.tau()[c], tau, tau, what + " tau");
            near_in_units(line.mu()[c], j.at("B_occluded")[c], tau, what + " mu");
        }
    }
}

TEST(Medium, bends_and_shadows_are_the_vectors) {
    for (const auto& j : medium_vectors().at("cases")) {
        const Sightline line = case_line(j);
        const std::string what = "case " + j.at("id").dump();
        auto lit = line.lit();
        std::erase_if(lit, [](const Stretch& i) { return i.hi - i.lo < 10 * vector_tolerance; });  // what rounding leaves
        ASSERT_EQ(lit.size(), j.at("lit_intervals").size()) << what;
        for (std::size_t i = 0; i < lit.size(); ++i) {
            near_in_units(lit[i].lo, j.at("lit_intervals")[i][0], 10, what + " lit");
            near_in_units(lit[i].hi, j.at("lit_intervals")[i][1], 10, what + " lit");
        }
        const auto& breaks = j.at("d_breakpoints");
        const auto& distances = j.at("d_at_knots");
        for (std::size_t i = 0; i < breaks.size(); ++i) {
            const double s = breaks[i];
            near_in_units(line.exit_distance(s), distances[i + 1], std::max(1.0, distances[i + 1].get<double>()), what);
            double nearest = 1e9;
            for (const double b : line.breaks()) nearest = std::min(nearest, std::abs(b - s));
            EXPECT_LE(nearest, 10 * vector_tolerance) << what;
        }
    }
}

TEST(Medium, inverse_distributions_are_the_vectors) {
    for (const auto& j : medium_vectors().at("cases")) {
        const Sightline line = case_line(j);
        const std::string what = "case " + j.at("id").dump();
        for (std::size_t i = 0; i < j.at("xi").size(); ++i) {
            const double u = j.at("xi")[i], far = std::max(1.0, j.at("s1").get<double>());
            near_in_units(line.distance(Sampling::wvds_mean, u), j.at("wvds_s")[i], far, what + " wvds");
            near_in_units(line.distance(Sampling::ds, u), j.at("ds_truncated_s")[i], far, what + " ds");
        }
    }
}

TEST(Medium, second_moments_are_the_vectors) {
    int checked = 0;
    for (const auto& j : medium_vectors().at("cases")) {
        if (!j.contains("moments_channel1")) continue;
        const Sightline line = case_line(j);
        for (const auto& [name, sampling] :
             {std::pair{"uniform", Sampling::uni}, {"ds", Sampling::ds}, {"wvds", Sampling::wvds_mean}}) {
            const auto& want = j.at("moments_channel1").at(name);
            const SecondMoments got = line.second_moments(sampling);
            const std::string what = "case " + j.at("id").dump() + " " + name;
            near_in_units(got.tt[1], want.at("t2"), want.at("t2"), what);
            near_in_units(got.mm[1], want.at("m2"), want.at("t2"), what);
            ++checked;
        }
    }
    EXPECT_GT(checked, 10);
}

TEST(Medium, scenes_have_the_vectors_sums_and_pixels) {
    const auto& sums = medium_vectors().at("scene_sums_200x150");
    for (std::size_t i = 0; i < 4; ++i) {
        const ExactImage image = exact_image(scenes()[i], {});
        std::size_t hits = 0, lit = 0, dark = 0;
        Rgb tau{}, mu{};
        for (std::size_t p = 0; p < image.hit.size(); ++p) {
            bool full = true, none = true;
            for (std::size_t c = 0; c < 3; ++c) {
                tau[c] += image.tau[3 * p + c];
                mu[c] += image.mu[3 * p + c];
                full = full && std::abs(image.mu[3 * p + c] / image.tau[3 * p + c] - 1) < 1e-12;
                none = none && image.mu[3 * p + c] <= 1e-12 * image.tau[3 * p + c];
            }
            hits += image.hit[p];
            lit += image.hit[p] && full;
            dark += image.hit[p] && none;
        }
        const auto count = static_cast<double>(image.hit.size()), rays = static_cast<double>(hits);
        EXPECT_EQ(hits, sums[i].at("rays_hitting").get<std::size_t>());
        EXPECT_NEAR(static_cast<double>(lit) / rays, sums[i].at("fully_lit").get<double>(), 1e-9);
        EXPECT_NEAR(static_cast<double>(dark) / rays, sums[i].at("dark").get<double>(), 1e-9);
        for (std::size_t c = 0; c < 3; ++c) {
            near_in_units(tau[c] / count, sums[i].at("mean_tau")[c], 1, "mean tau");
            near_in_units(mu[c] / count, sums[i].at("mean_mu")[c], 1, "mean mu");
        }
    }
    for (const auto& j : medium_vectors().at("probes_200x150")) {
        const std::string name = j.at("scene");
        const Scene scene = scenes()[static_cast<std::size_t>(name[1] - '1')];
        const Ray ray = camera_ray(scene.camera, {}, j.at("px"), j.at("py"));
        const Sightline line(scene, ray);
        ASSERT_EQ(line.hit(), j.at("hit").get<bool>()) << name;
        for (std::size_t c = 0; c < 3; ++c) {
            near_in_units(ray.direction[c], j.at("w")[c], 1, name);
            near_in_units(line.tau()[c], j.at("tau")[c], 1, name);
            near_in_units(line.mu()[c], j.at("mu")[c], 1, name);
        }
        if (!line.hit()) continue;
        near_in_units(line.enter(), j.at("s0"), 10, name);
        near_in_units(line.leave(), j.at("s1"), 10, name);
    }
}

TEST(Medium, a_gray_scene_has_the_mean_extinction) {
    const Scene scene = gray(scenes()[3]);
    for (const double s : scene.medium.sigma_t) EXPECT_DOUBLE_EQ(s, 14.0 / 3);
    EXPECT_EQ(scene.medium.sigma_s, scenes()[3].medium.sigma_s);
}

TEST(Medium, names_go_there_and_back) {
    for (const Sampling s : all_samplings) EXPECT_EQ(sampling_of(name_of(s)), s);
    for (const Pattern p : {Pattern::iid, Pattern::stratified, Pattern::offset}) EXPECT_EQ(pattern_of(name_of(p)), p);
    refused([] { sampling_of("wvds"); }, "wvds-mis");
    refused([] { pattern_of("sobol"); }, "stratified");
}

TEST(Medium, predictions_are_their_formulas) {
    // One sample that is 3 with probability 1/2, half of these lit: mu = .75, tau = 1.5, E[m^2] = 2.25, E[t^2] = 4.5.
    const Prediction p = predict(.75, 1.5, 2.25, 4.5, 2);
    EXPECT_DOUBLE_EQ(p.plain_mse, (2.25 - .5625) / 2);
    EXPECT_DOUBLE_EQ(p.ratio_mse, .25 * 4.5 / 2);
    EXPECT_DOUBLE_EQ(p.ratio_bias, 0);
    EXPECT_DOUBLE_EQ(p.independent_mse, (1.6875 + .25 * 2.25) / 2);
    EXPECT_DOUBLE_EQ(p.independent_bias, .5 * 2.25 / (2 * 1.5));
    EXPECT_EQ(predict(0, 0, 0, 0, 1).ratio_bias, 0);
}

TEST(Medium, rays_that_miss_have_no_answer) {
    const Sightline line(scenes()[2], {{0, 0, -9}, {0, 1, 0}});
    EXPECT_FALSE(line.hit());
    EXPECT_EQ(line.tau(), (Rgb{}));
    EXPECT_EQ(line.second_moments(Sampling::wvds_mis).mm, (Rgb{}));
    refused([] { Sightline(scenes()[2], {{0, 0, -9}, {0, 0, 0}}); }, "ray");
}

TEST(Medium, bad_scenes_are_refused_by_field) {
    const double nan = std::nan("");
    const auto refuse = [](const std::string& field, auto change) {
        Scene scene = scenes()[3];
        change(scene);
        refused([&] { check_scene(scene); }, "scene: " + field);
    };
    refuse("medium.box.hi", [](Scene& s) { s.medium.box.hi[1] = s.medium.box.lo[1]; });
    refuse("medium.box.lo", [=](Scene& s) { s.medium.box.lo[0] = nan; });
    refuse("medium.sigma_t", [](Scene& s) { s.medium.sigma_t[2] = 0; });
    refuse("medium.sigma_s", [](Scene& s) { s.medium.sigma_s[0] = -1; });
    refuse("medium.irradiance", [](Scene& s) { s.medium.irradiance = {0, 0, 0}; });
    refuse("medium.irradiance", [=](Scene& s) { s.medium.irradiance[1] = nan; });
    refuse("medium.g", [](Scene& s) { s.medium.g = 1; });
    refuse("medium.light", [](Scene& s) { s.medium.light = {0, 0, 0}; });
    refuse("camera.eye", [](Scene& s) { s.camera.eye[0] = INFINITY; });
    refuse("camera.at", [](Scene& s) { s.camera.at = s.camera.eye; });
    refuse("camera.at", [](Scene& s) { s.camera.at = {s.camera.eye[0], 5, s.camera.eye[2]}; });
    refuse("camera.fov_y", [](Scene& s) { s.camera.fov_y = 180; });
    refuse("spheres[0].radius", [](Scene& s) { s.spheres[0].radius = 0; });
    refuse("spheres[0].centre", [=](Scene& s) { s.spheres[0].centre[2] = nan; });
    refuse("boxes[0].hi", [](Scene& s) { s.boxes[0].hi[0] = -5; });
    refuse("spheres", [](Scene& s) { s.spheres.resize(257, {{0, 0, 0}, 1}); });
    for (const Scene& good : scenes()) EXPECT_NO_THROW(check_scene(good));
    refused([] { exact_image(scenes()[0], {70000, 1}); }, "frame");
}

// The oracle of the vectors can fail: a brighter sun, a bent ray.
TEST(Medium, the_vectors_catch_planted_faults) {
    const auto& j = medium_vectors().at("cases")[0];
    const double tau = j.at("A_unoccluded")[1];
    Scene bright = case_scene(j);
    bright.medium.irradiance[1] *= 1 + 1e-11;
    EXPECT_GT(std::abs(Sightline(bright, {j.at("origin"), j.at("dir")}).tau()[1] / tau - 1), vector_tolerance);
    Vector3 bent = j.at("dir");
    bent[0] += 1e-11;
    EXPECT_GT(std::abs(Sightline(case_scene(j), {j.at("origin"), bent}).tau()[1] / tau - 1), vector_tolerance);
}
