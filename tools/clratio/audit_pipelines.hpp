// Three ways from hashed words to the error of an estimator: as the supplement does it in float, ours, and in double.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "audit.hpp"
#include "clratio/histogram.hpp"

namespace tool::audit {

/// The supplement's normal: sqrt 2 erfinv(2 xi - 1), xi = float(h) 2^-32, all in float. +-inf at both ends.
float literal_normal(std::uint32_t h);

/// Its error sample i: eq. (14) in float, from the 32-bit hashes of 2 i and 2 i + 1.
float literal_error_sample(const clratio::ErrorModel& model, std::uint32_t i);

clratio::Histogram literal_histogram(const clratio::ErrorModel& model, std::uint64_t samples, clratio::Bins bins);

}  // namespace tool::audit
