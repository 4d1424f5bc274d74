// Standard errors of a study clustered by pixel: variance components against laws and images that have known ones.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "study.hpp"
#include "support/scenes.hpp"

using namespace clratio;
using namespace tool::study;

namespace {

/// Values x[pixel][seed] and what a study keeps of them.
using Values = std::vector<std::vector<double>>;

PixelSpread spread_of(const Values& x) {
    PixelSpread out;
    for (const auto& pixel : x) {
        double sum = 0;
        for (const double v : pixel) {
            sum += v;
            out.squares += v * v;
        }
        out.sum += sum;
        out.squared_sums += sum * sum;
    }
    return out;
}

/// The variance between the pixels' means, by its definition.
double between_pixels(const Values& x) {
    std::vector<double> means;
    double mean = 0, square = 0;
    for (const auto& pixel : x) {
        double sum = 0;
        for (const double v : pixel) sum += v;
        means.push_back(sum / static_cast<double>(pixel.size()));
        mean += means.back() / static_cast<double>(x.size());
    }
    for (const double m : means) square += (m - mean) * (m - mean);
    return square / static_cast<double>(x.size() - 1);
}

/// Pixels' means are exponential with mean 1, so that their variance is 1; seeds add `noise` squared.
Values made_up(std::size_t pixels, std::size_t seeds, double noise, std::mt19937_64& random) {
    std::exponential_distribution<double> mean;
    std::normal_distribution<double> around;
    Values x(pixels, std::vector<double>(seeds));
    for (auto& pixel : x) {
        const double m = mean(random);
        for (auto& v : pixel) v = m + noise * around(random);
    }
    return x;
}

}  // namespace

TEST(StudyPixels, for_the_same_seeds_it_is_the_variance_between_pixels) {
    std::mt19937_64 random(1);
    const Values x = made_up(500, 16, 2, random);
    const double want = between_pixels(x) / 500;
    EXPECT_NEAR(clustered_variance(spread_of(x), 16, 500, 16) / want, 1, 1e-12);
}

// Exponential means: var 1 between pixels, kurtosis 9, so that the estimate of 1 + noise^2 / S from P pixels has a relative
// standard error of sqrt(8 / P) at most. 5 of them.
TEST(StudyPixels, components_give_the_variance_for_other_seeds) {
    constexpr std::size_t pixels = 20000;
    const double room = 5 * std::sqrt(8.0 / pixels);
    for (const std::uint64_t seed : {1, 2, 3}) {
        std::mt19937_64 random(seed);
        const PixelSpread x = spread_of(made_up(pixels, 16, 8, random));
        for (const std::uint64_t seeds : {2, 16, 128, 1 << 20}) {
            const double want = 1 + 64.0 / static_cast<double>(seeds);
            EXPECT_NEAR(pixels * clustered_variance(x, 16, pixels, seeds) / want, 1, room) << seeds;
        }
        // The planted fault: as many seeds as were measured, whatever is asked for.
        const double wrong = pixels * clustered_variance(x, 16, pixels, 16);
        EXPECT_GT(std::abs(wrong / (1 + 64.0 / 128) - 1), room);
    }
}

TEST(StudyPixels, without_spread_it_is_zero) {
    const Values same(7, std::vector<double>(4, 2.5));
    EXPECT_NEAR(clustered_variance(spread_of(same), 4, 7, 128), 0, 1e-15);
}

/// Of a small image: the sums by their definition, from single renderings.
TEST(StudyPixels, spreads_are_those_of_the_images) {
    const MediumScene scene(Engine{}, test::scenes()[3], {12, 9});
    const Sampler sampler{Sampling::uni, Pattern::stratified, false};
    constexpr double most = 0.4;  // some plain means are further off
    const auto got = pixel_spreads(scene, sampler, {2, 3}, most);
    const auto tau = tau_image(scene), reference = reference_image(scene);
    std::size_t limited = 0;
    for (std::uint32_t level = 0; level < levels; ++level)
        for (const bool ratio : {false, true}) {
            Values x[4];
            for (auto& channel : x) channel.assign(tau.size() / 3, std::vector<double>(3));
            for (std::uint64_t s = 0; s < 3; ++s) {
                const auto image = render(scene, sampler, {2 + s}, 1u << level);
                for (std::size_t i = 0; i < tau.size(); ++i) {
                    const float estimate = !ratio ? image.m[i] : image.t[i] > 0 ? tau[i] * (image.m[i] / image.t[i]) : 0;
                    const auto e = static_cast<double>(estimate - reference[i]);
                    limited += std::abs(e) > most;
                    const double square = std::pow(std::min(std::abs(e), most), 2);
                    x[i % 3][i / 3][s] = square;
                    x[3][i / 3][s] += square / 3;
                }
            }
            for (std::size_t c = 0; c < 4; ++c) {
                const PixelSpread want = spread_of(x[c]), is = got[spread_index(level, ratio, c)];
                EXPECT_NEAR(is.sum, want.sum, 1e-6 * want.sum);
                EXPECT_NEAR(is.squares, want.squares, 1e-6 * want.squares);
                EXPECT_NEAR(is.squared_sums, want.squared_sums, 1e-6 * want.squared_sums);
                const double neighbour = spread_of(x[(c + 1) % 4]).squares;
                EXPECT_GT(std::abs(is.squares - neighbour), 1e-3 * neighbour) << "the planted fault";
            }
        }
    EXPECT_GT(limited, 0u);
}
