// What a C++ programmer writes without this library: scalar generators, libm, all cores.
#pragma once

#include <cstdint>
#include <span>

#include "clratio/error.hpp"

namespace peers {

/// Random123's Philox4x32-10 and its Box-Muller, two normals to an error sample.
void random123_samples(const clratio::Canonical& law, std::uint64_t seed, std::uint64_t first, std::span<float> out);

/// std::mt19937, one engine a thread, and std::normal_distribution<float>.
void standard_samples(const clratio::Canonical& law, std::uint64_t seed, std::span<float> out);

}  // namespace peers
