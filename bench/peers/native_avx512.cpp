// Compiled for AVX-512 F and DQ; called only where the machine has them.
#include <immintrin.h>

#include "native_kernels.hpp"

namespace peers {
namespace {

struct V {
    using F = __m512;
    using U = __m512i;
    static constexpr std::uint64_t lane_count = 16;
    static F set(float x) { return _mm512_set1_ps(x); }
    static U set_word(std::uint32_t x) { return _mm512_set1_epi32(static_cast<int>(x)); }
    static U set_wide(std::uint32_t x) { return _mm512_set1_epi64(static_cast<long long>(x)); }
    static U lanes() { return _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15); }
    static F sub(F a, F b) { return _mm512_sub_ps(a, b); }
    static F mul(F a, F b) { return _mm512_mul_ps(a, b); }
    static F div(F a, F b) { return _mm512_div_ps(a, b); }
    static F fma(F a, F b, F c) { return _mm512_fmadd_ps(a, b, c); }
    static U add(U a, U b) { return _mm512_add_epi32(a, b); }
    static U sub(U a, U b) { return _mm512_sub_epi32(a, b); }
    static U mul_low(U a, U b) { return _mm512_mullo_epi32(a, b); }
    static U mul_wide(U a, U b) { return _mm512_mul_epu32(a, b); }
    static U high(U a) { return _mm512_srli_epi64(a, 32); }
    static U join(U even, U odd) { return _mm512_mask_blend_epi32(0xaaaa, even, _mm512_slli_epi64(odd, 32)); }
    static U bit_and(U a, U b) { return _mm512_and_si512(a, b); }
    static U and_not(U a, U b) { return _mm512_andnot_si512(a, b); }
    static U bit_or(U a, U b) { return _mm512_or_si512(a, b); }
    static U bit_xor(U a, U b) { return _mm512_xor_si512(a, b); }
    static U bit_xor(U a, U b, U c) { return _mm512_ternarylogic_epi32(a, b, c, 0x96); }
    template <int n> static U shift_left(U a) { return _mm512_slli_epi32(a, n); }
    template <int n> static U shift_right(U a) { return _mm512_srli_epi32(a, n); }
    template <int n> static U shift_right_signed(U a) { return _mm512_srai_epi32(a, n); }
    static U bits(F a) { return _mm512_castps_si512(a); }
    static F from_bits(U a) { return _mm512_castsi512_ps(a); }
    static F from_unsigned(U a) { return _mm512_cvtepu32_ps(a); }
    static F from_signed(U a) { return _mm512_cvtepi32_ps(a); }

    using M = __mmask16;
    static F add(F a, F b) { return _mm512_add_ps(a, b); }
    static F min(F a, F b) { return _mm512_min_ps(a, b); }
    static F max(F a, F b) { return _mm512_max_ps(a, b); }
    static F load(const float* p) { return _mm512_load_ps(p); }
    static void store(F a, float* p) { _mm512_store_ps(p, a); }
    static M ge(F a, F b) { return _mm512_cmp_ps_mask(a, b, _CMP_GE_OQ); }
    static M both(M a, M b) { return _kand_mask16(a, b); }
    static F blend(F a, F b, M from_b) { return _mm512_mask_blend_ps(from_b, a, b); }
    static F where_zero(U e, F a, F b) { return _mm512_mask_blend_ps(_mm512_testn_epi32_mask(e, e), b, a); }

    static void store_in_turn(F even, F odd, float* out) {
        const U low = _mm512_setr_epi32(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
        const U high = _mm512_setr_epi32(8, 24, 9, 25, 10, 26, 11, 27, 12, 28, 13, 29, 14, 30, 15, 31);
        _mm512_storeu_ps(out, _mm512_permutex2var_ps(even, low, odd));
        _mm512_storeu_ps(out + 16, _mm512_permutex2var_ps(even, high, odd));
    }

    static void store_slots(F x, const Binning& b, std::uint32_t* slot) {
        const F lo = set(b.lo), hi = set(b.hi);
        const __mmask16 not_under = _mm512_cmp_ps_mask(x, lo, _CMP_GE_OQ),
                        inside = _mm512_mask_cmp_ps_mask(not_under, x, hi, _CMP_LT_OQ);
        const __mmask16 under = _mm512_cmp_ps_mask(x, lo, _CMP_LT_OQ), over = _mm512_cmp_ps_mask(x, hi, _CMP_GE_OQ);
        const F u = _mm512_min_ps(mul(sub(x, lo), set(b.inverse_width)), set(static_cast<float>(b.bins - 1)));
        U s = _mm512_mask_cvttps_epi32(set_word(b.bins + 2), inside, u);
        s = _mm512_mask_mov_epi32(s, under, set_word(b.bins));
        _mm512_store_si512(slot, _mm512_mask_mov_epi32(s, over, set_word(b.bins + 1)));
    }
};

}  // namespace

const NativeSet native_avx512{"AVX-512", NativeKernels<V>::samples, NativeKernels<V>::histogram, NativeKernels<V>::medium,
                              V::lane_count};

}  // namespace peers
