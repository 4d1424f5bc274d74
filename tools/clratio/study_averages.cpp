// Two orders: dividing the means of all samples, or averaging ratios that were finished sample by sample.
#include <algorithm>
#include <cmath>

#include "output_file.hpp"
#include "parallel.hpp"
#include "study.hpp"

namespace tool::study {
namespace {

using clratio::Sampling;

constexpr std::array compared{Sampling::uni, Sampling::ds};
constexpr std::uint32_t most_pixels_here = 80 * 60;  // every sample is an image of its own
constexpr std::size_t orders = 2;                    // of means, of ratios

/// Sums over the samples so far of each value.
struct Sums {
    explicit Sums(std::size_t values) : m(values), t(values), ratio(values) {}
    std::vector<double> m, t, ratio;

    void add(const clratio::RenderedImages& one) {
        for (std::size_t i = 0; i < m.size(); ++i) {
            m[i] += static_cast<double>(one.m[i]);
            t[i] += static_cast<double>(one.t[i]);
            if (one.t[i] > 0) ratio[i] += static_cast<double>(one.m[i] / one.t[i]);
        }
    }
};

/// Means over the values of one image that hit, for each level and order.
struct ImageErrors {
    std::array<std::array<double, orders>, levels> squares{}, sums{};
};

ImageErrors errors_of(const clratio::MediumScene& scene, Sampling sampling, std::uint64_t seed,
                      const std::vector<float>& tau, const std::vector<float>& reference, double values) {
    ImageErrors out;
    Sums sums(tau.size());
    std::uint32_t level = 0;
    for (std::uint32_t sample = 0; level < levels; ++sample) {
        sums.add(clratio::render(scene, {sampling}, {seed, sample}, 1));
        if (sample + 1 != 1u << level) continue;
        for (std::size_t i = 0; i < tau.size(); ++i) {
            const std::array quotients{sums.t[i] > 0 ? sums.m[i] / sums.t[i] : 0, std::ldexp(sums.ratio[i], -int(level))};
            for (std::size_t k = 0; k < orders; ++k) {
                const double e = static_cast<double>(tau[i]) * quotients[k] - static_cast<double>(reference[i]);
                out.squares[level][k] += e * e / values;
                out.sums[level][k] += e / values;
            }
        }
        ++level;
    }
    return out;
}

}  // namespace

clratio::Frame averages_frame(clratio::Frame frame) {
    const double scale = std::sqrt(most_pixels_here / (double{1} * frame.width * frame.height));
    if (scale >= 1) return frame;
    const auto scaled = [&](std::uint32_t size) {
        return std::max(1u, static_cast<std::uint32_t>(std::lround(scale * size)));
    };
    return {scaled(frame.width), scaled(frame.height)};
}

Averages averages_of(const clratio::MediumScene& scene, std::uint64_t seeds) {
    const auto tau = clratio::tau_image(scene), reference = clratio::reference_image(scene);
    std::uint64_t pixels = 0;
    for (std::size_t i = 0; i < tau.size(); i += 3) pixels += std::max({tau[i], tau[i + 1], tau[i + 2]}) > 0;
    const double values = 3 * static_cast<double>(std::max<std::uint64_t>(1, pixels));
    Averages out{scene.frame(), pixels, seeds, {}};
    for (const auto sampling : compared) {
        std::vector<ImageErrors> of_seeds(seeds);
        in_parallel(seeds,
                    [&](std::size_t seed) { of_seeds[seed] = errors_of(scene, sampling, seed, tau, reference, values); });
        const auto over_seeds = [&](std::uint32_t level, std::size_t order) {
            std::vector<double> squares, sums;
            for (const auto& one : of_seeds) {
                squares.push_back(one.squares[level][order]);
                sums.push_back(one.sums[level][order]);
            }
            return RmseAndBias{root_of(mean_of_seeds(squares)), mean_of_seeds(sums)};
        };
        for (std::uint32_t level = 0; level < levels; ++level)
            out.lines.push_back({sampling, level, over_seeds(level, 0), over_seeds(level, 1)});
    }
    return out;
}

void write_averages_csv(const Results& results, const std::string& file) {
    OutputFile out(file);
    out.write("scene,sampling,estimate,n,width,height,pixels,seeds,rmse,rmse_error,bias,bias_error\n");
    for (const auto& scene : results.scenes) {
        const auto& a = scene.averages;
        for (const auto& line : a.lines)
            for (const bool ratios : {false, true}) {
                const auto& e = ratios ? line.of_ratios : line.of_means;
                out.write(fmt::format("{},{},{},{},{},{},{},{},{},{},{},{}\n", scene.named.name,
                                      clratio::name_of(line.sampling), ratios ? "mean-of-ratios" : "ratio", 1u << line.level,
                                      a.frame.width, a.frame.height, a.pixels, a.seeds, number(e.rmse.value),
                                      number(e.rmse.error), number(e.bias.value), number(e.bias.error)));
            }
    }
    out.commit();
}

}  // namespace tool::study
