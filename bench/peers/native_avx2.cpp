// Compiled for AVX2 and FMA; called only where the machine has them.
#include <immintrin.h>

#include "native_kernels.hpp"

namespace peers {
namespace {

struct V {
    using F = __m256;
    using U = __m256i;
    static constexpr std::uint64_t lane_count = 8;
    static F set(float x) { return _mm256_set1_ps(x); }
    static U set_word(std::uint32_t x) { return _mm256_set1_epi32(static_cast<int>(x)); }
    static U set_wide(std::uint32_t x) { return _mm256_set1_epi64x(static_cast<long long>(x)); }
    static U lanes() { return _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7); }
    static F sub(F a, F b) { return _mm256_sub_ps(a, b); }
    static F mul(F a, F b) { return _mm256_mul_ps(a, b); }
    static F div(F a, F b) { return _mm256_div_ps(a, b); }
    static F fma(F a, F b, F c) { return _mm256_fmadd_ps(a, b, c); }
    static U add(U a, U b) { return _mm256_add_epi32(a, b); }
    static U sub(U a, U b) { return _mm256_sub_epi32(a, b); }
    static U mul_low(U a, U b) { return _mm256_mullo_epi32(a, b); }
    static U mul_wide(U a, U b) { return _mm256_mul_epu32(a, b); }
    static U high(U a) { return _mm256_srli_epi64(a, 32); }
    static U join(U even, U odd) { return _mm256_blend_epi32(even, _mm256_slli_epi64(odd, 32), 0xaa); }
    static U bit_and(U a, U b) { return _mm256_and_si256(a, b); }
    static U and_not(U a, U b) { return _mm256_andnot_si256(a, b); }
    static U bit_or(U a, U b) { return _mm256_or_si256(a, b); }
    static U bit_xor(U a, U b) { return _mm256_xor_si256(a, b); }
    static U bit_xor(U a, U b, U c) { return bit_xor(bit_xor(a, b), c); }
    template <int n> static U shift_left(U a) { return _mm256_slli_epi32(a, n); }
    template <int n> static U shift_right(U a) { return _mm256_srli_epi32(a, n); }
    template <int n> static U shift_right_signed(U a) { return _mm256_srai_epi32(a, n); }
    static U bits(F a) { return _mm256_castps_si256(a); }
    static F from_bits(U a) { return _mm256_castsi256_ps(a); }
    static F from_signed(U a) { return _mm256_cvtepi32_ps(a); }

    using M = __m256;
    static F add(F a, F b) { return _mm256_add_ps(a, b); }
    static F min(F a, F b) { return _mm256_min_ps(a, b); }
    static F max(F a, F b) { return _mm256_max_ps(a, b); }
    static F load(const float* p) { return _mm256_load_ps(p); }
    static void store(F a, float* p) { _mm256_store_ps(p, a); }
    static M ge(F a, F b) { return _mm256_cmp_ps(a, b, _CMP_GE_OQ); }
    static M both(M a, M b) { return _mm256_and_ps(a, b); }
    static F blend(F a, F b, M from_b) { return _mm256_blendv_ps(a, b, from_b); }
    static F where_zero(U e, F a, F b) { return blend(b, a, from_bits(_mm256_cmpeq_epi32(e, set_word(0)))); }

    // 2^39 + high half and 2^23 + low half are exact; their sum is rounded once.
    static F from_unsigned(U a) {
        const F low = from_bits(_mm256_blend_epi16(a, set_word(0x4b000000u), 0xaa));
        const F high = from_bits(bit_or(shift_right<16>(a), set_word(0x53000000u)));
        return _mm256_add_ps(sub(high, set(0x1p39f + 0x1p23f)), low);
    }

    static void store_in_turn(F even, F odd, float* out) {
        const F low = _mm256_unpacklo_ps(even, odd), high = _mm256_unpackhi_ps(even, odd);
        _mm256_storeu_ps(out, _mm256_permute2f128_ps(low, high, 0x20));
        _mm256_storeu_ps(out + 8, _mm256_permute2f128_ps(low, high, 0x31));
    }

    static void store_slots(F x, const Binning& b, std::uint32_t* slot) {
        const F lo = set(b.lo), hi = set(b.hi);
        const F under = _mm256_cmp_ps(x, lo, _CMP_LT_OQ), over = _mm256_cmp_ps(x, hi, _CMP_GE_OQ),
                nan = _mm256_cmp_ps(x, x, _CMP_UNORD_Q);
        const F u = _mm256_min_ps(mul(sub(x, lo), set(b.inverse_width)), set(static_cast<float>(b.bins - 1)));
        F s = from_bits(_mm256_cvttps_epi32(u));
        s = _mm256_blendv_ps(s, from_bits(set_word(b.bins)), under);
        s = _mm256_blendv_ps(s, from_bits(set_word(b.bins + 1)), over);
        s = _mm256_blendv_ps(s, from_bits(set_word(b.bins + 2)), nan);
        _mm256_store_si256(reinterpret_cast<U*>(slot), bits(s));
    }
};

}  // namespace

const NativeSet native_avx2{"AVX2", NativeKernels<V>::samples, NativeKernels<V>::histogram, NativeKernels<V>::medium,
                            V::lane_count};

}  // namespace peers
