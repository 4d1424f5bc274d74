// Written on V: a vector of floats (V::F), of 32-bit words (V::U) and of 64-bit lanes (V::U, half as many).
#pragma once

#include <array>

#include "native.hpp"

namespace peers {

template <class V> struct NativeKernels {
    using F = typename V::F;
    using U = typename V::U;
    struct Fraction {
        F n, d;
    };

    static F horner(F x, std::initializer_list<float> descending) {
        auto c = descending.begin();
        F r = V::set(*c++);
        while (c != descending.end()) r = V::fma(r, x, V::set(*c++));
        return r;
    }

    static Fraction normal(U h) {
        const U twice_j = V::template shift_left<1>(V::bit_xor(h, V::template shift_right_signed<31>(h)));
        const F p = V::from_unsigned(V::bit_or(twice_j, V::set_word(1))),
                x = V::from_unsigned(V::and_not(twice_j, V::set_word(~0u)));
        const U bits = V::bits(V::mul(p, V::sub(V::set(0x1p33f), p)));
        const F linear = V::from_signed(V::sub(V::set_word((127u + 64u) << 23), bits));
        const F m = V::from_bits(V::bit_or(V::bit_and(bits, V::set_word(0x007fffffu)), V::set_word(0x3f800000u)));
        const F rest = horner(V::sub(m, V::set(1.5f)), {-0x1.578afap-7f, 0x1.1d506cp-6f, -0x1.a7b9fep-6f, 0x1.90d388p-5f,
                                                        -0x1.94b470p-4f, 0x1.c72898p-3f, 0x1.b1df26p-6f, -0x1.e270dap-5f});
        const F w = V::fma(linear, V::set(0.69314718f * 0x1p-23f), rest);
        const F n = horner(w, {0x1.9a375cp-55f, 0x1.f15ec8p-47f, 0x1.2a3ef2p-42f, 0x1.9a4af0p-39f, 0x1.74b766p-36f,
                               0x1.ca2b34p-34f, 0x1.40d932p-32f});
        const F d = horner(w, {0x1.f56f24p-19f, 0x1.046adcp-12f, 0x1.2eeb74p-9f, 0x1.1bda8ap-5f, 0x1.85ee80p-4f, 1.0f});
        const U sign = V::and_not(h, V::set_word(0x80000000u));
        return {V::from_bits(V::bit_xor(V::bits(V::mul(x, n)), sign)), d};
    }

    struct Law {
        F s, a, b;
    };

    static F sample(const Law& law, U word1, U word2) {
        const Fraction z1 = normal(word1), z2 = normal(word2);
        const F residual = V::fma(law.a, V::mul(z2.n, z1.d), V::mul(law.b, V::mul(z1.n, z2.d)));
        return V::div(residual, V::mul(z1.d, V::fma(law.s, z2.n, z2.d)));
    }

    using Words = std::array<U, 4>;

    /// Rounds on 64-bit lanes whose high halves are never cleared, the even and the odd lanes side by side; the round keys
    /// are spread over the lanes once.
    struct Philox {
        explicit Philox(const clratio::Stream& stream) : id(V::set_word(stream.id)), domain(V::set_word(CLR_DOMAIN_ERROR)) {
            const auto k0 = static_cast<std::uint32_t>(stream.seed), k1 = static_cast<std::uint32_t>(stream.seed >> 32);
            for (std::uint32_t round = 0; round < 10; ++round) {
                key0[round] = V::set_wide(k0 + round * 0x9e3779b9u);
                key1[round] = V::set_wide(k1 + round * 0xbb67ae85u);
            }
        }

        void round(Words& c, std::size_t r) const {
            const U p0 = V::mul_wide(c[0], V::set_word(0xd2511f53u)), p1 = V::mul_wide(c[2], V::set_word(0xcd9e8d57u));
            c = {V::bit_xor(V::high(p1), c[1], key0[r]), p1, V::bit_xor(V::high(p0), c[3], key1[r]), p0};
        }

        Words operator()(std::uint64_t block) const {
            const U low = V::add(V::set_word(static_cast<std::uint32_t>(block)), V::lanes());
            const U high = V::set_word(static_cast<std::uint32_t>(block >> 32));
            Words even{low, high, id, domain}, odd{V::high(low), high, id, domain};
#pragma GCC unroll 10
            for (std::size_t r = 0; r < 10; ++r) {
                round(even, r);
                round(odd, r);
            }
            for (std::size_t i = 0; i < 4; ++i) even[i] = V::join(even[i], odd[i]);
            return even;
        }

        U id, domain;
        std::array<U, 10> key0, key1;
    };

    struct Pcg4d3x {
        explicit Pcg4d3x(const clratio::Stream& stream)
            : id(start(V::set_word(stream.id))), seed(start(V::set_word(static_cast<std::uint32_t>(stream.seed)))) {}

        static U start(U x) { return V::add(V::mul_low(x, V::set_word(1664525u)), V::set_word(1013904223u)); }

        Words operator()(std::uint64_t block) const {
            const U low = V::add(V::set_word(static_cast<std::uint32_t>(block)), V::lanes());
            const U high = V::set_word(static_cast<std::uint32_t>(block >> 32) | CLR_DOMAIN_ERROR << 28);
            Words v{start(low), start(high), id, seed};
#pragma GCC unroll 3
            for (int round = 0; round < 3; ++round) {
                v[0] = V::add(v[0], V::mul_low(v[1], v[3]));
                v[1] = V::add(v[1], V::mul_low(v[2], v[0]));
                v[2] = V::add(v[2], V::mul_low(v[0], v[1]));
                v[3] = V::add(v[3], V::mul_low(v[1], v[2]));
                for (U& x : v) x = V::bit_xor(x, V::template shift_right<16>(x));
            }
            return v;
        }

        U id, seed;
    };

    template <class Source, class Take>
    static void each(const Law& law, const Source& draw, std::uint64_t first, std::uint64_t count, Take take) {
        for (std::uint64_t i = 0; i < count; i += 2 * V::lane_count) {
            const Words w = draw((first + i) / 2);
            take(i, sample(law, w[0], w[1]), sample(law, w[2], w[3]));
        }
    }

    template <class Take>
    static void each(clratio::device::clr_canonical law, const clratio::Stream& stream, std::uint64_t first,
                     std::uint64_t count, Take take) {
        const Law wide{V::set(law.s), V::set(law.a), V::set(law.b)};
        if (stream.generator == clratio::Generator::philox)
            each(wide, Philox(stream), first, count, take);
        else
            each(wide, Pcg4d3x(stream), first, count, take);
    }

    static void samples(clratio::device::clr_canonical law, clratio::Stream stream, std::uint64_t first, std::uint64_t count,
                        float* out) {
        each(law, stream, first, count, [out](std::uint64_t i, F even, F odd) { V::store_in_turn(even, odd, out + i); });
    }

    static void histogram(clratio::device::clr_canonical law, clratio::Stream stream, std::uint64_t first,
                          std::uint64_t count, Binning b, std::uint32_t* row) {
        // The slots of one step are counted in the next, when they have left the store buffer.
        constexpr std::size_t step = 2 * V::lane_count;
        alignas(64) std::uint32_t slot[2 * step];
        std::size_t current = 0, waiting = 0;
        each(law, stream, first, count, [&](std::uint64_t, F even, F odd) {
            V::store_slots(even, b, slot + current);
            V::store_slots(odd, b, slot + current + V::lane_count);
            current ^= step;
            for (std::size_t i = 0; i < waiting; ++i) ++row[slot[current + i]];
            waiting = step;
        });
        for (std::size_t i = 0; i < waiting; ++i) ++row[slot[(current ^ step) + i]];
    }
};

}  // namespace peers
