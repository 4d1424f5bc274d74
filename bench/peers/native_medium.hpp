// Samples of WVDS with MIS in the machine's own vector instructions: the maths of device/medium.h, for the limit that
// bench/medium_bench.cpp compares with. What the library sets up for each ray is taken from its headers, and not timed here.
#pragma once

#include <cstdint>
#include <vector>

#include "clratio/medium.hpp"
#include "native.hpp"

namespace peers {

constexpr std::size_t most_lanes = 16;
using Lanes = float[most_lanes];

/// A vector of neighbouring pixels of one row, as a sample loop needs them.
struct alignas(64) MediumPixels {
    Lanes channel_from[2], piece_from[3][2], slope[3][3], offset[3][3];
    Lanes low[3], rise[3], start[3], stride[3], length, scale;
    Lanes base[9], rate[9];
    std::uint32_t pixel;
    std::vector<const float*> spheres, boxes;  // that can shade some lane
};

struct MediumSums {
    alignas(64) Lanes m[3], t[3];
};

/// Sets up the rays of a scene, `lanes` pixels to a vector, without vectors that miss; columns beyond the frame are drawn
/// and not looked at.
std::vector<MediumPixels> medium_pixels(const clratio::device::clr_medium& scene, const std::vector<float>& occluders,
                                        std::size_t lanes);

/// Sums of `samples` samples, a multiple of 4, of the pixels, on all cores. No light along an axis.
void native_medium(const NativeSet& set, const clratio::device::clr_medium& scene, const std::vector<MediumPixels>& pixels,
                   const clratio::Stream& stream, std::uint32_t samples, std::vector<MediumSums>& out);

}  // namespace peers
