// Views: strided, shared between queues, fused, and refused where they do not fit.
#include "clratio/view.hpp"

#include <gtest/gtest.h>

#include "moments_state.hpp"
#include "support/image_pair.hpp"
#include "support/refused.hpp"
#include "support/shapes.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

/// Interleaved RGBA on the device; the alpha holds a sentinel.
struct Rgba {
    std::vector<float> host;
    Buffer buffer;
    View rgb;
    Rgba(const Engine& engine, const std::vector<float>& colour, std::uint64_t lead)
        : host(lead + colour.size() / 3 * 4, -7.0f) {
        for (std::size_t i = 0; i < colour.size(); ++i) host[lead + i / 3 * 4 + i % 3] = colour[i];
        buffer = Buffer(engine, host.size() * sizeof(float));
        buffer.write(std::as_bytes(std::span(host)));
        rgb = {buffer.mem(), lead, colour.size(), 4, 3};
    }
};

}  // namespace

TEST(View, views_skip_an_interleaved_alpha_and_touch_nothing_else) {
    const Pair p = make_pair_of(1);
    for (const auto& shape : all_shapes()) {
        const Engine engine(shape.options);
        const Rgba m(engine, p.m, 5), t(engine, p.t, 0), tau(engine, p.tau, 2),
            out(engine, std::vector<float>(values, 0), 3);
        wait(Event(combine(engine, m.rgb, t.rgb, tau.rgb, {out.rgb, {}, nullptr})));
        std::vector<float> got(out.host.size());
        out.buffer.read(std::as_writable_bytes(std::span(got)));
        const auto want = combine_pair(engine, p).estimate;
        for (std::size_t i = 0; i < got.size(); ++i) {
            const bool colour = i >= 3 && (i - 3) % 4 < 3;
            ASSERT_EQ(std::bit_cast<std::uint32_t>(got[i]),
                      std::bit_cast<std::uint32_t>(colour ? want[(i - 3) / 4 * 3 + (i - 3) % 4] : -7.0f))
                << shape.name << " element " << i;
        }
        Moments strided(engine, values), dense(engine, values);
        const Batch batch{m.rgb, t.rgb, 3};
        wait(Event(strided.add(std::span(&batch, 1), {})));
        dense.add(p.m, p.t, 3);
        EXPECT_EQ(strided.bits(&StatePlanes::t), dense.bits(&StatePlanes::t)) << shape.name;
    }
}

TEST(View, fused_add_and_read_out_equals_the_two_calls) {
    for (const auto& shape : all_shapes()) {
        const Engine engine(shape.options);
        std::vector<Rgba> arrays;
        std::vector<Batch> batches;
        for (std::uint64_t k = 1; k <= 5; ++k) {
            const Pair p = make_pair_of(k);
            arrays.emplace_back(engine, p.m, 0);
            arrays.emplace_back(engine, p.t, 0);
            batches.push_back({arrays[arrays.size() - 2].rgb, arrays.back().rgb, static_cast<double>(k)});
        }
        const Rgba tau(engine, make_pair_of(9).tau, 0), fused(engine, std::vector<float>(values, 0), 0), two(fused);
        const Buffer other(engine, fused.buffer.size());
        const View two_view{other.mem(), 0, values, 4, 3};
        Moments a(engine, values), b(engine, values);
        wait(Event(add_and_combine(a, batches, tau.rgb, {fused.rgb, {}, nullptr})));
        wait(Event(b.add(batches, {})));
        wait(Event(combine(b, tau.rgb, {two_view, {}, nullptr})));
        std::vector<float> x(fused.host.size()), y(fused.host.size());
        fused.buffer.read(std::as_writable_bytes(std::span(x)));
        other.read(std::as_writable_bytes(std::span(y)));
        for (std::size_t i = 0; i < x.size(); ++i)
            ASSERT_TRUE(i % 4 == 3 || std::bit_cast<std::uint32_t>(x[i]) == std::bit_cast<std::uint32_t>(y[i]))
                << shape.name;
        EXPECT_EQ(a.bits(&StatePlanes::mt), b.bits(&StatePlanes::mt)) << shape.name;
    }
}

TEST(View, fused_host_form_equals_the_two_calls_for_any_number_of_batches) {
    const Engine engine;
    for (const std::size_t count : {1, 8, 9, 19}) {
        std::vector<Pair> pairs;
        for (std::size_t k = 0; k < count; ++k) pairs.push_back(make_pair_of(k + 1));
        std::vector<HostBatch> batches;
        for (const auto& p : pairs) batches.push_back({p.m, p.t, 2});
        Moments a(engine, values), b(engine, values);
        const Combined fused = add_and_combine(a, batches, 0.5f, {.standard_error = true});
        b.add(batches);
        const Combined apart = combine(b, 0.5f, {.standard_error = true});
        EXPECT_EQ(bits(fused.estimate), bits(apart.estimate));
        EXPECT_EQ(bits(fused.standard_error), bits(apart.standard_error));
        EXPECT_EQ(fused.flags.any, apart.flags.any);
        EXPECT_EQ(a.bits(&StatePlanes::mt), b.bits(&StatePlanes::mt));
    }
    Moments none(engine, values);
    EXPECT_THROW(add_and_combine(none, std::span<const HostBatch>{}, 0.5f), InvalidArgument);
}

TEST(View, event_form_is_right_on_an_out_of_order_queue) {
    const Engine own;
    cl_int code = CL_SUCCESS;
    const cl_queue_properties properties[] = {CL_QUEUE_PROPERTIES, CL_QUEUE_OUT_OF_ORDER_EXEC_MODE_ENABLE, 0};
    const Queue queue(clCreateCommandQueueWithProperties(own.context(), own.device(), properties, &code));
    ASSERT_EQ(code, CL_SUCCESS);
    const Engine engine(queue.get());
    const Pair p = make_pair_of(1);
    const Buffer m(own, values * sizeof(float)), t(own, values * sizeof(float));
    const cl_event gate = clCreateUserEvent(engine.context(), &code);
    Moments s(engine, values);
    std::vector<Event> chain;
    const Batch batch{{m.mem(), 0, values}, {t.mem(), 0, values}};
    for (int k = 0; k < 20; ++k) chain.emplace_back(s.add(std::span(&batch, 1), std::span(&gate, k == 0 ? 1 : 0)));
    const Buffer out(own, values * sizeof(float)), tau(own, values * sizeof(float));
    tau.write(std::as_bytes(std::span(p.tau)));
    const Event read(combine(s, {tau.mem(), 0, values}, {{out.mem(), 0, values}, {}, nullptr}));
    m.write(std::as_bytes(std::span(p.m)));  // after all was enqueued: nothing has run, the gate is shut
    t.write(std::as_bytes(std::span(p.t)));
    clSetUserEventStatus(gate, CL_COMPLETE);
    wait(read);
    clReleaseEvent(gate);
    std::vector<float> got(values);
    out.read(std::as_writable_bytes(std::span(got)));
    Moments once(own, values);  // 20 equal batches have the mean of one
    once.add(p.m, p.t);
    EXPECT_EQ(bits(got), bits(combine(once, Tau(std::span<const float>(p.tau))).estimate));
}

TEST(View, misuse_is_refused_by_name) {
    const Engine engine;
    const Buffer mem(engine, 100 * sizeof(float));
    const View all{mem.mem(), 0, 100}, shorter{mem.mem(), 0, 99}, past{mem.mem(), 1, 100}, shifted{mem.mem(), 1, 50},
        half{mem.mem(), 0, 50};
    refused([&] { combine(engine, all, shorter, all, {all, {}, nullptr}); }, "t: expected 100 values, got 99");
    refused([&] { combine(engine, all, all, shorter, {all, {}, nullptr}); }, "tau: expected 100 values, got 99");
    refused([&] { combine(engine, past, past, past, {past, {}, nullptr}); }, "inside its buffer of 100 elements");
    refused([&] { combine(engine, half, half, half, {shifted, {}, nullptr}); }, "estimate: expected a view apart from");
    refused([&] { combine(engine, {}, {}, {}, {}); }, "m: expected a device buffer, got null");
    refused(
        [&] {
            combine(engine, all, all, all, {{mem.mem(), 0, 100, 0, 1}, {}, nullptr});
        },
        "estimate: expected a stride");
    refused([&] { combine(engine, all, all, all, {all, {}, nullptr}, {.estimator = Estimator::mean}); }, "estimator");
    const View wraps{mem.mem(), ~std::uint64_t{0} - 3, 50}, endless{mem.mem(), 0, ~std::uint64_t{0}, 4, 3};
    refused([&] { combine(engine, half, half, half, {wraps, {}, nullptr}); }, "estimate: expected a view inside its buffer");
    refused([&] { combine(engine, wraps, half, half, {half, {}, nullptr}); }, "m: expected a view inside its buffer");
    refused([&] { combine(engine, endless, endless, endless, {endless, {}, nullptr}); }, "inside its buffer");
    refused([&] { combine(engine, all, all, all, {all, {}, mem.mem()}); }, "flags: expected a view apart from estimate");
    const cl_buffer_region first{0, 50 * sizeof(float)}, later{0, 80 * sizeof(float)};
    const auto part = [&](const cl_buffer_region& region) {
        return Memory(clCreateSubBuffer(mem.mem(), CL_MEM_READ_WRITE, CL_BUFFER_CREATE_TYPE_REGION, &region, nullptr));
    };
    const Memory a = part(first), b = part(later);
    const View in_a{a.get(), 0, 50}, in_b{b.get(), 0, 50}, shifted_in_b{b.get(), 1, 50};
    refused(
        [&] {
            combine(engine, in_a, in_a, in_a, {shifted_in_b, {}, nullptr});
        },
        "estimate: expected a view apart from m");
    refused(
        [&] {
            combine(engine, half, half, half, {shifted_in_b, {}, nullptr});
        },
        "estimate: expected a view apart from m");
    clReleaseEvent(combine(engine, in_a, in_a, in_a, {in_b, {}, nullptr}));
    const std::vector<float> three(3), two(2);
    Tau four_of_one(std::vector<float>{1});
    four_of_one.channels = 3;
    refused([&] { combine(engine, three, three, four_of_one); }, "tau: expected 3 numbers, one for each channel, got 1");
    refused([&] { combine(engine, three, two, 1.0f); }, "t: expected 3 values, got 2");
    refused(
        [&] {
            combine_batches(engine, std::vector<HostBatch>{{three, three}}, Tau(std::vector<float>{}));
        },
        "tau: expected 3");
    EXPECT_TRUE(combine_batches(engine, std::vector<HostBatch>{{{}, {}}}, Tau(std::vector<float>{})).estimate.empty());
    const Moments s(engine, 100);
    refused([&] { combine(s, 1.0f, {.estimator = Estimator::mean_of_ratios}); }, ".ratios = true");
}
