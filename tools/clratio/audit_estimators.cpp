// Equations (1) to (13): estimators of a mean, their bias, and sums that grow.
#include <algorithm>
#include <iterator>

#include "audit_models.hpp"
#include "audit_samples.hpp"
#include "clratio/combine.hpp"
#include "clratio/stream.hpp"

namespace tool::audit {
namespace {

using Numbers = std::vector<Number>;

constexpr auto model_a = Model::shadowed, model_a0 = Model::even, model_b = Model::unrelated;

// Each simulation, and each sum of pairs, has a run of draws of its own.
enum Run : std::uint32_t {
    trials_a = 0,
    trials_b = 2,
    trials_apart = 4,
    pairs_a = 6,
    again_a,
    pairs_a0,
    pairs_b,
    zeros,
    thousand,
    drifting
};

/// Rounding, of a few operations in double.
constexpr double rounding = 1e-13;

Average quotient_of(Average a, Average b) {
    const double value = a.value / b.value;
    return {value, std::hypot(a.error / a.value, b.error / b.value) * std::abs(value)};
}

Average scaled(Average a, double factor) { return {a.value * factor, a.error * std::abs(factor)}; }

Number mean_is_integral(const Pairs& a) {
    return sampled("average of m, model A", average(a.m.size(), [&](std::size_t i) { return a.m[i]; }), mu(model_a));
}

Number identity_of_constants() {
    return computed("tau / E[t] E[m] of model A", tau(model_a) / raw_moment(model_a, 0, 1) * mu(model_a), rounding,
                    mu(model_a));
}

// With tau = 0, where (3) and (4) hold: the mean of m, whatever i is added to both parts.
Number impulse_at_zero(const Work& work) {
    const std::vector<float> m{0.375f}, t{0};
    return computed("tau = 0, mean t = 0, mean m = .375", clratio::combine(work.engine, m, t, 0.0f).estimate[0], 0, 0.375);
}

// At tau = 0 the 1 that i adds to t has units: the same scene with radiances ten times as large has another error. And a
// tau of 1e-30, which i does not guard, makes every estimate 0.
Numbers impulse_has_units(const Work& work) {
    const clratio::ErrorModel model{1, 0, .3, .2}, brighter{10, 0, 3, 2}, almost{1, 1e-30, .3, .2};
    const clratio::ErrorLaw law(clratio::Law::exact, model), law10(clratio::Law::exact, brighter);
    const double low = law.quantile(.25), high = law.quantile(.75);
    const double none = law.cdf(-.99) - law.cdf(-1.01);
    return {sampled("share within quartiles, radiance x 10", share_between(work, brighter, 90, 10 * low, 10 * high),
                    law10.cdf(10 * high) - law10.cdf(10 * low), .5),
            sampled("share within .01 of 0, tau = 1e-30", share_between(work, almost, 91, -1.01, -.99), 1, none)};
}

// t is 0 with probability .4 (the shadowed samples of model A0) and m = t / 2.
Numbers zero_denominators(const Work& work) {
    constexpr std::uint64_t n = 4;
    const std::size_t count = work.samples / 40;
    std::vector<float> mean_m(count), mean_t(count);
    for (std::uint64_t k = 0; k < n; ++k) {
        const Pairs pairs = draw(work, model_a0, zeros, k * count, count);
        for (std::size_t i = 0; i < count; ++i) {
            mean_t[i] += pairs.m[i] / n;
            mean_m[i] += pairs.m[i] / 2 / n;
        }
    }
    const double chance = std::pow(0.4, n), deviation = std::sqrt(chance * (1 - chance) / static_cast<double>(count));
    const auto literal = std::count_if(mean_m.begin(), mean_m.end(), [&](const float& m) {
        return !std::isfinite(1 / mean_t[static_cast<std::size_t>(&m - mean_m.data())] * m);
    });
    const auto combined = clratio::combine(work.engine, mean_m, mean_t, 1.0f);
    const auto share = [&](double failures) { return Average{failures / static_cast<double>(count), deviation}; };
    return {sampled("share of 0/0, P(t = 0) = .4, n = 4", share(static_cast<double>(literal)), chance, 0),
            sampled("the same, flagged by combine", share(static_cast<double>(combined.flags.zero_denominator)), chance),
            computed("not finite after combine", static_cast<double>(combined.flags.nonfinite), 0, 0)};
}

Number naive_bias(const Pairs& pairs, Model model, const char* name, std::optional<double> refuted) {
    const Average quotient = average(pairs.m.size(), [&](std::size_t i) { return pairs.m[i] / pairs.t[i]; });
    const double truth = mu(model);
    return sampled(std::string("relative bias of (5), ") + name, {quotient.value / truth - 1, quotient.error / truth},
                   mean_quotient(model) / truth - 1, refuted);
}

Number naive_bias_is_covariance(const Pairs& pairs) {
    const double centre = mean_quotient(model_a);
    const Average covariance = average(pairs.m.size(), [&](std::size_t i) {
        return (static_cast<double>(pairs.m[i]) / pairs.t[i] - centre) * (pairs.t[i] - 1);
    });
    return sampled("Cov(m/t, t), model A", covariance, mu(model_a) - mean_quotient(model_a), 0);
}

Number naive_bias_stays(const Work& work) {
    const Trial many = simulate(work, model_a, thousand, {1024}).front();
    return sampled("relative bias of (5), A, n = 1024", many.bias(many.mean_of_ratios),
                   mean_quotient(model_a) / mu(model_a) - 1, 0);
}

std::string after(const char* what, const Trial& trial) { return std::string(what) + ", n = " + std::to_string(trial.n); }

Numbers bias_vanishes(const std::vector<Trial>& a) {
    Numbers out;
    const Trial &first = a.front(), &last = a.back();
    out.push_back(sampled(after("relative bias, model A", first), first.bias(first.ratio),
                          mean_quotient(model_a) / mu(model_a) - 1, 0));
    out.push_back(sampled(after("relative bias, model A", last), last.bias(last.ratio),
                          delta_bias(model_a, static_cast<double>(last.n))));
    return out;
}

// Eq. (8) in the usual sign: the bias found in one simulation is minus the covariance found in another.
Numbers bias_is_covariance(const std::vector<Trial>& a, const std::vector<Trial>& again) {
    Numbers out;
    for (std::size_t k = 0; k < a.size(); ++k) {
        const auto n = static_cast<double>(a[k].n);
        const Average bias = a[k].bias(a[k].ratio), covariance = again[k].covariance();
        out.push_back(sampled(after("n (bias + Cov(m^/t^, t^)) / mu, A", a[k]),
                              scaled({bias.value + covariance.value, std::hypot(bias.error, covariance.error)}, n), 0));
    }
    const Trial& sixteen = a[2];
    const Average bias = sixteen.bias(sixteen.ratio), mse = sixteen.mse(sixteen.ratio);
    const double bound = std::sqrt(central_moment(model_a, 0, 2) / static_cast<double>(sixteen.n));
    out.push_back(sampled(after("n bias / mu, model A", sixteen), scaled(bias, static_cast<double>(sixteen.n)),
                          static_cast<double>(sixteen.n) * delta_bias(model_a, static_cast<double>(sixteen.n)), 0));
    out.push_back(sampled(after("|bias| / deviation, A", sixteen),
                          scaled(bias, -1 / std::sqrt(mse.value - bias.value * bias.value)), Relation::below, bound));
    return out;
}

Number ratio_of_expectations(const std::vector<Trial>& b) {
    const Trial& one = b.front();
    return sampled(after("relative bias, model B", one), one.bias(one.ratio), std::exp(0.36) - 1, 0);
}

// Are two sums better kept of the same samples, or of other ones?
Numbers sharing_helps(const Work& work, const std::vector<Trial>& a) {
    const Trial apart = simulate(work, model_a, trials_apart, {16}, Pairing::independent).front();
    const Trial& shared = a[2];
    const Average plain = shared.mse(shared.mean);
    return {
        sampled("MSE / MSE of the mean, shared, n = 16", quotient_of(shared.mse(shared.ratio), plain), Relation::below, 1),
        sampled("the same, independent samples", quotient_of(apart.mse(apart.ratio), plain), Relation::above, 1)};
}

// combine() against the formula in double.
Number combine_is_equation_10(const Work& work) {
    const Pairs pairs = draw(work, model_b, pairs_b, 0, 100'000);
    constexpr float control = 0.7f;
    const auto estimate = clratio::combine(work.engine, pairs.m, pairs.t, control).estimate;
    double worst = 0;
    for (std::size_t i = 0; i < estimate.size(); ++i)
        worst = std::max(worst, std::abs(estimate[i] / (double{control} * pairs.m[i] / pairs.t[i]) - 1));
    return computed("combine, relative distance from (10)", worst, 0x1p-23, 0);
}

// Values with weights 2^-i, split after k.
Numbers split_sum(const Pairs& pairs) {
    constexpr std::size_t k = 5, terms = 50;
    double sum = 0, parts[2]{}, weights[2]{};
    for (std::size_t i = 0; i < terms; ++i) {
        const double weight = std::exp2(-static_cast<double>(i + 1));
        sum += weight * pairs.t[i];
        parts[i >= k] += weight * pairs.t[i];
        weights[i >= k] += weight;
    }
    double joined = 0;
    for (int part : {0, 1}) joined += weights[part] * (parts[part] / weights[part]);
    return {computed("P_1,k + P_k+1,inf of weights 2^-i", weights[0] + weights[1], 0x1p-50, 1),
            computed("the joined sum over the whole sum", joined / sum, rounding, 1)};
}

Number repeated_argument(const Work& work, const Pairs& pairs) {
    const auto t = std::span(pairs.t).first(1000);
    const auto literal = clratio::combine(work.engine, t, t, 1.0f).estimate;
    return computed("mu*(E[t], E[t]), model A, tau = 1",
                    average(literal.size(), [&](std::size_t i) { return literal[i]; }).value, 0, 1, mu(model_a));
}

// Eq. (13) with equal weights 1/n and P as (12) has it, for the first half in two quarters; a constant 1 is averaged.
Number literal_weights() {
    constexpr double quarter = 0.25, mean = 1;
    return computed("mean of ones after half the samples", quarter * mean + quarter * mean, 0, 0.5, 1);
}

struct Drift {
    double interpolated = 0, library = 0;
};

// Means of values from .9 to 1.1 after many batches, by P1 E1 + P2 E2 in float and by the library: the largest relative
// errors among a few lanes.
Drift drift(const Work& work, std::size_t batches) {
    constexpr std::size_t lanes = 16;
    std::vector<float> values(batches * lanes);
    clratio::fill_uniforms(work.engine, {1, 2 * drifting, clratio::Generator::philox, clratio::Domain::study}, 0,
                           std::span(values));
    std::vector<clratio::HostBatch> pairs;
    std::vector<float> interpolated(lanes);
    std::vector<double> sums(lanes);
    for (std::size_t k = 0; k < batches; ++k) {
        const auto batch = std::span(values).subspan(k * lanes, lanes);
        const float share = 1 / static_cast<float>(k + 1);
        for (std::size_t i = 0; i < lanes; ++i) {
            batch[i] = 0.9f + 0.2f * batch[i];
            interpolated[i] = (1 - share) * interpolated[i] + share * batch[i];
            sums[i] += batch[i];
        }
        pairs.push_back({batch, batch});
    }
    clratio::Moments sum{work.engine, lanes};
    sum.add(pairs);
    const auto mean = clratio::combine(sum, 1.0f, {.estimator = clratio::Estimator::mean}).estimate;
    Drift worst;
    for (std::size_t i = 0; i < lanes; ++i) {
        const double truth = sums[i] / static_cast<double>(batches);
        worst.interpolated = std::max(worst.interpolated, std::abs(interpolated[i] / truth - 1));
        worst.library = std::max(worst.library, std::abs(mean[i] / truth - 1));
    }
    return worst;
}

Numbers progressive_weights(const Work& work) {
    const Drift d = drift(work, 100'000);
    Number literal = computed("error of P1 E1 + P2 E2, 10^5 batches", d.interpolated, 0, 0x1p-20);
    literal.relation = Relation::above;
    return {literal_weights(), literal, computed("the same of the library", d.library, 0x1p-23, 0)};
}

}  // namespace

std::vector<Finding> estimator_findings(const Work& work) {
    using enum Verdict;
    const std::size_t pairs = std::min(work.samples, most_pairs);
    const Pairs a = draw(work, model_a, pairs_a, 0, pairs), a0 = draw(work, model_a0, pairs_a0, 0, pairs);
    const std::vector<std::uint64_t> n{1, 4, 16, 64};
    const auto trials = simulate(work, model_a, trials_a, n), again = simulate(work, model_a, again_a, n);
    const auto unrelated = simulate(work, model_b, trials_b, {1});
    return {
        {"1",
         "mu is the expectation E[m], a sum of m(x) p(x)",
         misleading,
         "It is. A discrete sum and an integral are mixed; either will do.",
         {mean_is_integral(a)}},
        {"2",
         "mu = tau / E[t] E[m]",
         misleading,
         "For the constants, where tau / E[t] is 1. It says nothing of an estimator, which has mean t in place of E[t].",
         {identity_of_constants()}},
        {"3, 4", "an impulse i, added to tau and to t where tau = 0, guards the division", misleading,
         "The identity holds at tau = 0. But i looks at tau and not at the mean of t: with tau != 0 and a mean t of 0 the "
         "estimate is still 0/0. The mean of t needs a guard of its own; combine has one and flags the value. Nor is i "
         "smooth, "
         "as a tau of 1e-30 is not guarded, nor without units: it is a radiance of 1.",
         [&] {
             Numbers out = zero_denominators(work);
             out.insert(out.begin(), impulse_at_zero(work));
             std::ranges::copy(impulse_has_units(work), std::back_inserter(out));
             return out;
         }()},
        {"5",
         "mu is not E[tau m / t], the mean of ratios",
         right,
         "In general. They are equal where Cov(m/t, t) = 0, as in model A0, where visibility does not depend on t.",
         {naive_bias(a, model_a, "model A", 0), naive_bias(a0, model_a0, "model A0", {})}},
        {"6",
         "the bias of (5), as truth minus estimate",
         right,
         "It is Cov(m/t, t). The usual sign, estimate minus truth, is the opposite. No number of samples removes it.",
         {naive_bias_is_covariance(a), naive_bias_stays(work)}},
        {"text", "the numerator and the denominator must be computed independently", wrong,
         "They must be accumulated separately, from the same samples. From independent samples the ratio is worse than no "
         "ratio at all.",
         sharing_helps(work, trials)},
        {"7", "(4) has zero bias", misleading,
         "Only with the constant E[t] put for the mean of t. The estimate itself is consistent: its bias falls as 1/n.",
         bias_vanishes(trials)},
        {"8", "with finite sums the bias is E[(1 - tau / t^) m^]", right,
         "It is Cov(m^/t^, t^) exactly, t^ and m^ the means, and never more than CV(t) / sqrt n standard deviations. The "
         "sums "
         "from 0 to n have n + 1 terms, and the weights must sum to 1.",
         bias_is_covariance(trials, again)},
        {"9",
         "B* = 0: the bias vanishes",
         misleading,
         "B* is the bias of a ratio of expectations, which nobody computes; i is lost on its second line. The ratio of "
         "means "
         "of n samples is biased, in model B with n = 1 by exp(.36) - 1.",
         {ratio_of_expectations(unrelated)}},
        {"10",
         "mu*(E_t, E_m) = (tau + i) E_m / (E_t + i)",
         right,
         "Tau is a hidden argument. This is what combine computes.",
         {combine_is_equation_10(work)}},
        {"11, 12", "a sum split after k, each part normalised by its weights P", right, "It needs P_1,k + P_k+1,inf = 1.",
         split_sum(a)},
        {"text",
         "after (12): mu*(E_1,k[t], E_1,k[t])",
         wrong,
         "A slip: the second argument is E_1,k[m]. As printed the estimate is tau, whatever m.",
         {repeated_argument(work, a)}},
        {"13", "E_1,k2 = P_1,k1 E_1,k1 + P_k1+1,k2 E_k1+1,k2", wrong,
         "The P of (12) sum to P_1,k2 and not to 1: divide by it. In float even 1 - 1/k and 1/k do not sum to 1, and the "
         "mean drifts; add (E_b - E) w / W instead, as the library does, in two floats.",
         progressive_weights(work)},
    };
}

}  // namespace tool::audit
