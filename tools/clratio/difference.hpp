// How far an image is from another, over all pixels and channels, summed in double.
#pragma once

#include <cstdint>

#include "clratio/image.hpp"

namespace tool {

/// relative MSE: mean of (a - r)^2 / (r^2 + this).
constexpr double relative_mse_epsilon = 1e-2;

struct Difference {
    std::uint64_t values = 0;                              ///< all
    std::uint64_t compared = 0;                            ///< those finite in both images; the means are over these
    std::uint64_t nonfinite = 0;                           ///< of the image
    std::uint64_t nonfinite_ref = 0;                       ///< of the reference
    double rmse = 0, bias = 0, mae = 0, relative_mse = 0;  ///< NaN where nothing could be compared
};

/// Throws InvalidArgument naming both files where their shapes differ.
Difference difference(const clratio::Image& image, const clratio::Image& reference);

}  // namespace tool
