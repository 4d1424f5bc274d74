// Gauss-Legendre with 20 points a panel, exact for polynomials up to degree 39.
#pragma once

#include <algorithm>
#include <span>

#include "clratio/device/law.h"

namespace clratio {

template <class F> double integrate(F f, double from, double to) {
    double sum = 0;
    for (int i = 0; i < 20; ++i) sum += device::gauss_weight_20[i] * f(from + (to - from) * device::gauss_node_20[i]);
    return sum * (to - from);
}

/// Over the panels between ascending breaks.
template <class F> double integrate(F f, std::span<const double> breaks) {
    double sum = 0;
    for (std::size_t i = 1; i < breaks.size(); ++i) sum += integrate(f, breaks[i - 1], breaks[i]);
    return sum;
}

}  // namespace clratio
