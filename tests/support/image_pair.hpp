// A pair of images and its tau, as arrays of values.
#pragma once

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "clratio/combine.hpp"
#include "support/samples.hpp"

namespace clratio::test {

constexpr std::size_t values = 5001;

struct Pair {
    std::vector<float> m, t, tau;
};

/// 0 <= m <= t, with zeros in t, in tau and in both.
inline Pair make_pair_of(std::uint64_t seed, std::size_t count = values) {
    Samples draw(seed);
    Pair p;
    p.t = floats(count, [&] { return draw.uniform() < 0.1 ? 0 : draw.lognormal(0.8); });
    p.m = p.t;
    for (auto& x : p.m) x *= static_cast<float>(draw.uniform());
    p.tau = floats(count, [&] { return draw.uniform() < 0.1 ? 0 : draw.uniform(); });
    return p;
}

template <class T> std::vector<std::uint32_t> bits(const std::vector<T>& v) {
    std::vector<std::uint32_t> b;
    for (const auto& x : v) b.push_back(std::bit_cast<std::uint32_t>(x));
    return b;
}

inline Combined combine_pair(const Engine& engine, const Pair& p, Zero zero = Zero::mc_mean) {
    return combine(engine, p.m, p.t, Tau(std::span<const float>(p.tau)), {.zero = zero});
}

}  // namespace clratio::test
