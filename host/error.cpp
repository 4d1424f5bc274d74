#include "clratio/error.hpp"

#include <cmath>
#include <string>
#include <utility>

#include "clratio/exception.hpp"

namespace clratio {
namespace {

void require(bool holds, const char* name, const char* expected, double got) {
    if (!holds) throw InvalidArgument(std::string("error model: ") + name, expected, std::to_string(got));
}

void check_model(const ErrorModel& e) {
    require(std::isfinite(e.mu), "mu", "a finite number", e.mu);
    require(std::isfinite(e.tau), "tau", "a finite number", e.tau);
    require(std::isfinite(e.sigma_m) && e.sigma_m >= 0, "sigma_m", "a finite number >= 0", e.sigma_m);
    require(std::isfinite(e.sigma_t) && e.sigma_t >= 0, "sigma_t", "a finite number >= 0", e.sigma_t);
    require(std::abs(e.rho) <= 1, "rho", "a number in [-1, 1]", e.rho);
    require(e.n >= 1, "n", "at least 1", static_cast<double>(e.n));
}

// a b - c d within 1.5 ulp (Kahan).
double difference_of_products(double a, double b, double c, double d) {
    const double cd = c * d;
    const double error = std::fma(-c, d, cd);
    return std::fma(a, b, -cd) + error;
}

}  // namespace

Canonical canonical(const ErrorModel& e) {
    check_model(e);
    const double c = e.tau == 0 ? 1 : e.tau;
    const double scale = std::sqrt(static_cast<double>(e.n));
    const double r = std::copysign(1.0, c) * e.rho;
    const Canonical out{e.sigma_t / std::abs(c) / scale,
                        difference_of_products(r * e.sigma_m, std::abs(c), e.mu, e.sigma_t) / std::abs(c) / scale,
                        e.sigma_m * std::sqrt((1 - r) * (1 + r)) / scale};
    require(std::isfinite(out.s), "sigma_t / |tau|", "a number below overflow", out.s);
    require(std::isfinite(out.a), "mu sigma_t / |tau|", "a number below overflow", out.a);
    return out;
}

Canonical monte_carlo_canonical(const ErrorModel& e) {
    check_model(e);
    return {0, 0, e.sigma_m / std::sqrt(static_cast<double>(e.n))};
}

device::clr_canonical to_float(const Canonical& c) {
    const device::clr_canonical f{static_cast<float>(c.s), static_cast<float>(c.a), static_cast<float>(c.b)};
    for (const auto& [name, value] : {std::pair{"s", f.s}, {"a", f.a}, {"b", f.b}})
        require(std::isfinite(value), name, "a number that float can hold", value);
    return f;
}

}  // namespace clratio
