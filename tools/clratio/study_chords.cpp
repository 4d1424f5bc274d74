// Where rays only just touch the fog: errors relative to tau on the shortest tenth of the chords.
#include <algorithm>
#include <cmath>

#include "output_file.hpp"
#include "parallel.hpp"
#include "study.hpp"

namespace tool::study {
namespace {

using clratio::Sampling;

constexpr double tenth = 0.1;
constexpr std::uint32_t samples = 4;
constexpr std::array compared{Sampling::dsa, Sampling::ds, Sampling::wvds_mean, Sampling::wvds_mis};

clratio::Sightline sightline(const clratio::MediumScene& scene, std::size_t pixel) {
    const auto width = scene.frame().width;
    const auto x = static_cast<std::uint32_t>(pixel % width), y = static_cast<std::uint32_t>(pixel / width);
    return {scene.scene(), clratio::camera_ray(scene.scene().camera, scene.frame(), x, y)};
}

/// Lengths within the medium, pixel by pixel; 0 where a ray misses.
std::vector<double> chord_lengths(const clratio::MediumScene& scene) {
    std::vector<double> lengths(scene.values() / 3);
    in_parallel(lengths.size(), [&](std::size_t pixel) {
        const auto line = sightline(scene, pixel);
        lengths[pixel] = line.hit() ? line.leave() - line.enter() : 0;
    });
    return lengths;
}

/// The plain mean's by the second moments, over the channels with light.
double predicted_square(const clratio::MediumScene& scene, const std::vector<std::size_t>& pixels, Sampling sampling) {
    double sum = 0, values = 0;
    for (const std::size_t p : pixels) {
        const auto line = sightline(scene, p);
        const auto moments = line.second_moments(sampling);
        for (std::size_t c = 0; c < 3; ++c) {
            const double tau = line.tau()[c];
            if (!(tau > 0)) continue;
            sum += clratio::predict(line.mu()[c], tau, moments.mm[c], moments.tt[c], samples).plain_mse / (tau * tau);
            ++values;
        }
    }
    return sum / values;
}

/// The length that a tenth of the rays that hit stay below.
double short_length(std::vector<double> lengths) {
    std::erase(lengths, 0.0);
    const auto at = lengths.begin() + static_cast<std::ptrdiff_t>(tenth * static_cast<double>(lengths.size() - 1));
    std::nth_element(lengths.begin(), at, lengths.end());
    return *at;
}

}  // namespace

ShortChords short_chords(const clratio::MediumScene& scene, std::uint64_t seeds) {
    const auto lengths = chord_lengths(scene);
    const double most = short_length(lengths);
    ShortChords out{most / *std::max_element(lengths.begin(), lengths.end()), 0, seeds, samples, {}};
    const auto tau = clratio::tau_image(scene), reference = clratio::reference_image(scene);
    std::vector<std::size_t> pixels, values;
    for (std::size_t p = 0; p < lengths.size(); ++p) {
        if (!(lengths[p] > 0 && lengths[p] <= most)) continue;
        pixels.push_back(p);
        for (std::size_t i = 3 * p; i < 3 * p + 3; ++i)
            if (tau[i] > 0) values.push_back(i);
    }
    out.rays = pixels.size();
    for (const auto sampling : compared) {
        std::vector<double> plain(seeds), ratio(seeds);
        for (std::uint64_t seed = 0; seed < seeds; ++seed) {
            const auto image = clratio::render(scene, {sampling}, {seed}, samples);
            for (const std::size_t i : values) {
                const auto exact = static_cast<double>(reference[i]), whole = static_cast<double>(tau[i]);
                const float lit = image.t[i] > 0 ? image.m[i] / image.t[i] : 0;
                plain[seed] += std::pow((static_cast<double>(image.m[i]) - exact) / whole, 2);
                ratio[seed] += std::pow((static_cast<double>(tau[i] * lit) - exact) / whole, 2);
            }
        }
        for (auto* sums : {&plain, &ratio})
            for (double& sum : *sums) sum /= static_cast<double>(values.size());
        out.errors.push_back({sampling, root_of(mean_of_seeds(plain)), root_of(mean_of_seeds(ratio)),
                              std::sqrt(predicted_square(scene, pixels, sampling))});
    }
    return out;
}

void write_chords_csv(const Results& results, const std::string& file) {
    OutputFile out(file);
    out.write("scene,sampling,estimate,n,rays,seeds,relative_rmse,relative_rmse_error,predicted\n");
    for (const auto& scene : results.scenes)
        for (const auto& e : scene.chords.errors)
            for (const bool ratio : {false, true}) {
                const Estimate& rms = ratio ? e.ratio : e.plain;
                out.write(fmt::format("{},{},{},{},{},{},{},{},{}\n", scene.named.name, clratio::name_of(e.sampling),
                                      ratio ? "ratio" : "mean", scene.chords.samples, scene.chords.rays, scene.chords.seeds,
                                      number(rms.value), number(rms.error), ratio ? "" : number(e.predicted)));
            }
    out.commit();
}

}  // namespace tool::study
