// What fixed-point states are tested against: inputs, sums in big integers, and the host twin.
#pragma once

#include <algorithm>
#include <bit>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "clratio/device/fixed.h"
#include "clratio/fixed.hpp"
#include "support/samples.hpp"

namespace clratio::test {

using Integer = boost::multiprecision::cpp_int;
using Words = std::vector<std::uint64_t>;

inline constexpr std::size_t values = 1003;  // no multiple of any width
inline constexpr float not_a_number = std::numeric_limits<float>::quiet_NaN();
inline constexpr float infinite = std::numeric_limits<float>::infinity();

struct Input {
    std::vector<std::vector<float>> m, t;
    std::vector<double> weight;
};

/// Both signs, zeros, magnitudes from far below the resolution to the edge of the range, weights up to 1000.
inline Input make_input(std::uint64_t seed, std::size_t batches, FixedOptions o = {}) {
    Samples draw(seed);
    const auto value = [&] {
        const double exponent = -o.resolution - 3 + draw.uniform() * (o.range + o.resolution + 3);
        return draw.uniform() < 0.1 ? 0.0 : std::copysign(std::exp2(exponent), draw.uniform() - 0.3);
    };
    Input in;
    for (std::size_t k = 0; k < batches; ++k) {
        in.m.push_back(floats(values, value));
        in.t.push_back(floats(values, value));
        in.weight.push_back(static_cast<double>(1 + draw.bits() % 1000));
    }
    return in;
}

inline std::vector<HostBatch> batches_of(const Input& in) {
    std::vector<HostBatch> out;
    for (std::size_t k = 0; k < in.m.size(); ++k) out.push_back({in.m[k], in.t[k], in.weight[k]});
    return out;
}

inline const std::vector<cl_mem FixedPlanes::*> all_planes{&FixedPlanes::m,      &FixedPlanes::t,  &FixedPlanes::mm,
                                                           &FixedPlanes::tt,     &FixedPlanes::mt, &FixedPlanes::weight,
                                                           &FixedPlanes::batches};

inline Words all_limbs(const FixedMoments& s) {
    Words all;
    for (auto p : all_planes) {
        const auto plane = s.limbs(p);
        all.insert(all.end(), plane.begin(), plane.end());
    }
    return all;
}

// ---- the oracle: big integers, rounded by the host's own double arithmetic

struct Exact {
    Integer m = 0, t = 0, mm = 0, tt = 0, mt = 0, weight = 0;
    std::uint64_t batches = 0;
};

inline bool takes(float x, FixedOptions o) { return std::fabs(static_cast<double>(x)) <= std::exp2(o.range); }

inline Integer quantised(float x, FixedOptions o) {
    return Integer(std::nearbyint(static_cast<double>(x) * std::exp2(o.resolution)));
}

inline std::vector<Exact> exact_sums(const Input& in, FixedOptions o = {}) {
    std::vector<Exact> all(in.m.front().size());
    for (std::size_t k = 0; k < in.m.size(); ++k)
        for (std::size_t i = 0; i < all.size(); ++i) {
            if (!takes(in.m[k][i], o) || !takes(in.t[k][i], o)) continue;
            const Integer m = quantised(in.m[k][i], o), t = quantised(in.t[k][i], o);
            const Integer w(static_cast<std::uint64_t>(in.weight[k]));
            Exact& e = all[i];
            e.m += w * m;
            e.t += w * t;
            e.mm += w * m * m;
            e.tt += w * t * t;
            e.mt += w * m * t;
            e.weight += w;
            ++e.batches;
        }
    return all;
}

inline std::uint64_t limb(const Integer& x, unsigned which) {
    const Integer two_complement = x < 0 ? x + (Integer(1) << 128) : x;
    return static_cast<std::uint64_t>((two_complement >> (64 * which)) & Integer(~std::uint64_t{0}));
}

inline Words words_of(const std::vector<Exact>& sums) {
    Words all;
    const auto put = [&](Integer Exact::*part, unsigned limbs) {
        for (unsigned k = 0; k < limbs; ++k)
            for (const Exact& e : sums) all.push_back(limb(e.*part, k));
    };
    put(&Exact::m, 1);
    put(&Exact::t, 1);
    put(&Exact::mm, 2);
    put(&Exact::tt, 2);
    put(&Exact::mt, 2);
    put(&Exact::weight, 1);
    for (const Exact& e : sums) all.push_back(e.batches);
    return all;
}

/// numerator / divisor 2^exponent.
struct Fraction {
    Integer numerator, divisor;
    int exponent;
};

/// The nearest float, ties to even, 0 below 2^-126; x becomes what it leaves.
inline float nearest(Fraction& x) {
    const bool negative = x.numerator < 0;
    Integer size = abs(x.numerator);
    if (size == 0) return 0;
    int e = static_cast<int>(msb(size)) - static_cast<int>(msb(x.divisor)) - 23;
    const auto scaled = [&] { return e < 0 ? Integer(size << -e) : size; };
    const auto unit = [&] { return e > 0 ? Integer(x.divisor << e) : x.divisor; };
    if (scaled() / unit() < (1 << 23)) --e;
    Integer digits = scaled() / unit(), rest = scaled() % unit();
    if (2 * rest > unit() || (2 * rest == unit() && digits % 2 == 1)) {
        ++digits;
        rest -= unit();
    }
    const double value = std::ldexp(static_cast<double>(digits), e + x.exponent);
    x.numerator = negative ? Integer(-rest) : rest;
    x.exponent += std::min(e, 0);
    return value < 0x1p-126 ? 0 : static_cast<float>(negative ? -value : value);
}

inline std::vector<float> pairs_of(const std::vector<Exact>& sums, FixedOptions o = {}) {
    std::vector<float> all;
    const auto put = [&](auto numerator, int exponent) {
        std::vector<float> lo;
        for (const Exact& e : sums) {
            Fraction x{numerator(e), e.weight == 0 ? Integer(1) : e.weight, exponent};
            all.push_back(nearest(x));
            lo.push_back(nearest(x));
        }
        all.insert(all.end(), lo.begin(), lo.end());
    };
    put([](const Exact& e) { return e.m; }, -o.resolution);
    put([](const Exact& e) { return e.t; }, -o.resolution);
    put([](const Exact& e) { return Integer(e.weight * e.mm - e.m * e.m); }, -2 * o.resolution);
    put([](const Exact& e) { return Integer(e.weight * e.tt - e.t * e.t); }, -2 * o.resolution);
    put([](const Exact& e) { return Integer(e.weight * e.mt - e.m * e.t); }, -2 * o.resolution);
    return all;
}

inline std::vector<float> floats_of(const std::vector<std::uint32_t>& bits) {
    std::vector<float> all;
    for (auto b : bits) all.push_back(std::bit_cast<float>(b));
    return all;
}

inline std::vector<float> pairs_of(const Moments& s) {
    std::vector<float> all;
    for (auto p : {&StatePlanes::m, &StatePlanes::t, &StatePlanes::mm, &StatePlanes::tt, &StatePlanes::mt}) {
        const auto part = floats_of(s.bits(p));
        all.insert(all.end(), part.begin(), part.end());
    }
    return all;
}

// ---- the host twin

inline std::vector<device::clr_fixed> twin_sums(const Input& in, FixedOptions o = {}) {
    std::vector<device::clr_fixed> all(in.m.front().size());
    const auto scale = static_cast<float>(std::exp2(o.resolution)), limit = static_cast<float>(std::exp2(o.range));
    for (std::size_t k = 0; k < in.m.size(); ++k)
        for (std::size_t i = 0; i < all.size(); ++i) {
            const auto one = device::clr_fixed_take(device::clr_fixed_run_zero(), in.m[k][i], in.t[k][i], scale, limit);
            all[i] = device::clr_fixed_add(all[i], one, static_cast<std::uint64_t>(in.weight[k]));
        }
    return all;
}

inline Words words_of(const std::vector<device::clr_fixed>& sums) {
    Words all;
    const auto put = [&](auto part) {
        for (const auto& s : sums) all.push_back(part(s));
    };
    using S = device::clr_fixed;
    put([](const S& s) { return s.m; });
    put([](const S& s) { return s.t; });
    put([](const S& s) { return s.mm.lo; });
    put([](const S& s) { return s.mm.hi; });
    put([](const S& s) { return s.tt.lo; });
    put([](const S& s) { return s.tt.hi; });
    put([](const S& s) { return s.mt.lo; });
    put([](const S& s) { return s.mt.hi; });
    put([](const S& s) { return s.weight; });
    put([](const S& s) { return std::uint64_t{s.batches}; });
    return all;
}

inline std::vector<float> pairs_of(const std::vector<device::clr_fixed>& sums, FixedOptions o = {}) {
    std::vector<float> all;
    for (auto part : {&device::clr_moments::m, &device::clr_moments::t, &device::clr_moments::mm, &device::clr_moments::tt,
                      &device::clr_moments::mt})
        for (auto half : {&device::clr_two::hi, &device::clr_two::lo})
            for (const auto& s : sums)
                all.push_back(device::clr_fixed_moments(s, static_cast<std::uint32_t>(o.resolution)).*part.*half);
    return all;
}

/// Batches that a state must leave out here and there.
inline Input spoiled(std::uint64_t seed, std::size_t batches) {
    Input in = make_input(seed, batches);
    in.m[1][3] = not_a_number;
    in.t[2][700] = -infinite;
    in.m[2][5] = std::nextafter(65536.0f, infinite);
    in.t[1][5] = -1e30f;
    in.m[0][values - 1] = infinite;
    in.t[0][values - 1] = 1e30f;
    return in;
}

}  // namespace clratio::test
