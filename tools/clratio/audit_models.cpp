#include "audit_models.hpp"

#include <algorithm>

#include "clratio/combine.hpp"
#include "clratio/stream.hpp"
#include "quadrature.hpp"

namespace tool::audit {
namespace {

constexpr std::uint64_t seed = 1;

double visibility(Model model, double t) {
    switch (model) {
    case Model::shadowed:
        return 0.2 + 0.7 * t / (1 + t);
    case Model::even:
        return 0.6;
    case Model::unrelated:
        break;
    case Model::heavy:
        return 0.8 / (1 + 0.3 * (t - 1));
    }
    return 1;
}

double log_deviation(Model model) { return model == Model::unrelated ? 0.6 : 0.8; }

// A lognormal of mean 1 from a standard normal, and a Pareto from a uniform.
double lognormal(double deviation, double z) { return std::exp(deviation * z - deviation * deviation / 2); }
double pareto(double u) { return std::pow(u, -1 / 2.2); }

// E f(t).
double expectation(Model model, const std::function<double(double)>& f) {
    if (model == Model::heavy)
        return simpson([&](double y) { return std::exp(-y) * f(pareto(std::exp(-y))); }, 0, 600, 120'000);
    const auto weighted = [&](double z) { return normal_density(z) * f(lognormal(log_deviation(model), z)); };
    return simpson(weighted, -10, 14, 4'800);
}

double binomial(int n, int k) { return k == 0 ? 1 : binomial(n, k - 1) * (n - k + 1) / k; }

std::vector<double> uniforms(const Work& work, const clratio::Stream& stream, std::uint64_t first, std::size_t count) {
    std::vector<std::uint32_t> words(count);
    clratio::fill_words(work.engine, stream, first, words);
    std::vector<double> out(count);
    std::transform(words.begin(), words.end(), out.begin(), [](std::uint32_t w) { return (w + 0.5) * 0x1p-32; });
    return out;
}

std::vector<float> normals(const Work& work, const clratio::Stream& stream, std::uint64_t first, std::size_t count) {
    std::vector<float> out(count);
    clratio::fill_normals(work.engine, stream, first, std::span<float>(out));
    return out;
}

std::vector<float> hi_parts(const clratio::Moments& sum) {
    const auto bits = sum.bits(&clratio::StatePlanes::t);
    std::vector<float> out(sum.size());
    std::transform(bits.begin(), bits.begin() + static_cast<std::ptrdiff_t>(out.size()), out.begin(),
                   [](std::uint32_t b) { return std::bit_cast<float>(b); });
    return out;
}

Trial read_out(const clratio::Moments& sum, Model model) {
    const auto estimate = [&](clratio::Estimator estimator) {
        return clratio::combine(sum, static_cast<float>(tau(model)), {.estimator = estimator}).estimate;
    };
    return {sum.batches(),
            mu(model),
            static_cast<float>(tau(model)),
            estimate(clratio::Estimator::ratio),
            estimate(clratio::Estimator::mean),
            estimate(clratio::Estimator::mean_of_ratios),
            hi_parts(sum)};
}

}  // namespace

double raw_moment(Model model, int j, int k) {
    if (model == Model::unrelated) return std::exp(0.18 * (j * (j - 1) + k * (k - 1)));
    return expectation(model, [&](double t) { return (j > 0 ? visibility(model, t) : 1) * std::pow(t, j + k); });
}

double mean_quotient(Model model) {
    if (model == Model::unrelated) return expectation(model, [](double t) { return 1 / t; });
    return expectation(model, [&](double t) { return visibility(model, t); });
}

double central_moment(Model model, int j, int k) {
    double sum = 0;
    for (int a = 0; a <= j; ++a)
        for (int b = 0; b <= k; ++b)
            sum += binomial(j, a) * binomial(k, b) * ((j + k - a - b) % 2 ? -1 : 1) * raw_moment(model, a, b) /
                   (std::pow(mu(model), a) * std::pow(tau(model), b));
    return sum;
}

double delta_bias(Model model, double n) {
    const auto c = [&](int j, int k) { return central_moment(model, j, k); };
    const double first = c(0, 2) - c(1, 1);
    return first / n + (c(1, 2) - c(0, 3) + 3 * c(0, 2) * first) / (n * n);
}

double delta_mse(Model model, double n) {
    const auto c = [&](int j, int k) { return central_moment(model, j, k); };
    const double residual = c(2, 0) - 2 * c(1, 1) + c(0, 2), slope = c(1, 1) - c(0, 2);
    const double second = -2 * (c(2, 1) - 2 * c(1, 2) + c(0, 3)) + 3 * residual * c(0, 2) + 6 * slope * slope;
    return residual / n + second / (n * n);
}

Average average(std::size_t count, const std::function<double(std::size_t)>& f) {
    double mean = 0, squares = 0;
    for (std::size_t i = 0; i < count; ++i) {
        const double distance = f(i) - mean;
        mean += distance / static_cast<double>(i + 1);
        squares += distance * (f(i) - mean);
    }
    const auto n = static_cast<double>(count);
    return {mean, std::sqrt(squares / (n - 1) / n)};
}

Average average(std::span<const double> values) {
    return average(values.size(), [&](std::size_t i) { return values[i]; });
}

Pairs draw(const Work& work, Model model, std::uint32_t run, std::uint64_t first, std::size_t count) {
    const clratio::Stream one{seed, 2 * run, clratio::Generator::philox, clratio::Domain::study},
        two{seed, 2 * run + 1, one.generator, one.domain};
    Pairs out{std::vector<float>(count), std::vector<float>(count)};
    const double deviation = log_deviation(model);
    if (model == Model::heavy) {
        const auto u = uniforms(work, one, first, count);
        std::transform(u.begin(), u.end(), out.t.begin(), [](double v) { return static_cast<float>(pareto(v)); });
    } else {
        const auto z = normals(work, one, first, count);
        std::transform(z.begin(), z.end(), out.t.begin(),
                       [&](float v) { return static_cast<float>(lognormal(deviation, v)); });
    }
    if (model == Model::unrelated) {
        const auto z = normals(work, two, first, count);
        std::transform(z.begin(), z.end(), out.m.begin(),
                       [&](float v) { return static_cast<float>(lognormal(deviation, v)); });
    } else {
        const auto u = uniforms(work, two, first, count);
        for (std::size_t i = 0; i < count; ++i) out.m[i] = u[i] < visibility(model, out.t[i]) ? out.t[i] : 0;
    }
    return out;
}

Average Trial::bias(const std::vector<float>& estimate) const {
    return average(estimate.size(), [&](std::size_t i) { return estimate[i] / mu - 1; });
}

Average Trial::mse(const std::vector<float>& estimate) const {
    return average(estimate.size(), [&](std::size_t i) { return (estimate[i] / mu - 1) * (estimate[i] / mu - 1); });
}

Average Trial::covariance() const {
    const double centre = average(ratio.size(), [&](std::size_t i) { return ratio[i]; }).value / tau;
    const double centre_t = average(mean_t.size(), [&](std::size_t i) { return mean_t[i]; }).value;
    return average(ratio.size(), [&](std::size_t i) { return (ratio[i] / tau - centre) * (mean_t[i] - centre_t) / mu; });
}

std::vector<Trial> simulate(const Work& work, Model model, std::uint32_t run, std::vector<std::uint64_t> n,
                            Pairing pairing) {
    const std::size_t replicas = std::min(work.samples, most_pairs) / std::max<std::uint64_t>(16, n.back());
    clratio::Moments sum{work.engine, replicas, {.ratios = true}};
    std::vector<Trial> out;
    for (const std::uint64_t until : n) {
        while (sum.batches() < until) {
            const std::uint64_t first = sum.batches() * replicas;
            const Pairs pairs = draw(work, model, run, first, replicas);
            if (pairing == Pairing::independent)
                sum.add(pairs.m, draw(work, model, run + 1, first, replicas).t);
            else
                sum.add(pairs.m, pairs.t);
        }
        out.push_back(read_out(sum, model));
    }
    return out;
}

}  // namespace tool::audit
