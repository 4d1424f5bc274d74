#include "clratio/moments.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "support/samples.hpp"
#include "support/shapes.hpp"
#include "support/twin.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

constexpr std::size_t values = 1003;  // no multiple of any width
constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();

struct Input {
    std::vector<std::vector<float>> m, t;
    std::vector<double> weight;
};

Input make_input(std::uint64_t seed, std::size_t batches) {
    Samples draw(seed);
    Input in;
    for (std::size_t k = 0; k < batches; ++k) {
        in.t.push_back(floats(values, [&] { return draw.uniform() < 0.1 ? 0 : draw.lognormal(0.8); }));
        in.m.push_back(in.t.back());
        for (auto& x : in.m.back()) x *= static_cast<float>(draw.uniform());
        in.weight.push_back(static_cast<double>(1 + k % 5));
    }
    return in;
}

std::vector<HostBatch> batches_of(const Input& in) {
    std::vector<HostBatch> out;
    for (std::size_t k = 0; k < in.m.size(); ++k) out.push_back({in.m[k], in.t[k], in.weight[k]});
    return out;
}

const std::vector<cl_mem StatePlanes::*> all_planes{
    &StatePlanes::m,      &StatePlanes::t,       &StatePlanes::mm,       &StatePlanes::tt,     &StatePlanes::mt,
    &StatePlanes::weight, &StatePlanes::batches, &StatePlanes::quotient, &StatePlanes::zero_m, &StatePlanes::zero_share};

std::vector<std::uint32_t> all_bits(const Moments& s) {
    std::vector<std::uint32_t> all;
    for (auto p : all_planes) {
        const auto b = s.bits(p);
        all.insert(all.end(), b.begin(), b.end());
    }
    return all;
}

std::vector<std::uint32_t> twin_bits(const Input& in) {
    std::vector<TwinValue> twin(values);
    for (std::size_t k = 0; k < in.m.size(); ++k)
        for (std::size_t i = 0; i < values; ++i) twin[i].add(in.m[k][i], in.t[k][i], in.weight[k]);
    std::vector<std::uint32_t> all;
    const auto two = [&](auto part) {
        for (auto& v : twin) all.push_back(std::bit_cast<std::uint32_t>(part(v).hi));
        for (auto& v : twin) all.push_back(std::bit_cast<std::uint32_t>(part(v).lo));
    };
    two([](const TwinValue& v) { return v.moments.m; });
    two([](const TwinValue& v) { return v.moments.t; });
    two([](const TwinValue& v) { return v.moments.mm; });
    two([](const TwinValue& v) { return v.moments.tt; });
    two([](const TwinValue& v) { return v.moments.mt; });
    two([](const TwinValue& v) { return v.weight; });
    for (auto& v : twin) all.push_back(v.batches);
    two([](const TwinValue& v) { return v.ratios.quotient; });
    two([](const TwinValue& v) { return v.ratios.zero_m; });
    two([](const TwinValue& v) { return v.ratios.zero_share; });
    return all;
}

}  // namespace

TEST(Moments, same_bits_at_every_shape_and_on_the_host) {
    Input in = make_input(1, 11);
    in.m[3][5] = not_a_number;
    in.t[4][6] = std::numeric_limits<float>::infinity();
    const auto want = twin_bits(in);
    for (const auto& shape : all_shapes()) {
        Moments s{Engine(shape.options), values, {.ratios = true}};
        s.add(batches_of(in));
        EXPECT_EQ(all_bits(s), want) << shape.name;
        EXPECT_EQ(s.skipped(), 2u) << shape.name;
    }
}
