// combine_batches: batches that are all there are, combined in one pass.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <thread>

#include "clratio/combine.hpp"
#include "clratio/fixed.hpp"
#include "engine_state.hpp"
#include "launch.hpp"
#include "moments_state.hpp"
#include "support/oclgrind.hpp"
#include "support/refused.hpp"
#include "support/samples.hpp"
#include "support/shapes.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

constexpr std::size_t values = 5001;

/// Batches with zeros, a NaN, an infinity and negative values, and an image of tau.
struct Input {
    explicit Input(std::size_t batches, std::size_t count = values) {
        Samples draw(1);
        for (std::size_t k = 0; k < batches; ++k) {
            t.push_back(floats(count, [&] { return draw.uniform() < 0.1 ? 0 : draw.lognormal(0.8); }));
            m.push_back(t.back());
            for (auto& x : m.back()) x *= static_cast<float>(draw.uniform());
        }
        tau = floats(count, [&] { return draw.uniform() < 0.1 ? 0 : draw.uniform(); });
        m.front()[7] = std::numeric_limits<float>::quiet_NaN();
        t.back()[count / 2] = std::numeric_limits<float>::infinity();
        m.back()[9] = t.front()[count - 1] = -0.5f;
    }

    std::vector<HostBatch> batches() const {
        std::vector<HostBatch> all;
        for (std::size_t k = 0; k < m.size(); ++k) all.push_back({m[k], t[k], static_cast<double>(1 + k % 3)});
        return all;
    }
    Tau control() const { return Tau(std::span<const float>(tau)); }

    std::vector<std::vector<float>> m, t;
    std::vector<float> tau;
};

/// Everything in a result, as bits.
std::vector<std::uint32_t> bits(const Combined& c) {
    std::vector<std::uint32_t> all;
    for (const auto* part : {&c.estimate, &c.standard_error, &c.bias, &c.lower, &c.upper, &c.gain, &c.needed})
        for (const float x : *part) all.push_back(std::bit_cast<std::uint32_t>(x));
    for (const auto* part : {&c.flag_image, &c.kind}) all.insert(all.end(), part->begin(), part->end());
    const auto& f = c.flags;
    for (const auto n : {f.zero_denominator, f.zero_tau, f.skipped, f.no_data, f.no_error_bar, f.nonfinite, f.fell_back,
                         f.no_spread, f.any})
        all.push_back(static_cast<std::uint32_t>(n));
    return all;
}

/// Through a state.
Combined added(const Engine& engine, const Input& in, const CombineOptions& options, const BatchOptions& how) {
    const Needs needs = needs_of(options.estimator);
    Moments sum(engine, in.tau.size(), {.nonfinite = how.nonfinite, .ratios = needs.ratios, .weights = how.weights});
    sum.add(in.batches());
    Combined out = combine(sum, in.control(), options);
    out.negatives = sum.negatives();
    return out;
}

CombineOptions all_of(Estimator e) {
    return {.estimator = e,
            .standard_error = e != Estimator::mean_of_ratios,
            .bias = true,
            .interval = e != Estimator::mean_of_ratios,
            .gain = true,
            .needed = true,
            .target = 0.01f};
}

}  // namespace

TEST(Batches, have_the_bits_of_a_state_at_every_shape) {
    const Input in(5);
    const CombineOptions options{.standard_error = true};
    for (const auto& shape : fewest_shapes()) {
        const Engine engine(shape.options);
        const Combined want = added(engine, in, options, {}),
                       got = combine_batches(engine, in.batches(), in.control(), options);
        EXPECT_EQ(bits(got), bits(want)) << shape.name;
        EXPECT_EQ(got.negatives, want.negatives) << shape.name;
        EXPECT_EQ(got.flags.skipped, 2u) << shape.name;
    }
}

TEST(Batches, estimators_and_all_they_tell_are_those_of_a_state) {
    const Engine engine;
    const Input in(4, 1000);
    const auto same = [&](Estimator e, const BatchOptions& how) {
        EXPECT_EQ(bits(combine_batches(engine, in.batches(), in.control(), all_of(e), how)),
                  bits(added(engine, in, all_of(e), how)))
            << name_of(e);
    };
    for (const Estimator e : {Estimator::beale, Estimator::hartley_ross, Estimator::regression}) same(e, {});
    same(Estimator::mean_of_ratios, {.nonfinite = NonFinite::propagate, .weights = Weights::reliability});
}

TEST(Batches, one_to_eight_of_them) {
    const Engine engine;
    for (const std::size_t count : {1, 2, 8}) {
        const Input in(count);
        const CombineOptions options{.standard_error = true};
        EXPECT_EQ(bits(combine_batches(engine, in.batches(), in.control(), options)), bits(added(engine, in, options, {})));
    }
    Input in(2);
    const auto right = bits(combine_batches(engine, in.batches(), in.control()));
    std::swap(in.m[0], in.t[0]);
    EXPECT_NE(bits(combine_batches(engine, in.batches(), in.control())), right) << "planted fault: m and t swapped";
}

TEST(Batches, what_does_not_fit_is_done_in_parts) {
    const Input in(3);
    const Engine whole, parts;
    parts.state().info.largest_allocation = 4096;
    const auto got = combine_batches(parts, in.batches(), in.control());
    EXPECT_EQ(bits(got), bits(combine_batches(whole, in.batches(), in.control())));
    const Tau three(std::vector<float>{1, 2, 3});
    EXPECT_EQ(bits(combine_batches(parts, in.batches(), three)), bits(combine_batches(whole, in.batches(), three)));
    EXPECT_GT(got.negatives, 0u);
}

// Also on a device that copies, and where the image is done in parts.
TEST(Batches, the_estimate_may_take_the_place_of_tau) {
    const Input in(3);
    const Engine whole, parts, copying;
    parts.state().info.largest_allocation = 4096;
    copying.state().info.host_memory = false;
    const auto over = [](std::vector<float> image, auto combined) {
        const Tau tau{std::span<const float>(image)};
        Combined place;
        place.estimate = std::move(image);
        const Combined got = combined(tau, std::move(place));
        EXPECT_EQ(got.estimate.data(), tau.image.data());
        return bits(got);
    };
    for (const Engine* engine : {&whole, &parts, &copying}) {
        const auto at_once = [&](const Tau& tau, Combined place) {
            return combine_batches(*engine, in.batches(), tau, {}, {}, std::move(place));
        };
        const auto want = bits(combine_batches(*engine, in.batches(), in.control()));
        EXPECT_EQ(over(in.tau, at_once), want);
        EXPECT_NE(over(in.m[1], at_once), want) << "planted fault: another tau";
    }
    Moments sum(copying, values);
    sum.add(in.batches());
    const auto read_out = [&](const Tau& tau, Combined place) { return combine(sum, tau, {}, std::move(place)); };
    EXPECT_EQ(over(in.tau, read_out), bits(combine(sum, in.control())));
}

// The first launch waits at a gate; the read-out after it cannot be built. The caller's memory is his again when he hears of
// it.
TEST(Batches, an_error_between_two_launches_comes_after_the_first_has_ended) {
    const Engine engine({.disk_cache = false});
    Moments sum(engine, values);
    const Input in(1);
    sum.add(in.batches());
    engine.state().wide = 5;  // no vector has so many lanes
    const cl_event gate = clCreateUserEvent(engine.context(), nullptr);
    sum.state().last = Event::share(gate);
    std::jthread opens([&] {
        std::this_thread::sleep_for(std::chrono::seconds(1));
        clSetUserEventStatus(gate, CL_COMPLETE);
    });
    EXPECT_THROW(add_and_combine(sum, in.batches(), in.control(), {.estimator = Estimator::beale}), BuildError);
    cl_int status = CL_QUEUED;
    clGetEventInfo(sum.state().last.get(), CL_EVENT_COMMAND_EXECUTION_STATUS, sizeof status, &status, nullptr);
    EXPECT_EQ(status, CL_COMPLETE);
    EXPECT_EQ(sum.batches(), 2u);
    opens.join();
    clReleaseEvent(gate);
}

// A state is made, and batches are combined, while everything before them waits at a gate.
TEST(Batches, event_forms_wait_for_nothing) {
    const Engine engine;
    const Input in(1, 999);
    const Buffer m = Buffer::copy_of(engine, std::as_bytes(std::span(in.m[0]))),
                 t = Buffer::copy_of(engine, std::as_bytes(std::span(in.t[0]))), out(engine, 999 * sizeof(float));
    const Batch batch{{m.mem(), 0, 999}, {t.mem(), 0, 999}};
    const cl_event gate = clCreateUserEvent(engine.context(), nullptr);
    std::atomic<bool> enqueued = false, late = false;
    std::jthread opens([&] {  // when all is enqueued, or where something waits for it
        for (int k = 0; k < 6000 && !enqueued; ++k) std::this_thread::sleep_for(std::chrono::milliseconds(10));
        late = !enqueued;
        clSetUserEventStatus(gate, CL_COMPLETE);
    });
    const auto enqueue = [&] {
        return Event(combine_batches(engine, {&batch, 1}, batch.t, {{out.mem(), 0, 999}}, {}, {}, {&gate, 1}));
    };
    const Event first = enqueue(), second = enqueue();
    Moments sum(engine, 999);
    const FixedMoments fixed(engine, 999);
    const Event added(sum.add(std::span(&batch, 1), {&gate, 1}));
    enqueued = true;
    for (const Event& e : {first, second, added}) wait(e);
    opens.join();
    EXPECT_FALSE(late);
    clReleaseEvent(gate);
}

TEST(Batches, views_may_have_gaps_and_the_result_may_stand_on_an_input) {
    const Engine engine;
    const Input in(2, 999);
    std::vector<Buffer> memory;
    std::vector<Batch> packed, spread;
    for (std::size_t k = 0; k < 2; ++k) {
        for (const auto* v : {&in.m[k], &in.t[k]}) {
            std::vector<float> rgba(4 * 333, 9.0f);
            for (std::size_t i = 0; i < v->size(); ++i) rgba[i / 3 * 4 + i % 3] = (*v)[i];
            memory.push_back(Buffer::copy_of(engine, std::as_bytes(std::span(*v))));
            memory.push_back(Buffer::copy_of(engine, std::as_bytes(std::span(rgba))));
        }
        const auto view = [&](std::size_t i, std::uint32_t stride) {
            return View{memory[memory.size() - i].mem(), 0, 999, stride, stride == 4 ? 3u : 1u};
        };
        packed.push_back({view(4, 1), view(2, 1)});
        spread.push_back({view(3, 4), view(1, 4)});
    }
    const Buffer tau = Buffer::copy_of(engine, std::as_bytes(std::span(in.tau))), out(engine, 999 * sizeof(float));
    const auto read = [](cl_mem from, const Engine& e) {
        std::vector<std::uint32_t> words(999);
        clEnqueueReadBuffer(e.queue(), from, CL_TRUE, 0, 4 * words.size(), words.data(), 0, nullptr, nullptr);
        return words;
    };
    wait(Event(combine_batches(engine, spread, {tau.mem(), 0, 999}, {{out.mem(), 0, 999}})));
    const auto want = read(out.mem(), engine);
    wait(Event(combine_batches(engine, packed, {tau.mem(), 0, 999}, {packed[0].m})));
    EXPECT_EQ(read(packed[0].m.mem, engine), want);
}

TEST(Batches, misuse_is_refused_by_name) {
    const Engine engine;
    const Input in(2);
    const auto batches = in.batches();
    refused([&] { combine_batches(engine, std::span<const HostBatch>{}, 1.0f); }, "batches: expected 1 to 8, got 0");
    refused([&] { combine_batches(engine, std::vector<HostBatch>(9, batches[0]), 1.0f); },
            "batches: expected 1 to 8, got 9");
    refused([&] { combine_batches(engine, batches, std::span<const float>(in.tau).first(5)); }, "tau: expected 5001 values");
    refused([&] { combine_batches(engine, batches, 1.0f, {.estimator = Estimator::jackknife}); }, "estimator");
    refused([&] { combine_batches(engine, batches, 1.0f, {.level = 2}); }, "level");
    refused([&] { combine_batches(engine, batches, 1.0f, {}, {.nonfinite = NonFinite::fail}); }, "batch 0: expected finite");
    const std::vector<HostBatch> uneven{batches[0], {batches[1].m.first(9), batches[1].t}};
    refused([&] { combine_batches(engine, uneven, 1.0f); }, "m: expected 5001 values, got 9");
    const std::vector<HostBatch> light{{in.m[0], in.t[0], 0}};
    refused([&] { combine_batches(engine, light, 1.0f); }, "weight");

    const Buffer mem(engine, 400);
    const View all{mem.mem(), 0, 100}, half{mem.mem(), 0, 50}, shifted{mem.mem(), 1, 50};
    const Batch one{half, half};
    refused([&] { combine_batches(engine, std::span(&one, 1), half, {shifted}); }, "estimate: expected a view apart from m");
    refused([&] { combine_batches(engine, std::span(&one, 1), all, {half}); }, "tau: expected 50 values");
    refused([&] { combine_batches(engine, std::span(&one, 1), half, {half}, {}, {.nonfinite = NonFinite::fail}); },
            "NonFinite::fail");
}

// A launch of one batch goes vector by vector, also where some values have lost it.
TEST(Batches, one_at_a_time_into_a_state_equals_the_two_calls) {
    const Input in(3);
    for (const auto& shape : all_shapes())
        for (const NonFinite nonfinite : {NonFinite::skip, NonFinite::propagate}) {
            const Engine engine(shape.options);
            Moments fused(engine, values, {.nonfinite = nonfinite}), apart(engine, values, {.nonfinite = nonfinite});
            const CombineOptions options{.standard_error = true};
            for (const HostBatch& batch : in.batches()) {
                const Combined now = add_and_combine(fused, std::span(&batch, 1), in.control(), options);
                EXPECT_NE(bits(now), bits(combine(apart, in.control(), options))) << "planted fault: the batch is left out";
                apart.add(std::span(&batch, 1));
                EXPECT_EQ(bits(now), bits(combine(apart, in.control(), options))) << shape.name;
            }
            EXPECT_EQ(fused.bits(&StatePlanes::mt), apart.bits(&StatePlanes::mt)) << shape.name;
            EXPECT_EQ(fused.bits(&StatePlanes::batches), apart.bits(&StatePlanes::batches)) << shape.name;
            EXPECT_EQ(fused.skipped(), nonfinite == NonFinite::skip ? 2u : 0u) << shape.name;
            EXPECT_EQ(fused.negatives(), 2u) << shape.name;
        }
}

TEST(BatchesSmall, every_path) {
    const Engine engine({.width = 4, .path = EngineOptions::Path::ranges, .work_items = 2, .disk_cache = false});
    const Input in(2, 150);  // one block of 128 and the rest
    Moments sum(engine, 150);
    const auto options = CombineOptions{.standard_error = true};
    const Combined kept = add_and_combine(sum, in.batches(), in.control(), options);
    EXPECT_EQ(bits(combine_batches(engine, in.batches(), in.control(), options)), bits(kept));
    const HostBatch one = in.batches().front();
    const Combined more = add_and_combine(sum, std::span(&one, 1), in.control(), options);
    EXPECT_EQ(bits(more), bits(combine(sum, in.control(), options)));
}

TEST(Batches, kernels_are_clean_under_oclgrind) { expect_clean_under_oclgrind("batches_test", "BatchesSmall.*"); }
