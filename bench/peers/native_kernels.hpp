// Written on V: a vector of floats (V::F), of 32-bit words (V::U) and of 64-bit lanes (V::U, half as many).
#pragma once

#include <algorithm>
#include <array>

#include "native.hpp"
#include "native_medium.hpp"

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
        explicit Philox(const clratio::Stream& stream, std::uint32_t of_domain = CLR_DOMAIN_ERROR)
            : id(V::set_word(stream.id)), domain(V::set_word(of_domain)) {
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

    static F load(const Lanes& lanes) { return V::load(lanes); }
    static F clamp(F x, F lo, F hi) { return V::min(V::max(x, lo), hi); }
    static F uniform(U word) {
        const U odd = V::bit_or(V::template shift_left<1>(V::template shift_right<9>(word)), V::set_word(1));
        return V::mul(V::from_signed(odd), V::set(0x1p-24f));
    }

    static F exp2(F y) {
        const F c = clamp(y, V::set(-125.0f), V::set(125.0f)), magic = V::set(0x1.8p23f);
        const F shifted = V::add(c, magic), r = V::sub(c, V::sub(shifted, magic));
        const F p = horner(r, {1.3264727e-3f, 9.671513e-3f, 5.5507336e-2f, 2.4022242e-1f, 6.931470e-1f, 1.0f});
        return V::from_bits(V::add(V::bits(p), V::template shift_left<23>(V::bits(shifted))));
    }

    static F minus_log1p(F t) {
        const F kept = V::max(t, V::set(-0.99999994f));
        const U bits = V::bits(V::add(kept, V::set(1.0f)));
        const U e = V::template shift_right_signed<23>(V::sub(bits, V::set_word(0x3f3504f3u)));
        const F m = V::from_bits(V::sub(bits, V::template shift_left<23>(e)));
        const F f = V::where_zero(e, kept, V::sub(m, V::set(1.0f)));
        const F p = horner(f, {-7.634499e-2f, 1.2761578e-1f, -1.3160183e-1f, 1.4201757e-1f, -1.6623357e-1f, 2.0001227e-1f,
                               -2.500082e-1f, 3.333333e-1f});
        const F square = V::mul(f, f);
        const F log_m = V::add(f, V::fma(V::mul(square, f), p, V::mul(V::set(-0.5f), square)));
        return V::fma(V::from_signed(e), V::set(-0.69314718f), V::sub(V::set(0.0f), log_m));
    }

    using M = typename V::M;
    static F pick(const Lanes* of, M b, M c) { return V::blend(V::blend(load(of[0]), load(of[1]), b), load(of[2]), c); }
    static F pick(F a0, F a1, F a2, M b, M c) { return V::blend(V::blend(a0, a1, b), a2, c); }

    static M in_box(const float* box, const F* c) {
        M in = V::ge(c[0], V::set(box[6]));
        in = V::both(in, V::ge(V::set(box[7]), c[0]));
        in = V::both(in, V::ge(c[1], V::set(box[8])));
        in = V::both(in, V::ge(V::set(box[9]), c[1]));
        in = V::both(in, V::ge(c[2], V::set(box[10])));
        in = V::both(in, V::ge(V::set(box[11]), c[2]));
        for (int k = 0; k < 3; ++k) in = V::both(in, V::ge(V::set(box[12 + k]), c[3 + k]));
        return in;
    }

    static F lit(const MediumPixels& p, F x, F value) {
        if (!p.spheres.empty()) {
            F c[3];
            for (int k = 0; k < 3; ++k) c[k] = V::fma(load(p.rate[k]), x, load(p.base[k]));
            for (const float* s : p.spheres) {
                const F a = V::sub(c[0], V::set(s[4])), b = V::sub(c[1], V::set(s[5]));
                const F h = V::max(V::sub(c[2], V::set(s[6])), V::set(0.0f));
                const F d = V::fma(a, a, V::fma(b, b, V::mul(h, h)));
                value = V::blend(value, V::set(0.0f), V::ge(V::set(s[3]), d));
            }
        }
        if (!p.boxes.empty()) {
            F c[6];
            for (int k = 0; k < 6; ++k) c[k] = V::fma(load(p.rate[3 + k]), x, load(p.base[3 + k]));
            for (const float* box : p.boxes) value = V::blend(value, V::set(0.0f), in_box(box, c));
        }
        return value;
    }

    struct MediumConstants {
        explicit MediumConstants(const clratio::device::clr_medium& s) {
            for (int c = 0; c < 3; ++c) {
                strength[c] = V::set(s.strength[c]);
                inverse_sigma[c] = V::set(s.inverse_sigma[c]);
                decay[c] = V::set((s.sigma[0] - s.sigma[c]) * CLR_LOG2_E);
            }
        }
        F strength[3], inverse_sigma[3], decay[3];
    };

    static void medium_sample(const MediumConstants& s, const MediumPixels& p, F u, F* m, F* t) {
        const M b = V::ge(u, load(p.channel_from[0])), c2 = V::ge(u, load(p.channel_from[1]));
        const M in1 = V::ge(u, pick(load(p.piece_from[0][0]), load(p.piece_from[1][0]), load(p.piece_from[2][0]), b, c2));
        const M in2 = V::ge(u, pick(load(p.piece_from[0][1]), load(p.piece_from[1][1]), load(p.piece_from[2][1]), b, c2));
        F slope[3], offset[3];
        for (int i = 0; i < 3; ++i) {
            slope[i] = pick(load(p.slope[0][i]), load(p.slope[1][i]), load(p.slope[2][i]), b, c2);
            offset[i] = pick(load(p.offset[0][i]), load(p.offset[1][i]), load(p.offset[2][i]), b, c2);
        }
        const F at =
            V::fma(pick(slope[0], slope[1], slope[2], in1, in2), u, pick(offset[0], offset[1], offset[2], in1, in2));
        const F inverse = pick(s.inverse_sigma[0], s.inverse_sigma[1], s.inverse_sigma[2], b, c2);
        const F above = clamp(V::mul(minus_log1p(at), inverse), V::set(0.0f), pick(p.rise, in1, in2));
        const F phi = V::add(pick(p.low, in1, in2), above);
        const F x = clamp(V::fma(above, pick(p.stride, in1, in2), pick(p.start, in1, in2)), V::set(0.0f), load(p.length));
        const F e1 = V::mul(s.strength[1], exp2(V::mul(s.decay[1], phi)));
        const F e2 = V::mul(s.strength[2], exp2(V::mul(s.decay[2], phi)));
        const F whole = V::div(load(p.scale), V::add(V::add(s.strength[0], e1), e2));
        const F one[3] = {V::mul(s.strength[0], whole), V::mul(e1, whole), V::mul(e2, whole)};
        const F seen = lit(p, x, V::set(1.0f));
        for (int c = 0; c < 3; ++c) {
            t[c] = V::add(t[c], one[c]);
            m[c] = V::fma(one[c], seen, m[c]);
        }
    }

    template <class Source>
    static void medium_sums(const MediumConstants& s, const MediumPixels& p, const Source& draw, std::uint32_t samples,
                            MediumSums& out) {
        F m[3], t[3];
        for (int c = 0; c < 3; ++c) m[c] = t[c] = V::set(0.0f);
        for (std::uint32_t from = 0; from < samples; from += CLR_SUM_CHUNK) {
            F chunk_m[3], chunk_t[3];
            for (int c = 0; c < 3; ++c) chunk_m[c] = chunk_t[c] = V::set(0.0f);
            for (std::uint32_t quad = from / 4; quad < std::min(samples, from + CLR_SUM_CHUNK) / 4; ++quad) {
                const Words w = draw(std::uint64_t{quad} << 32 | p.pixel);
                for (const U& word : w) medium_sample(s, p, uniform(word), chunk_m, chunk_t);
            }
            for (int c = 0; c < 3; ++c) {
                m[c] = V::add(m[c], chunk_m[c]);
                t[c] = V::add(t[c], chunk_t[c]);
            }
        }
        for (int c = 0; c < 3; ++c) {
            V::store(m[c], out.m[c]);
            V::store(t[c], out.t[c]);
        }
    }

    static void medium(const clratio::device::clr_medium& scene, const MediumPixels* pixels, std::size_t count,
                       clratio::Stream stream, std::uint32_t samples, MediumSums* out) {
        const MediumConstants s(scene);
        const Philox draw(stream, CLR_DOMAIN_SCENE);
        for (std::size_t i = 0; i < count; ++i) medium_sums(s, pixels[i], draw, samples, out[i]);
    }
};

}  // namespace peers
