// Pairs (m, t) to try estimators on, what is known of them, and simulations of the estimators.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "audit.hpp"

namespace tool::audit {

/// t > 0 is the unshadowed radiance; m = V t with a visibility V of 0 or 1, but for `unrelated`.
enum class Model {
    shadowed,   ///< A: t lognormal, of deviation .8 in the log; P(V = 1 | t) = .2 + .7 t / (1 + t)
    even,       ///< A0: the same t, P(V = 1) = .6
    unrelated,  ///< B: m and t lognormal, .6 in the log, independent
    heavy,      ///< C: t Pareto of exponent 2.2; P(V = 1 | t) = .8 / (1 + .3 (t - 1))
};

/// E[m^j t^k], by quadrature within 1e-11 relative; for `heavy` j + k <= 2.
double raw_moment(Model model, int j, int k);
/// E[m / t].
double mean_quotient(Model model);
/// E[((m - mu) / mu)^j ((t - tau) / tau)^k].
double central_moment(Model model, int j, int k);

inline double mu(Model model) { return raw_moment(model, 1, 0); }
inline double tau(Model model) { return raw_moment(model, 0, 1); }

/// Relative bias and mean square error of the ratio of means of n pairs, to O(1/n^2) (delta method).
double delta_bias(Model model, double n);
double delta_mse(Model model, double n);

Average average(std::span<const double> values);
/// average() of f(0), .., f(count - 1).
Average average(std::size_t count, const std::function<double(std::size_t)>& f);

struct Pairs {
    std::vector<float> m, t;
};
/// Pairs first, first + 1, .. of a run of draws: different runs share no numbers.
Pairs draw(const Work& work, Model model, std::uint32_t run, std::uint64_t first, std::size_t count);

/// Replicas of what a renderer would hold after n pairs.
struct Trial {
    std::uint64_t n = 0;
    double mu = 0, tau = 0;
    std::vector<float> ratio, mean, mean_of_ratios, mean_t;

    Average bias(const std::vector<float>& estimate) const;  ///< of estimate / mu
    Average mse(const std::vector<float>& estimate) const;   ///< relative, of estimate / mu
    Average covariance() const;                              ///< of mean m / mean t and mean t, times 1 / mu
};

enum class Pairing { shared, independent };  ///< m and t from the same samples, or from two runs

/// Pairs are kept in memory: no more than these, whatever work.samples says.
constexpr std::uint64_t most_pairs = 10'000'000;

/// work.samples / n.back() replicas (a 16th of them at most), read out after each of the ascending n. Takes runs `run` and
/// `run + 1`.
std::vector<Trial> simulate(const Work& work, Model model, std::uint32_t run, std::vector<std::uint64_t> n,
                            Pairing pairing = Pairing::shared);

}  // namespace tool::audit
