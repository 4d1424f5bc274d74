// The same maths as kernels/error.cl and kernels/histogram.cl in the machine's own vector instructions: the limit that the
// benches compare with. AVX-512 or AVX2, chosen at run time; one thread a core.
#pragma once

#include <cstdint>
#include <span>

#include "clratio/error.hpp"
#include "clratio/medium.hpp"

namespace peers {

struct Binning {
    float lo, hi, inverse_width;
    std::uint32_t bins;
};

struct MediumPixels;
struct MediumSums;

/// One thread's work in one instruction set. first and count are multiples of 32; row has bins + 3 counters.
struct NativeSet {
    const char* name;
    void (*samples)(clratio::device::clr_canonical law, clratio::Stream stream, std::uint64_t first, std::uint64_t count,
                    float* out);
    void (*histogram)(clratio::device::clr_canonical law, clratio::Stream stream, std::uint64_t first, std::uint64_t count,
                      Binning binning, std::uint32_t* row);
    void (*medium)(const clratio::device::clr_medium& scene, const MediumPixels* pixels, std::size_t count,
                   clratio::Stream stream, std::uint32_t samples, MediumSums* out);  ///< see native_medium.hpp
    std::size_t lanes;
};
extern const NativeSet native_avx2, native_avx512;

/// The best set this machine has, or null where it has neither.
const NativeSet* native_set();

/// All cores. stream.domain is CLR_DOMAIN_ERROR whatever it says.
void native_samples(const NativeSet& set, const clratio::Canonical& law, const clratio::Stream& stream, std::uint64_t first,
                    std::span<float> out);
void native_histogram(const NativeSet& set, const clratio::Canonical& law, const clratio::Stream& stream,
                      std::uint64_t first, std::uint64_t count, Binning binning, std::span<std::uint64_t> totals);

}  // namespace peers
