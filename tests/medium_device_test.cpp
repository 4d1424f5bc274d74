// The estimators of a scene on the device: against the exact answers, and bit for bit against the host.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "clratio/medium.hpp"
#include "embedded.hpp"
#include "medium_state.hpp"
#include "support/oclgrind.hpp"
#include "support/raw_kernel.hpp"
#include "support/refused.hpp"
#include "support/samples.hpp"
#include "support/scenes.hpp"
#include "support/shapes.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

const Engine& engine() {
    static const Engine e;
    return e;
}

bool same_bits(std::span<const float> a, std::span<const float> b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

/// Pixels of a frame, all of them or every `step`th, whose host twin is not the device's image, m or t.
std::size_t unlike_the_host(const MediumScene& scene, const Sampler& sampler, const Stream& stream, std::uint32_t samples,
                            const RenderedImages& got, std::uint32_t step = 1) {
    const Frame f = scene.frame();
    std::size_t unlike = 0;
    for (std::uint32_t p = 0; p < f.width * f.height; p += step) {
        const RenderedPixel want = render_pixel(scene, sampler, stream, samples, p % f.width, p / f.width);
        unlike +=
            !same_bits(want.m, std::span(got.m).subspan(3 * p, 3)) || !same_bits(want.t, std::span(got.t).subspan(3 * p, 3));
    }
    return unlike;
}

std::vector<Sampler> all_samplers() {
    std::vector<Sampler> out;
    for (const Sampling s : all_samplings) out.push_back({s, Pattern::iid, false});
    for (const Pattern p : {Pattern::stratified, Pattern::offset})
        for (const Sampling s : {Sampling::uni, Sampling::ds, Sampling::wvds_mis}) out.push_back({s, p, false});
    out.push_back({Sampling::wvds_mis, Pattern::iid, true});
    return out;
}

std::string text(const Sampler& s) {
    return std::string(name_of(s.sampling)) + " " + std::string(name_of(s.pattern)) + (s.independent ? " independent" : "");
}

/// The device's tau is within the stated error of the exact one in all pixels.
bool tau_is_exact(const std::vector<float>& tau, const ExactImage& exact) {
    std::vector<double> relative;
    for (std::size_t i = 0; i < tau.size(); ++i) {
        const double error = std::abs(static_cast<double>(tau[i]) - exact.tau[i]);
        if (!(error <= 4e-6)) return false;
        if (exact.hit[i / 3]) relative.push_back(error / exact.tau[i]);
    }
    std::sort(relative.begin(), relative.end());
    return relative[relative.size() / 2] <= 3e-7 && relative[relative.size() * 99 / 100] <= 1e-5;
}

/// A kernel of changed source over all rows of a scene.
class Changed {
public:
    Changed(const MediumScene& scene, const std::string& source, Sampling sampling)
        : scene_(scene), source_(source), options_("-DCLR_GENERATOR=CLR_PHILOX -DCLR_INDEPENDENT_T=0 -DCLR_SAMPLING=" +
                                                   std::to_string(static_cast<std::uint32_t>(sampling)) + "u") {}

    std::vector<float> tau() const {
        const Buffer out(engine(), scene_.values() * sizeof(float));
        RawKernel(engine(), source_, "clr_medium_exact", options_)
            .arg(out)
            .arg(device::clr_layout{0, 1, 1})
            .arg(scene_.state().device)
            .arg(scene_.state().occluder_buffer)
            .arg(scene_.state().share_buffer)
            .arg(cl_uint{0})
            .arg(cl_uint{0})
            .arg(range())
            .run(1, 1);
        return contents<float>(out);
    }

    RenderedImages image(std::uint32_t samples) const {
        const Buffer m(engine(), scene_.values() * sizeof(float)), t(engine(), scene_.values() * sizeof(float));
        RawKernel(engine(), source_, "clr_medium_render", options_)
            .arg(m)
            .arg(device::clr_layout{0, 1, 1})
            .arg(t)
            .arg(device::clr_layout{0, 1, 1})
            .arg(scene_.state().device)
            .arg(scene_.state().occluder_buffer)
            .arg(device::clr_stream{1, 0, CLR_DOMAIN_SCENE})
            .arg(device::clr_sampler{CLR_IID, 0, samples, 1 / static_cast<float>(samples)})
            .arg(cl_uint{0})
            .arg(cl_uint{0})
            .arg(cl_ulong{scene_.values() / 3})
            .arg(range())
            .run(1, 1);
        return {contents<float>(m), contents<float>(t)};
    }

private:
    device::clr_range range() const {
        const auto width = static_cast<std::uint64_t>(engine().width());
        const std::uint64_t vectors = scene_.frame().height * ((scene_.frame().width + width - 1) / width);
        return {vectors * width, vectors};
    }

    const MediumScene& scene_;
    std::string source_, options_;
};

std::string changed(std::string_view from, std::string_view to) { return replaced(flatten_kernel("medium"), from, to); }

/// Samples of one ray as kernels draw them, beside the exact inverse distributions and weights.
struct TwinRay {
    TwinRay(const MediumScene& scene, std::uint32_t x, std::uint32_t y)
        : state(scene.state()), ray(device::clr_aim(state.device, state.occluders.data(), x, y)),
          exact(scene.scene(), camera_ray(scene.scene().camera, scene.frame(), x, y)) {}

    device::clr_medium_sample sample(Sampling sampling, float u) const {
        const auto s = static_cast<std::uint32_t>(sampling);
        const device::clr_medium_plan plan = device::clr_make_plan(s, state.device, &ray);
        return device::clr_sample(s, state.device, &ray, &plan, u);
    }

    const MediumScene::State& state;
    device::clr_medium_ray ray;
    Sightline exact;
};

}  // namespace

TEST(MediumDevice, tau_is_within_the_stated_error) {
    for (const Scene& scene : scenes())
        EXPECT_TRUE(tau_is_exact(tau_image(MediumScene(engine(), scene)), exact_image(scene, {})));
}

TEST(MediumDevice, a_scene_may_lie_far_from_the_origin) {
    const Frame frame{40, 30};
    for (const Scene& scene : scenes()) {
        Scene far = scene;
        const auto move = [](Vector3& p) { p = {p[0] + 1e4, p[1] - 1e5, p[2] + 1e6}; };
        for (Vector3* p : {&far.medium.box.lo, &far.medium.box.hi, &far.camera.eye, &far.camera.at}) move(*p);
        for (Sphere& s : far.spheres) move(s.centre);
        for (Box& b : far.boxes) {
            move(b.lo);
            move(b.hi);
        }
        const MediumScene on_device(engine(), far, frame);
        EXPECT_TRUE(tau_is_exact(tau_image(on_device), exact_image(scene, frame)));
        const auto m = render(on_device, {}, {1}, 16).m;
        const auto apart = [&](std::uint64_t seed) {
            const auto near = render(MediumScene(engine(), scene, frame), {}, {seed}, 16).m;
            double difference = 0, sum = 0;
            for (std::size_t i = 0; i < near.size(); ++i) {
                difference += std::abs(static_cast<double>(m[i]) - near[i]);
                sum += near[i];
            }
            return difference / sum;
        };
        EXPECT_LT(apart(1), 1e-3) << "the same samples, save where one lies on a shadow's edge";
        EXPECT_GT(apart(2), 1e-3) << "planted fault: others";
    }
}

TEST(MediumDevice, the_error_of_tau_catches_planted_faults) {
    const Frame frame{100, 75};
    const MediumScene scene(engine(), scenes()[2], frame);
    const ExactImage exact = exact_image(scenes()[2], frame);
    const auto passes = [&](std::string_view from, std::string_view to) {
        return tau_is_exact(Changed(scene, changed(from, to), Sampling::uni).tau(), exact);
    };
    EXPECT_TRUE(passes("kernel", "kernel"));
    EXPECT_FALSE(passes("ray.knot[1] = clr_clamp(middle ? first : skip", "ray.knot[1] = clr_clamp(middle ? second : skip"));
    EXPECT_FALSE(passes("(chord.leave.lo - chord.enter.lo)", "(chord.enter.lo - chord.leave.lo)"));
    EXPECT_FALSE(passes("return z < (clr_real)(0.5f) ? p * z", "return z < (clr_real)(0.5f) ? z"));
    EXPECT_FALSE(passes("column + column", "column + column + (clr_uint)(1u)"));
}

TEST(MediumDevice, references_are_tau_in_the_light_and_0_in_the_dark) {
    for (const Scene& scene : scenes()) {
        const Frame frame{100, 75};
        const MediumScene on_device(engine(), scene, frame);
        const auto tau = tau_image(on_device), reference = reference_image(on_device);
        const ExactImage exact = exact_image(scene, frame);
        for (std::size_t i = 0; i < tau.size(); ++i) {
            if (exact.mu[i] == exact.tau[i] || exact.mu[i] == 0) {
                ASSERT_EQ(reference[i], exact.mu[i] > 0 ? tau[i] : 0);
            }
            ASSERT_NEAR(static_cast<double>(reference[i]), exact.mu[i], 4e-6);
        }
    }
}

TEST(MediumDevice, every_sampling_and_pattern_has_the_hosts_bits) {
    const Frame frame{45, 31};
    for (const std::size_t which : {0, 1, 3}) {
        const MediumScene scene(engine(), scenes()[which], frame);
        for (const Sampler& sampler : all_samplers())
            for (const std::uint32_t samples : {1, 7, 300}) {
                const auto got = render(scene, sampler, {2, 5}, samples);
                EXPECT_EQ(unlike_the_host(scene, sampler, {2, 5}, samples, got, 7), 0u) << text(sampler) << " " << samples;
            }
    }
}

TEST(MediumDevice, images_have_the_same_bits_in_every_shape_and_split) {
    const Frame frame{45, 31};
    const Stream stream{3, 1, Generator::pcg4d3x};
    for (const auto& shape : some_shapes()) {
        const MediumScene scene(Engine(shape.options), scenes()[3], frame);
        const auto whole = render(scene, {}, stream, 6);
        EXPECT_EQ(unlike_the_host(scene, {}, stream, 6, whole), 0u) << shape.name;
        const std::size_t row = 3 * frame.width;
        for (const Rows rows : {Rows{0, 1}, {1, 17}, {18, 0}}) {
            const auto part = render(scene, {}, stream, 6, rows);
            EXPECT_TRUE(same_bits(part.m, std::span(whole.m).subspan(rows.first * row, part.m.size()))) << shape.name;
            EXPECT_TRUE(same_bits(part.t, std::span(whole.t).subspan(rows.first * row, part.t.size()))) << shape.name;
        }
    }
}

TEST(MediumDevice, levels_are_images_of_that_many_samples) {
    const MediumScene scene(engine(), scenes()[1], {33, 20});
    for (const Pattern pattern : {Pattern::iid, Pattern::stratified, Pattern::offset}) {
        const Sampler sampler{Sampling::wvds_mis, pattern, false};
        const auto levels = render_levels(scene, sampler, {1}, most_levels);
        for (std::uint32_t level = 0; level < most_levels; ++level) {
            const auto one = render(scene, sampler, {1}, 1u << level);
            EXPECT_TRUE(same_bits(one.m, std::span(levels.m).subspan(level * scene.values(), scene.values())));
            EXPECT_TRUE(same_bits(one.t, std::span(levels.t).subspan(level * scene.values(), scene.values())));
        }
    }
}

TEST(MediumDevice, samples_lie_where_the_exact_inverse_distribution_has_them) {
    Samples random(1);
    for (const Scene& scene : scenes()) {
        const MediumScene on_device(engine(), scene, {50, 40});
        for (int i = 0; i < 400; ++i) {
            const TwinRay twin(on_device, static_cast<std::uint32_t>(random.bits() % 50),
                               static_cast<std::uint32_t>(random.bits() % 40));
            if (!twin.exact.hit() || twin.exact.leave() - twin.exact.enter() < 0.05) continue;
            const auto u = static_cast<float>(random.uniform());
            for (const Sampling sampling : all_samplings) {
                // Shares of channels are rounded: near their ends u may belong to either.
                const double length = twin.exact.leave() - twin.exact.enter();
                const auto at = [&](double v) {
                    return std::min(twin.exact.distance(sampling, std::clamp(v, 0.0, 1 - 1e-9)) - twin.exact.enter(),
                                    length);
                };
                const double x = static_cast<double>(twin.sample(sampling, u).x), v = static_cast<double>(u), slack = 3e-6;
                const double low = std::min({at(v - slack), at(v), at(v + slack)}),
                             high = std::max({at(v - slack), at(v), at(v + slack)});
                EXPECT_TRUE(x >= low - 3e-6 && x <= high + 3e-6)
                    << name_of(sampling) << " u " << u << " x " << x << " in " << low << " " << high;
            }
        }
    }
}

// E[t] = tau and E[t^2] = T2, by the midpoint rule over u: what the weights must satisfy whatever the sampling.
TEST(MediumDevice, weights_integrate_to_tau_and_to_the_second_moment) {
    for (const Scene& scene : scenes()) {
        const MediumScene on_device(engine(), scene, {50, 40});
        for (const auto& [x, y] : {std::pair{25u, 20u}, {12u, 14u}, {33u, 25u}}) {
            const TwinRay twin(on_device, x, y);
            if (!twin.exact.hit()) continue;
            for (const Sampling sampling : all_samplings) {
                // With a sigma above the channel's, weights grow without end near u = 1 where the medium is dense.
                const bool tame = sampling == Sampling::uni || sampling == Sampling::dsm || sampling == Sampling::wvds_min ||
                                  sampling == Sampling::wvds_mis || scene.medium.sigma_t[2] < 1;
                if (!tame) continue;
                constexpr int steps = 1 << 14;
                Rgb t{}, tt{};
                for (int i = 0; i < steps; ++i) {
                    const auto one = twin.sample(sampling, (static_cast<float>(i) + 0.5f) / steps);
                    for (std::size_t c = 0; c < 3; ++c) {
                        const double value = static_cast<double>(one.t[c]);
                        t[twin.state.device.channel[c]] += value / steps;
                        tt[twin.state.device.channel[c]] += value * value / steps;
                    }
                }
                const auto want = twin.exact.second_moments(sampling);
                for (std::size_t c = 0; c < 3; ++c) {
                    const double slack =
                        sampling == Sampling::wvds_mean ? 5e-2 : 1e-3;  // its weights grow without end near u = 1
                    EXPECT_NEAR(t[c], twin.exact.tau()[c], slack * twin.exact.tau()[c]) << name_of(sampling);
                    EXPECT_NEAR(tt[c], want.tt[c], 3 * slack * want.tt[c]) << name_of(sampling);
                }
            }
        }
    }
}

TEST(MediumDevice, where_nothing_is_in_the_way_m_and_t_have_the_same_bits) {
    for (const std::size_t which : {0, 2, 3}) {
        const Scene scene = scenes()[which];
        const ExactImage exact = exact_image(scene, {});
        const MediumScene on_device(engine(), scene);
        const auto tau = tau_image(on_device);
        for (const Sampling sampling : all_samplings) {
            const auto image = render(on_device, {sampling}, {1}, 1);
            std::size_t lit = 0;
            for (std::size_t i = 0; i < tau.size(); ++i) {
                if (!exact.hit[i / 3] || exact.mu[i] != exact.tau[i]) continue;
                ++lit;
                ASSERT_EQ(image.m[i], image.t[i]) << name_of(sampling);
                if (sampling != Sampling::dsa) {
                    ASSERT_EQ(image.m[i] / image.t[i], 1);
                }
            }
            EXPECT_GT(lit, 20000u);
        }
    }
}

// A share of samples that no test of visibility should disagree on: both sides of every shadow's end, a little off it.
TEST(MediumDevice, visibility_agrees_with_the_exact_intervals) {
    Samples random(2);
    std::size_t tested = 0;
    for (const Scene& scene : scenes()) {
        const MediumScene on_device(engine(), scene, {80, 60});
        for (int i = 0; i < 1500; ++i) {
            const TwinRay twin(on_device, static_cast<std::uint32_t>(random.bits() % 80),
                               static_cast<std::uint32_t>(random.bits() % 60));
            if (!twin.exact.hit()) continue;
            std::array<std::uint32_t, CLR_SHADOW_LIST> list{};
            device::clr_shadows shadows{};
            shadows.list = list.data();
            device::clr_find_shadows(twin.state.device, twin.state.occluders.data(), &twin.ray, &shadows);
            const auto lit = twin.exact.lit();
            for (int k = 0; k < 40; ++k) {
                const auto x = static_cast<float>(random.uniform()) * twin.ray.length;
                const double s = twin.exact.enter() + static_cast<double>(x);
                bool inside = false, near = s > twin.exact.leave() - 2e-5;
                for (const Stretch& part : lit) {
                    inside = inside || (s > part.lo && s < part.hi);
                    near = near || std::abs(s - part.lo) < 2e-5 || std::abs(s - part.hi) < 2e-5;
                }
                if (near) continue;
                ++tested;
                EXPECT_EQ(device::clr_lit(twin.state.device, twin.state.occluders.data(), &shadows, x), inside ? 1 : 0);
            }
        }
    }
    EXPECT_GT(tested, 150000u);
}

TEST(MediumDevice, light_and_rays_along_axes_and_flat_paths_are_right) {
    Scene base;
    base.medium = {{{-1, -1, -1}, {1, 1, 1}}, {0.5, 1, 2}, {1, 1, 1}, 0.3, {10, 10, 10}, {0, 1, 0}};
    base.spheres = {{{0.3, 0.5, 0.1}, 0.28}};
    base.boxes = {{{-0.9, 0.5, -0.5}, {-0.4, 1.2, 0.4}}};
    const Frame frame{21, 21};  // odd: the middle ray has components of 0
    for (const Vector3& light :
         std::initializer_list<Vector3>{{0, 1, 0}, {1, 0, 0}, {0, 0, -1}, {0, 1, 1}, {1, 0.001, 0.0002}, {0, 0, 1}})
        for (const Vector3& eye : std::initializer_list<Vector3>{{0, 0, -5}, {0.2, 0.1, -0.3}, {4, 0, 0}}) {
            Scene scene = base;
            scene.medium.light = light;
            scene.camera = {eye, {0, 0, eye[2] == -0.3 ? 0.5 : 0.0}, 30};
            const MediumScene on_device(engine(), scene, frame);
            const ExactImage exact = exact_image(scene, frame);
            const auto tau = tau_image(on_device);
            for (std::size_t i = 0; i < tau.size(); ++i) ASSERT_NEAR(static_cast<double>(tau[i]), exact.tau[i], 4e-6);
            // 4096 samples of each pixel: means within 6 standard errors of mu.
            constexpr std::uint32_t samples = 4096;
            const auto image = render(on_device, {}, {1}, samples);
            EXPECT_EQ(unlike_the_host(on_device, {}, {1}, samples, image, 40), 0u);
            for (std::uint32_t p = 0; p < frame.width * frame.height; ++p) {
                const Sightline line(scene, camera_ray(scene.camera, frame, p % frame.width, p / frame.width));
                const auto moments = line.second_moments(Sampling::wvds_mis);
                for (std::size_t c = 0; c < 3; ++c) {
                    const double variance = std::max(0.0, moments.mm[c] - line.mu()[c] * line.mu()[c]) / samples;
                    ASSERT_NEAR(static_cast<double>(image.m[3 * p + c]), line.mu()[c],
                                6 * std::sqrt(variance) + 2e-5 * (1 + line.tau()[c]));
                }
            }
        }
}

TEST(MediumDevice, formulas_keep_their_stated_errors) {
    double exp2_worst = 0, decayed_worst = 0, log_worst = 0;
    Samples random(3);
    for (int i = 0; i < 400000; ++i) {
        const auto y = static_cast<float>(250 * random.uniform() - 125);
        exp2_worst =
            std::max(exp2_worst, std::abs(static_cast<double>(device::clr_exp2(y)) / std::exp2(static_cast<double>(y)) - 1));
        const auto z = static_cast<float>(std::exp2(60 * random.uniform() - 54));
        const double decayed = -std::expm1(-static_cast<double>(z));
        decayed_worst = std::max(decayed_worst, std::abs(static_cast<double>(device::clr_decayed(z)) / decayed - 1));
        const auto t = static_cast<float>(i % 2 ? -std::exp2(-40 * random.uniform()) : -random.uniform());
        const double log = -std::log1p(static_cast<double>(std::max(t, -0.99999994f)));
        log_worst = std::max(log_worst, std::abs(static_cast<double>(device::clr_minus_log1p(t)) / log - 1));
    }
    EXPECT_LE(exp2_worst, 1.8e-7);
    EXPECT_LE(decayed_worst, 2.5e-7);
    EXPECT_LE(log_worst, 3e-7);
    EXPECT_EQ(device::clr_exp2(0), 1);
    EXPECT_EQ(device::clr_minus_log1p(0), 0);
    EXPECT_TRUE(std::isfinite(device::clr_minus_log1p(-1)));
    EXPECT_EQ(device::clr_decayed(0), 0);
}

TEST(MediumDevice, a_state_takes_an_image_as_one_batch) {
    const MediumScene scene(engine(), scenes()[0], {40, 30});
    Moments whole(engine(), scene.values()), parts(engine(), scene.values());
    for (const std::uint32_t id : {0, 1, 2}) {
        const Event done(render(scene, {}, {1, id}, 4, whole));
        wait(done);
        const auto image = render(scene, {}, {1, id}, 4);
        parts.add(image.m, image.t, 4);
    }
    EXPECT_EQ(whole.bits(&StatePlanes::m), parts.bits(&StatePlanes::m));
    EXPECT_EQ(whole.bits(&StatePlanes::mt), parts.bits(&StatePlanes::mt));
    EXPECT_EQ(whole.weight(), 12);
}

TEST(MediumDevice, misuse_is_refused_by_name) {
    const MediumScene scene(engine(), scenes()[0], {16, 8});
    refused([&] { MediumScene(engine(), scenes()[0], {0, 8}); }, "frame");
    refused([&] { tau_image(scene, {8, 1}); }, "rows");
    refused([&] { tau_image(scene, {7, 2}); }, "rows");
    refused([&] { render(scene, {}, {1}, 0); }, "samples");
    refused([&] { render_levels(scene, {}, {1}, 8); }, "levels");
    refused([&] { render(scene, {}, {1, 1u << 31}, 1); }, "stream.id");
    refused([&] { render(scene, {}, {1ull << 40, 0, Generator::pcg4d3x}, 1); }, "seed");
    refused([&] { render(scene, {static_cast<Sampling>(9)}, {1}, 1); }, "sampling");
    refused([&] { render_pixel(scene, {}, {1}, 1, 16, 0); }, "pixel");
    const Buffer small(engine(), 100);
    refused([&] { render(scene, {}, {1}, 1, Rows{}, View{small.mem(), 0, 10}, View{small.mem(), 0, 10}); }, "m");
    Moments other(engine(), 5);
    refused([&] { render(scene, {}, {1}, 1, other); }, "sums");
    for (const Bins& bins : {Bins{1, -1, 8}, Bins{-1, 1, 0}, Bins{-1, 1, 5000}})
        refused([&] { medium_errors(scene, {}, {0, 1}, {}, bins); }, "bins");
    refused([&] { medium_errors(scene, {}, {0, 0}, {}, {}); }, "seeds");
    refused([&] { medium_errors(scene, {}, {1ull << 32, 1}, {}, {}, {.generator = Generator::pcg4d3x}); }, "seeds");
    EXPECT_THROW(medium_errors(scene, {}, {0, 1}, {}, {}, {.progress = [](std::uint64_t, std::uint64_t) { return false; }}),
                 Cancelled);
}

// Small enough for oclgrind.
TEST(MediumSmall, every_kernel_runs) {
    for (const int width : {1, 4}) {
        const MediumScene scene(Engine({.width = width}), scenes()[3], {6, 3});
        reference_image(scene, {1, 2});
        for (const Sampling sampling : all_samplings)
            if (width == 1 || sampling == Sampling::wvds_mis) render_levels(scene, {sampling}, {1}, 3);
        medium_errors(scene, {}, {1, 2}, {}, {-0.25, 0.25, 16}, {.levels = 2});
    }
    const MediumScene scene(Engine({.width = 1}), scenes()[1], {6, 3});
    render(scene, {Sampling::wvds_mis, Pattern::offset, true}, {1}, 5);
}

TEST(MediumDevice, oclgrind_finds_nothing) { expect_clean_under_oclgrind("medium_device_test", "MediumSmall.*"); }

TEST(MediumSmall, DISABLED_a_store_out_of_bounds) {
    const MediumScene scene(engine(), scenes()[0], {5, 1});
    Changed(scene, changed("i < lanes; ++i", "i < lanes + 16; ++i"), Sampling::uni).tau();
}

TEST(MediumDevice, oclgrind_finds_a_planted_store_out_of_bounds) {
    const auto report = under_oclgrind("medium_device_test", "MediumSmall.DISABLED_a_store_out_of_bounds",
                                       "--gtest_also_run_disabled_tests");
    if (!report) GTEST_SKIP() << "oclgrind is not installed";
    EXPECT_GT(report->complaints(), 0);
}
