#include <algorithm>
#include <cmath>
#include <limits>

#include "output_file.hpp"
#include "parallel.hpp"
#include "study.hpp"

namespace tool::study {
namespace {

constexpr double none = std::numeric_limits<double>::quiet_NaN();

std::pair<std::size_t, std::size_t> channels_of(std::size_t channel) {
    return channel == all_channels ? std::pair<std::size_t, std::size_t>{0, 3} : std::pair{channel, channel + 1};
}

clratio::MediumErrorCounts counts_of(const Part& part, std::uint32_t level, bool ratio, std::size_t channel) {
    const auto [first, last] = channels_of(channel);
    auto counts = part.counts[value_index(level, ratio, first)];
    for (std::size_t c = first + 1; c < last; ++c) counts += part.counts[value_index(level, ratio, c)];
    return counts;
}

/// A stretch of the axis and how many errors lie in it; of width 0 for those that are as good as 0.
struct Cell {
    double lo, hi;
    std::uint64_t count;
};

double median_in(const std::vector<Cell>& cells, std::uint64_t total) {
    const double half = 0.5 * static_cast<double>(total);
    double below = 0;
    for (const auto& cell : cells) {
        const auto count = static_cast<double>(cell.count);
        if (cell.count > 0 && below + count >= half) return cell.lo + (cell.hi - cell.lo) * (half - below) / count;
        below += count;
    }
    return none;
}

/// The middle of all signed errors: what lies outside the bins is on its side, NaN nowhere.
double median_of(const clratio::MediumErrorCounts& c) {
    const double width = (c.hi - c.lo) / static_cast<double>(c.bins.size());
    std::vector<Cell> cells{{-std::numeric_limits<double>::infinity(), c.lo, c.underflow}};
    for (std::size_t i = 0; i < c.bins.size(); ++i) {
        if (i == c.bins.size() / 2) cells.push_back({0, 0, c.atom});
        const double lo = c.lo + width * static_cast<double>(i);
        cells.push_back({lo, lo + width, c.bins[i]});
    }
    cells.push_back({c.hi, std::numeric_limits<double>::infinity(), c.overflow});
    return median_in(cells, c.total() - c.nonfinite);
}

double median_size_of(const clratio::MediumErrorCounts& c) {
    const std::size_t half = c.bins.size() / 2;
    const double width = (c.hi - c.lo) / static_cast<double>(c.bins.size());
    std::vector<Cell> cells{{0, 0, c.atom}};
    for (std::size_t i = 0; i < half; ++i) {
        const double lo = width * static_cast<double>(i);
        cells.push_back({lo, lo + width, c.bins[half + i] + c.bins[half - 1 - i]});
    }
    cells.push_back({c.hi, std::numeric_limits<double>::infinity(), c.underflow + c.overflow});
    return median_in(cells, c.total() - c.nonfinite);
}

double pixel_error_of(const Part& part, std::size_t index, double rmse) {
    if (part.spread_seeds < 2 || part.pixels < 2) return none;
    if (!(rmse > 0)) return 0;
    return std::sqrt(clustered_variance(part.spreads[index], part.spread_seeds, part.pixels, part.seeds)) / (2 * rmse);
}

double share(std::uint64_t part, std::uint64_t of) {
    return of == 0 ? none : static_cast<double>(part) / static_cast<double>(of);
}

}  // namespace

Estimate mean_of_seeds(const std::vector<double>& values) {
    const auto n = static_cast<double>(values.size());
    double sum = 0, square = 0;
    for (const double x : values) sum += x;
    const double mean = sum / n;
    for (const double x : values) square += (x - mean) * (x - mean);
    return {mean, values.size() > 1 ? std::sqrt(square / (n - 1) / n) : none};
}

Estimate root_of(const Estimate& square) {
    const double root = std::sqrt(square.value);
    return {root, square.value > 0 ? square.error / (2 * root) : square.error};
}

Statistics statistics_of(const Part& part, std::uint32_t level, bool ratio, std::size_t channel) {
    const auto [first, last] = channels_of(channel);
    const auto values = static_cast<double>(part.pixels * (last - first));
    const std::size_t stride = levels * std::size_t{6};
    const auto of_seeds = [&, first = first, last = last](auto term) {
        std::vector<double> means(part.seeds);
        for (std::uint64_t seed = 0; seed < part.seeds; ++seed) {
            for (std::size_t c = first; c < last; ++c)
                means[seed] += term(part.sums[seed * stride + value_index(level, ratio, c)]);
            means[seed] /= values;
        }
        return mean_of_seeds(means);
    };
    Statistics s;
    s.mse = of_seeds([&](const auto& x) { return std::ldexp(static_cast<double>(x.squares), 12) * part.unit * part.unit; });
    s.rmse = root_of(s.mse);
    s.rmse_pixel_error = pixel_error_of(part, spread_index(level, ratio, channel), s.rmse.value);
    s.bias = of_seeds([&](const auto& x) { return static_cast<double>(x.sum) * part.unit; });
    const auto counts = counts_of(part, level, ratio, channel);
    s.values = counts.total();
    s.median = median_of(counts);
    s.median_size = median_size_of(counts);
    s.atom = share(counts.atom, s.values);
    std::uint64_t above = counts.overflow;
    for (std::size_t i = counts.bins.size() / 2; i < counts.bins.size(); ++i) above += counts.bins[i];
    s.bright = share(above, s.values - counts.atom - counts.nonfinite);
    s.below = share(counts.underflow, s.values);
    s.above = share(counts.overflow, s.values);
    s.zero_denominators = share(counts.zero_denominators, s.values);
    return s;
}

std::vector<double> density_of(const Part& part, std::uint32_t level, bool ratio, std::size_t channel) {
    const auto counts = counts_of(part, level, ratio, channel);
    const double scale =
        static_cast<double>(counts.bins.size()) / ((counts.hi - counts.lo) * static_cast<double>(counts.total()));
    std::vector<double> density;
    for (const auto count : counts.bins) density.push_back(scale * static_cast<double>(count));
    return density;
}

// ---- predictions

namespace {

constexpr std::size_t samplings = clratio::all_samplings.size();

/// Variances at N = 1 of each pixel and channel that is partly lit, and sums over all that hit.
struct RowPrediction {
    double rays = 0, partial = 0;
    std::array<Predicted, samplings> sums{};
    double worse[2][samplings][samplings] = {};
};

void add_value(RowPrediction& row, const clratio::Sightline& line,
               const std::array<clratio::SecondMoments, samplings>& moments, std::size_t c) {
    const double mu = line.mu()[c], tau = line.tau()[c];
    std::array<std::array<double, samplings>, 2> mse{};
    for (std::size_t k = 0; k < samplings; ++k) {
        const auto p = clratio::predict(mu, tau, moments[k].mm[c], moments[k].tt[c], 1);
        auto& sum = row.sums[k];
        for (const std::size_t to : {c, all_channels}) {
            const double part = to == all_channels ? 1.0 / 3 : 1.0;
            sum.plain_mse[to] += part * p.plain_mse;
            sum.ratio_mse[to] += part * p.ratio_mse;
            sum.ratio_bias[to] += part * p.ratio_bias;
            sum.independent_mse[to] += part * p.independent_mse;
            sum.independent_bias[to] += part * p.independent_bias;
        }
        mse[0][k] = p.plain_mse;
        mse[1][k] = p.ratio_mse;
    }
    if (!(mu > 0 && mu < tau * (1 - 1e-9))) return;
    ++row.partial;
    for (std::size_t ratio = 0; ratio < 2; ++ratio)
        for (std::size_t a = 0; a < samplings; ++a)
            for (std::size_t b = 0; b < samplings; ++b) row.worse[ratio][a][b] += mse[ratio][a] > mse[ratio][b];
}

RowPrediction predict_row(const clratio::Scene& scene, clratio::Frame frame, std::uint32_t y) {
    RowPrediction row;
    for (std::uint32_t x = 0; x < frame.width; ++x) {
        const clratio::Sightline line(scene, clratio::camera_ray(scene.camera, frame, x, y));
        if (!line.hit()) continue;
        ++row.rays;
        std::array<clratio::SecondMoments, samplings> moments{};
        for (std::size_t k = 0; k < samplings; ++k) moments[k] = line.second_moments(clratio::all_samplings[k]);
        for (std::size_t c = 0; c < 3; ++c) add_value(row, line, moments, c);
    }
    return row;
}

void add(std::array<double, 4>& to, const std::array<double, 4>& from, double scale) {
    for (std::size_t c = 0; c < 4; ++c) to[c] += scale * from[c];
}

}  // namespace

ScenePredictions predict_scene(const clratio::Scene& scene, clratio::Frame frame) {
    std::vector<RowPrediction> rows(frame.height);
    in_parallel(frame.height, [&](std::size_t y) { rows[y] = predict_row(scene, frame, static_cast<std::uint32_t>(y)); });

    double rays = 0, partial = 0;
    for (const auto& row : rows) {
        rays += row.rays;
        partial += row.partial;
    }
    ScenePredictions out;
    out.of.resize(samplings);
    out.worse.fill(std::vector<std::vector<double>>(samplings, std::vector<double>(samplings)));
    for (const auto& row : rows)
        for (std::size_t a = 0; a < samplings; ++a) {
            add(out.of[a].plain_mse, row.sums[a].plain_mse, 1 / rays);
            add(out.of[a].ratio_mse, row.sums[a].ratio_mse, 1 / rays);
            add(out.of[a].ratio_bias, row.sums[a].ratio_bias, 1 / rays);
            add(out.of[a].independent_mse, row.sums[a].independent_mse, 1 / rays);
            add(out.of[a].independent_bias, row.sums[a].independent_bias, 1 / rays);
            for (std::size_t ratio = 0; ratio < 2; ++ratio)
                for (std::size_t b = 0; b < samplings; ++b)
                    out.worse[ratio][a][b] += row.worse[ratio][a][b] / std::max(1.0, partial);
        }
    return out;
}

double predicted_rmse(const SceneResult& scene, const Estimator& e, std::uint32_t level, std::size_t channel) {
    if (e.sampler.pattern != clratio::Pattern::iid) return none;
    const auto& p = scene.predicted.of[static_cast<std::size_t>(e.sampler.sampling)];
    const auto& mse = !e.ratio ? p.plain_mse : e.sampler.independent ? p.independent_mse : p.ratio_mse;
    return std::sqrt(std::ldexp(mse[channel], -static_cast<int>(level)));
}

double predicted_bias(const SceneResult& scene, const Estimator& e, std::uint32_t level, std::size_t channel) {
    if (e.sampler.pattern != clratio::Pattern::iid) return none;
    const auto& p = scene.predicted.of[static_cast<std::size_t>(e.sampler.sampling)];
    const double bias = !e.ratio ? 0 : e.sampler.independent ? p.independent_bias[channel] : p.ratio_bias[channel];
    return std::ldexp(bias, -static_cast<int>(level));
}

// ---- lit pixels

LitErrors lit_errors(const clratio::MediumScene& scene, clratio::Sampling sampling) {
    constexpr std::uint64_t images = 4;
    const auto tau = clratio::tau_image(scene), reference = clratio::reference_image(scene);
    LitErrors out;
    double lit = 0, rays = 0;
    for (std::uint64_t seed = 0; seed < images; ++seed) {
        const auto image = clratio::render(scene, {sampling}, {seed}, 1);
        for (std::size_t i = 0; i < tau.size(); ++i) {
            if (!(tau[i] > 0)) continue;
            ++rays;
            out.empty += image.t[i] == 0;
            if (reference[i] != tau[i]) continue;
            ++lit;
            const float estimate = image.t[i] > 0 ? tau[i] * (image.m[i] / image.t[i]) : 0;
            out.plain += std::pow(static_cast<double>(image.m[i]) - static_cast<double>(reference[i]), 2);
            out.ratio += std::pow(static_cast<double>(estimate) - static_cast<double>(reference[i]), 2);
        }
    }
    out.share = rays > 0 ? lit / rays : 0;
    out.empty = rays > 0 ? out.empty / rays : 0;
    out.plain = lit > 0 ? std::sqrt(out.plain / lit) : 0;
    out.ratio = lit > 0 ? std::sqrt(out.ratio / lit) : 0;
    return out;
}

// ---- CSV

std::string number(double x) { return std::isnan(x) ? "" : fmt::format("{:.9g}", x); }

namespace {

constexpr const char* channel_names[] = {"r", "g", "b", "all"};

std::string row_head(const SceneResult& scene, const Estimator& e, std::uint32_t level, std::size_t channel) {
    return fmt::format("{},{},{},{},{},{},{}", scene.named.name, clratio::name_of(e.sampler.sampling),
                       clratio::name_of(e.sampler.pattern), e.sampler.independent ? "independent" : "shared",
                       e.ratio ? "ratio" : "mean", 1u << level, channel_names[channel]);
}

template <class Row> void for_each_row(const Results& results, std::size_t channels, Row row) {
    for (const auto& scene : results.scenes)
        for (const auto& estimator : estimators_of(scene))
            for (std::uint32_t level = 0; level < levels; ++level)
                for (std::size_t channel = 0; channel < channels; ++channel) row(scene, estimator, level, channel);
}

}  // namespace

void write_errors_csv(const Results& results, const std::string& file) {
    OutputFile out(file);
    out.write("scene,sampling,pattern,t,estimate,n,channel,pixels,seeds,rmse,rmse_error,rmse_pixel_error,bias,bias_error,"
              "median,median_size,"
              "atom,bright,below,above,zero_denominators,predicted_rmse,predicted_bias\n");
    for_each_row(results, 4, [&](const SceneResult& scene, const Estimator& e, std::uint32_t level, std::size_t channel) {
        const Part& part = scene.part(e.sampler);
        const Statistics s = statistics_of(part, level, e.ratio, channel);
        std::string row = row_head(scene, e, level, channel) + fmt::format(",{},{}", part.pixels, part.seeds);
        for (const double x : {s.rmse.value, s.rmse.error, s.rmse_pixel_error, s.bias.value, s.bias.error, s.median,
                               s.median_size, s.atom, s.bright, s.below, s.above, s.zero_denominators,
                               predicted_rmse(scene, e, level, channel), predicted_bias(scene, e, level, channel)})
            row += "," + number(x);
        out.write(row + "\n");
    });
    out.commit();
}

void write_densities_csv(const Results& results, const std::string& file) {
    OutputFile out(file);
    std::string header = "scene,sampling,pattern,t,estimate,n,channel,lo,hi,underflow,overflow,nan,atom";
    for (std::uint32_t i = 0; i < bins; ++i) header += fmt::format(",bin{}", i);
    out.write(header + "\n");
    for_each_row(results, 3, [&](const SceneResult& scene, const Estimator& e, std::uint32_t level, std::size_t channel) {
        const auto& c = scene.part(e.sampler).counts[value_index(level, e.ratio, channel)];
        out.write(row_head(scene, e, level, channel) + fmt::format(",{},{},{},{},{},{},{}\n", c.lo, c.hi, c.underflow,
                                                                   c.overflow, c.nonfinite, c.atom, fmt::join(c.bins, ",")));
    });
    out.commit();
}

}  // namespace tool::study
