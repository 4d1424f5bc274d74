// Standard errors clustered by pixel: how squared errors spread between the pixels of a series' first images.
#include <cmath>

#include "parallel.hpp"
#include "study.hpp"

namespace tool::study {
namespace {

constexpr std::size_t sets = 4;  // of channels: r, g, b, and the mean of the three

/// Squared errors of one level's images: for each pixel the sum over the seeds so far, and what needs no pixels.
class LevelSpread {
public:
    LevelSpread(std::size_t pixels, float most_error) : most_error_(most_error) {
        for (auto& sum : of_pixels_) sum.resize(pixels);
    }

    /// One image more, each interleaved RGB.
    void add(const float* m, const float* t, const float* tau, const float* reference) {
        const std::size_t pixels = of_pixels_.front().size();
        for (std::size_t p = 0; p < pixels; ++p) {
            std::array<double, 2> all{};
            for (std::size_t c = 0; c < 3; ++c) {
                const std::size_t i = 3 * p + c;
                const float ratio = t[i] > 0 ? tau[i] * (m[i] / t[i]) : 0;
                const std::array x{squared(m[i] - reference[i]), squared(ratio - reference[i])};
                for (std::size_t r = 0; r < 2; ++r) {
                    add(r * sets + c, p, x[r]);
                    all[r] += x[r];
                }
            }
            for (std::size_t r = 0; r < 2; ++r) add(r * sets + all_channels, p, all[r] / 3);
        }
    }

    PixelSpread spread(std::size_t cell) const {
        PixelSpread out{0, squares_[cell], 0};
        for (const double sum : of_pixels_[cell]) {
            out.sum += sum;
            out.squared_sums += sum * sum;
        }
        return out;
    }

private:
    double squared(float e) const {
        const auto limited = static_cast<double>(std::clamp(e, -most_error_, most_error_));
        return limited * limited;
    }
    void add(std::size_t cell, std::size_t pixel, double x) {
        of_pixels_[cell][pixel] += x;
        squares_[cell] += x * x;
    }

    std::array<std::vector<double>, 2 * sets> of_pixels_;
    std::array<double, 2 * sets> squares_{};
    float most_error_;
};

}  // namespace

std::vector<PixelSpread> pixel_spreads(const clratio::MediumScene& scene, const clratio::Sampler& sampler,
                                       clratio::IndexRange seeds, double most_error) {
    const auto tau = clratio::tau_image(scene), reference = clratio::reference_image(scene);
    std::vector<LevelSpread> of_levels(levels, LevelSpread(tau.size() / 3, static_cast<float>(most_error)));
    for (std::uint64_t seed = seeds.first; seed < seeds.first + seeds.count; ++seed) {
        const auto image = clratio::render_levels(scene, sampler, {seed}, levels);
        in_parallel(levels, [&](std::size_t level) {
            const std::size_t first = level * tau.size();
            of_levels[level].add(&image.m[first], &image.t[first], tau.data(), reference.data());
        });
    }
    std::vector<PixelSpread> out;
    for (const auto& level : of_levels)
        for (std::size_t cell = 0; cell < 2 * sets; ++cell) out.push_back(level.spread(cell));
    return out;
}

void add_spreads(Part& part, const clratio::MediumScene& scene, const Piece& piece) {
    if (piece.seeds.first != 0) return;
    part.spread_seeds = std::min(piece.seeds.count, most_spread_seeds);
    part.spreads = pixel_spreads(scene, piece.series.sampler, {0, part.spread_seeds}, std::ldexp(part.unit, 29));
}

double clustered_variance(const PixelSpread& x, std::uint64_t seeds, std::uint64_t pixels, std::uint64_t for_seeds) {
    const auto n = static_cast<double>(seeds), count = static_cast<double>(pixels), all = static_cast<double>(for_seeds);
    const double mean = x.sum / (n * count);
    const double square = x.squares / (n * count);                                       // E[x^2]
    const double square_of_mean = (x.squared_sums - x.squares) / (n * (n - 1) * count);  // E[mu_p^2], without bias
    const double within = std::max(0.0, square - square_of_mean) / all;
    const double between = std::max(0.0, square_of_mean - mean * mean);
    return (within + between) / (count - 1);
}

}  // namespace tool::study
