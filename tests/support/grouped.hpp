// Batches whose values are asked for group by group, and what the reference and the twin make of them.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "clratio/combine.hpp"
#include "clratio/estimator.hpp"
#include "support/samples.hpp"
#include "support/twin.hpp"

namespace clratio::test {

constexpr std::size_t values = 517;
constexpr std::uint32_t group_count = 5;
constexpr std::size_t batch_count = 23;
inline const std::vector<float> taus(values, 1.25f);

struct GroupedInput {
    std::vector<std::vector<float>> m, t;
    std::vector<double> weight;
};

/// Correlated positive pairs with zeros in m; unequal weights; group k mod 5.
inline GroupedInput input_of(std::uint64_t seed, std::size_t batches = batch_count) {
    Samples draw(seed);
    GroupedInput in;
    for (std::size_t k = 0; k < batches; ++k) {
        in.t.push_back(floats(values, [&] { return draw.lognormal(0.5); }));
        in.m.push_back(in.t.back());
        for (auto& x : in.m.back()) x *= draw.uniform() < 0.3 ? 0 : static_cast<float>(0.5 + draw.uniform());
        in.weight.push_back(static_cast<double>(1 + k % 4));
    }
    return in;
}

/// One batch of each value is far off in m, in t, or in both, by up to 1e8; every eighth value has t = 2 everywhere.
inline GroupedInput with_fireflies(GroupedInput in) {
    const std::size_t batches = in.m.size();
    for (std::size_t i = 0; i < values; ++i) {
        const std::size_t k = i % batches, what = i % 4;
        const float far = std::pow(10.0f, static_cast<float>(i % 9));
        if (what != 1) in.m[k][i] = (in.m[k][i] + 0.5f) * far;
        if (what != 2) in.t[k][i] *= far;
        for (std::size_t b = 0; i % 8 == 7 && b < batches; ++b) in.t[b][i] = 2;
    }
    return in;
}

inline Moments moments_of(const Engine& engine, const GroupedInput& in, MomentsOptions options) {
    Moments s(engine, values, options);
    std::vector<HostBatch> batches;
    for (std::size_t k = 0; k < in.m.size(); ++k) batches.push_back({in.m[k], in.t[k], in.weight[k]});
    s.add(batches);
    return s;
}

constexpr MomentsOptions everything{.ratios = true, .groups = group_count};

inline std::vector<Statistics> reference(const GroupedInput& in, std::size_t value) {
    std::vector<Statistics> groups(group_count);
    for (std::size_t k = 0; k < in.m.size(); ++k)
        groups[k % group_count].add(static_cast<double>(in.m[k][value]), static_cast<double>(in.t[k][value]), in.weight[k]);
    return groups;
}

/// Groups of a value as the kernels have them.
inline std::vector<TwinValue> twins(const GroupedInput& in, std::size_t value) {
    std::vector<TwinValue> groups(group_count);
    for (std::size_t k = 0; k < in.m.size(); ++k) groups[k % group_count].add(in.m[k][value], in.t[k][value], in.weight[k]);
    return groups;
}

/// How far device and twin may be from the cross-fitted regression in double: groups.h bounds each slope.
inline double crossfit_bound(std::span<const Statistics> groups, double tau) {
    Statistics all;
    for (const auto& g : groups) all.merge(g);
    double bound = 16 * 0x1p-24 * std::fabs(all.mean_m);
    for (const auto& g : groups) {
        Statistics rest;
        for (const auto& other : groups)
            if (&other != &g) rest.merge(other);
        if (!(rest.m2_t > 0)) continue;
        const double moved = g.weight / all.weight * std::fabs(g.mean_t - tau);
        const double root = std::sqrt(rest.m2_m / rest.m2_t), slope = std::fabs(rest.c_mt / rest.m2_t);
        bound += moved * ((group_count + 2) * 0x1p-14 * root + 16 * 0x1p-24 * slope);
    }
    return bound;
}

}  // namespace clratio::test
