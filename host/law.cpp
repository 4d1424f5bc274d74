#include "clratio/law.hpp"

#include <algorithm>
#include <boost/math/tools/minima.hpp>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <string>

#include "edges.hpp"
#include "law_integral.hpp"
#include "quadrature.hpp"

namespace clratio {
namespace {

using device::clr_law_double;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

Canonical canonical_of(Law law, ErrorModel model) {
    if (law == Law::mc) return monte_carlo_canonical(model);
    if (law == Law::published || law == Law::integral) {
        canonical(model);
        model.rho = 0;
    }
    return canonical(model);
}

clr_law_double terms(const Canonical& c, double sd) {
    if (1 / sd == infinity) return {0, 0, 1, infinity, 0};
    clr_law_double m{c.s, c.a / sd, c.b / sd, 1 / sd, 0};
    if (m.s == 0) return m;
    const double a = std::abs(m.a);
    m.half_turn = -std::copysign(device::clr_owens_t_twice(1 / m.s, a / m.b / m.s, a, m.b), m.a);
    return m;
}

// Beyond this, and beyond sd, the probability is the integral of a smooth function of 1 / x; before it, Owen's T keeps its
// digits.
bool far_out(const clr_law_double& m, const device::clr_law_point_double& x) {
    return std::abs(x.p) == 1 && x.q * std::max(16.0, 0.1 / (m.s * m.s)) < m.s;
}

double far_tail(const clr_law_double& m, const device::clr_law_point_double& x) {
    return integrate([&](double q) { return device::clr_law_density(m, device::clr_law_at(m, x.p, q)); }, 0, x.q);
}

// (sqrt 2 / s) D(1 / (sqrt 2 s)) - 1 with Dawson's D, without the cancellation at small s.
double dawson_excess(double s) {
    if (s < 0.12) {
        double sum = 0, term = s * s;
        for (int k = 3; k < 43 && term > 1e-18 * s * s; k += 2) {
            sum += term;
            term *= k * s * s;
        }
        return sum;
    }
    const double y = 1 / (std::numbers::sqrt2 * s);
    std::vector<double> breaks;
    for (int i = 0; i <= 8; ++i) breaks.push_back(y * i / 8);
    return 2 * y * integrate([&](double t) { return std::exp(t * t - y * y); }, breaks) - 1;
}

void check_edges(std::span<const double> edges) {
    if (edges.size() < 2) throw InvalidArgument("edges", "at least 2", std::to_string(edges.size()));
    for (std::size_t i = 0; i < edges.size(); ++i)
        if (!std::isfinite(edges[i]) || (i > 0 && edges[i] <= edges[i - 1]))
            throw InvalidArgument("edges", "finite numbers, ascending",
                                  std::to_string(edges[i]) + " at " + std::to_string(i));
}

}  // namespace

ErrorLaw::ErrorLaw(Law law, const ErrorModel& model)
    : law_(law), model_(model), canonical_(canonical_of(law, model)), sd_(std::hypot(canonical_.a, canonical_.b)),
      terms_(terms(canonical_, sd_)) {
    if (!std::isfinite(sd_))
        throw InvalidArgument("error model: sigma_m", "a standard deviation of the error below overflow",
                              std::to_string(sd_));
    if (integral() && canonical_.s > 0 && canonical_.b == 0)
        throw InvalidArgument("law", "one in closed form where |rho| = 1 or sigma_m = 0", "an integral");
}

bool ErrorLaw::improper() const { return (law_ == Law::published || law_ == Law::integral) && canonical_.s > 0; }

double ErrorLaw::pdf(double x) const {
    if (integral() && canonical_.s > 0) {
        if (!std::isfinite(x)) return std::isnan(x) ? x : 0;
        return law_ == Law::integral ? published_integral(model_, x) : exact_integral(model_, x);
    }
    return law_ == Law::published ? device::clr_law_published_pdf(terms_, x) : device::clr_law_pdf(terms_, x);
}

double ErrorLaw::log_pdf(double x) const {
    if (integral() && canonical_.s > 0) return std::log(pdf(x));
    return law_ == Law::published ? device::clr_law_published_log_pdf(terms_, x) : device::clr_law_log_pdf(terms_, x);
}

double ErrorLaw::tail(double x) const {
    if (std::isnan(x) || improper()) return nan;
    if (std::isinf(x)) return 0;
    if (law_ == Law::exact_integral && canonical_.s > 0) {
        const double below = exact_integral_cdf(model_, x);
        return left(x) ? below : 1 - below;
    }
    const auto point = device::clr_law_locate(terms_, x);
    return terms_.s > 0 && far_out(terms_, point) ? far_tail(terms_, point) : device::clr_law_tail(terms_, x);
}

// On which side x lies as the formulas see it, in units of sd, where the least x may round to 0.
bool ErrorLaw::left(double x) const { return x * terms_.inverse_sd < 0; }

double ErrorLaw::cdf(double x) const { return left(x) ? tail(x) : 1 - tail(x); }
double ErrorLaw::sf(double x) const { return left(x) ? 1 - tail(x) : tail(x); }

double ErrorLaw::quantile(double p) const {
    if (!(p >= 0 && p <= 1)) throw InvalidArgument("p", "a probability in [0, 1]", std::to_string(p));
    if (improper()) return nan;
    if (terms_.inverse_sd == infinity) return 0;
    const double below_zero = 1 - tail(0);
    if (p == below_zero) return 0;
    return p < below_zero ? tail_quantile(p, -1) : tail_quantile(1 - p, 1);
}

// x of the given sign whose tail has this probability: Newton's step, halving wherever it leaves the bracket.
double ErrorLaw::tail_quantile(double probability, double sign) const {
    if (probability == 0) return sign * infinity;
    double low = 0, high = sd_;
    while (tail(sign * high) > probability) {
        low = high;
        high *= 2;
    }
    double x = (low + high) / 2;
    for (int i = 0; i < 200 && high - low > 0; ++i) {
        const double excess = tail(sign * x) - probability;
        (excess > 0 ? low : high) = x;
        const double newton = x + excess / pdf(sign * x);
        const double next = newton > low && newton < high ? newton : (low + high) / 2;
        if (std::abs(next - x) <= 2e-16 * x) return sign * next;
        x = next;
    }
    return sign * x;
}

std::vector<double> ErrorLaw::modes() const {
    if (canonical_.s == 0 || sd_ == 0) return {0};
    std::vector<double> grid;
    for (double x = 1e10; x > 1e-4; x *= 0.98) grid.push_back(-x * sd_);
    const std::size_t side = grid.size();
    grid.push_back(0);
    for (std::size_t i = side; i-- > 0;) grid.push_back(-grid[i]);
    std::vector<double> height(grid.size());
    std::transform(grid.begin(), grid.end(), height.begin(), [&](double x) { return log_pdf(x); });

    std::vector<std::pair<double, double>> found;
    for (std::size_t i = 1; i + 1 < grid.size(); ++i) {
        if (!(height[i] > height[i - 1] && height[i] >= height[i + 1])) continue;
        // Over a part of the bracket: Brent's search ends at an absolute 1e-8.
        const auto at = [&](double part) { return grid[i - 1] + part * (grid[i + 1] - grid[i - 1]); };
        const auto depth = [&](double part) { return -log_pdf(at(part)); };
        const auto [part, least] = boost::math::tools::brent_find_minima(depth, 0.0, 1.0, 40);
        found.emplace_back(least, at(part));
    }
    std::sort(found.begin(), found.end());
    std::vector<double> out;
    for (const auto& [depth, x] : found) out.push_back(x);
    return out;
}

double ErrorLaw::tail_constant() const {
    if (improper()) return infinity;
    return canonical_.s == 0 ? 0 : sd_ * device::clr_law_density(terms_, device::clr_law_at(terms_, 1, 0));
}

double ErrorLaw::bias() const {
    if (improper()) return nan;
    return canonical_.s == 0 ? 0 : -canonical_.a / canonical_.s * dawson_excess(canonical_.s);
}

std::vector<double> ErrorLaw::bin_probabilities(std::span<const double> edges) const {
    check_edges(edges);
    if (improper()) return improper_masses(edges);
    if (terms_.inverse_sd == infinity) {
        std::vector<double> out(edges.size() + 1);
        out[static_cast<std::size_t>(std::upper_bound(edges.begin(), edges.end(), 0.0) - edges.begin())] = 1;
        return out;
    }
    std::vector<double> out{cdf(edges.front())};
    std::vector<double> tails(edges.size());
    std::transform(edges.begin(), edges.end(), tails.begin(), [&](double x) { return tail(x); });
    for (std::size_t i = 1; i < edges.size(); ++i) {

        const double mass = left(edges[i])       ? tails[i] - tails[i - 1]
                            : left(edges[i - 1]) ? 1 - tails[i - 1] - tails[i]
                                                 : tails[i - 1] - tails[i];
        out.push_back(std::max(mass, 0.0));
    }
    out.push_back(sf(edges.back()));
    return out;
}

std::vector<double> ErrorLaw::bin_probabilities(double lo, double hi, std::uint32_t count) const {
    return bin_probabilities(equal_edges(lo, hi, count));
}

std::vector<double> ErrorLaw::bin_densities(double lo, double hi, std::uint32_t count) const {
    const auto edges = equal_edges(lo, hi, count);
    check_edges(edges);
    auto masses = improper() ? integrals(edges) : bin_probabilities(edges);
    if (!improper()) masses = {masses.begin() + 1, masses.end() - 1};
    for (double& mass : masses) mass *= count / (hi - lo);
    return masses;
}

/// Of the density over each bin.
std::vector<double> ErrorLaw::integrals(std::span<const double> edges) const {
    std::vector<double> out;
    for (std::size_t i = 1; i < edges.size(); ++i) {
        const double width = edges[i] - edges[i - 1];
        const int panels = static_cast<int>(std::clamp(std::ceil(2 * width / canonical_.b), 1.0, 1000.0));
        double mass = 0;
        for (int k = 0; k < panels; ++k)
            mass += integrate([&](double x) { return pdf(x); }, edges[i - 1] + width * k / panels,
                              edges[i - 1] + width * (k + 1) / panels);
        out.push_back(mass);
    }
    return out;
}

std::vector<double> ErrorLaw::improper_masses(std::span<const double> edges) const {
    const ErrorLaw exact(Law::exact, model_);
    std::vector<double> out = integrals(edges);
    const double below = exact.cdf(edges.front()), above = exact.sf(edges.back());
    const double sum = std::accumulate(out.begin(), out.end(), 0.0);
    for (double& mass : out) mass *= (1 - below - above) / sum;
    out.insert(out.begin(), below);
    out.push_back(above);
    return out;
}

device::clr_law ErrorLaw::device_form() const {
    if (integral()) throw InvalidArgument("law", "exact, published or mc: integrals are for the host", "an integral");
    const auto single = [](double v) { return static_cast<float>(v); };
    const auto& m = terms_;
    const device::clr_law f{single(m.s), single(m.a), single(m.b), single(m.inverse_sd), single(m.half_turn)};
    if (std::isinf(f.inverse_sd) && !std::isinf(m.inverse_sd))
        throw InvalidArgument("error model", "a standard deviation above 3e-39, for float", std::to_string(sd_));
    if (!std::isfinite(f.s) || (f.inverse_sd < 1e-37f))
        throw InvalidArgument("error model", "s and a standard deviation below 1e37, for float",
                              std::to_string(m.s) + " and " + std::to_string(sd_));
    return f;
}

}  // namespace clratio
