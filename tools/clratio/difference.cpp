#include "difference.hpp"

#include <cmath>

namespace tool {

Difference difference(const clratio::Image& image, const clratio::Image& reference) {
    clratio::require_same_shape(image, reference);
    Difference d;
    d.values = image.size();
    double sum = 0, squares = 0, absolute = 0, relative = 0;
    for (std::size_t i = 0; i < image.values.size(); ++i) {
        const double a = image.values[i], r = reference.values[i];
        d.nonfinite += !std::isfinite(a);
        d.nonfinite_ref += !std::isfinite(r);
        if (!std::isfinite(a) || !std::isfinite(r)) continue;
        const double e = a - r;
        ++d.compared;
        sum += e;
        squares += e * e;
        absolute += std::fabs(e);
        relative += e * e / (r * r + relative_mse_epsilon);
    }
    const auto n = static_cast<double>(d.compared);
    d.rmse = std::sqrt(squares / n);
    d.bias = sum / n;
    d.mae = absolute / n;
    d.relative_mse = relative / n;
    return d;
}

}  // namespace tool
