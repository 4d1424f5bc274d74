// Simpson's rule, for smooth integrands that die out at both ends.
#pragma once

#include <cmath>
#include <numbers>

namespace tool {

/// `steps` is even.
template <class F> double simpson(F f, double from, double to, int steps) {
    const double h = (to - from) / steps;
    double sum = f(from) + f(to);
    for (int i = 1; i < steps; ++i) sum += f(from + i * h) * (i % 2 ? 4 : 2);
    return sum * h / 3;
}

inline double normal_density(double x, double mean = 0, double deviation = 1) {
    const double z = (x - mean) / deviation;
    return std::exp(-z * z / 2) / (std::sqrt(2 * std::numbers::pi) * deviation);
}

inline double normal_cdf(double z) { return std::erfc(-z / std::numbers::sqrt2) / 2; }

}  // namespace tool
