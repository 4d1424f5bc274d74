// The convergence study: what is run, in which pieces, and what is made of their integers.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "clratio/medium.hpp"
#include "scene.hpp"
#include "tool.hpp"

namespace tool::study {

constexpr std::uint32_t levels = clratio::most_levels;  ///< N = 1, 2, 4, .. 64
constexpr std::uint32_t bins = 256;
constexpr std::uint64_t seeds_a_piece = 16;
constexpr std::uint64_t most_spread_seeds = 8;  ///< rendered twice, for pixel_spreads(): a tenth of a full study's time
constexpr std::size_t all_channels = 3;         ///< after r, g, b
/// 2^46 units of squared error a value at most: their sums over an image stay below 2^63.
constexpr std::uint64_t most_pixels = (1u << 17) - 1;

/// One way of estimating, in one scene.
struct Series {
    std::size_t scene = 0;
    clratio::Sampler sampler;
    bool operator==(const Series& o) const {
        return scene == o.scene && sampler.sampling == o.sampler.sampling && sampler.pattern == o.sampler.pattern &&
               sampler.independent == o.sampler.independent;
    }
};

struct Plan {
    std::vector<NamedScene> scenes;
    clratio::Frame frame;
    std::uint64_t seeds = 128;  ///< 0, 1, .. seeds - 1

    /// Every sampling with iid samples; stratified and offset for uni, ds and wvds-mis; uni and wvds-mis with independent t.
    std::vector<Series> series() const;
};

/// What is computed and saved in one go.
struct Piece {
    Series series;
    clratio::IndexRange seeds;
};

/// All of a plan, series by series. The same seeds are always cut in the same places.
std::vector<Piece> pieces_of(const Plan& plan);

/// Of the squared errors x of each pixel and seed: the sum of all x, that of all x^2, and over the pixels that of the
/// squares of (the sum of x over the seeds).
struct PixelSpread {
    double sum = 0, squares = 0, squared_sums = 0;
};

/// Exact integers of some images of one series, and of the first of all how they spread between pixels.
struct Part {
    std::uint64_t seeds = 0, pixels = 0;  ///< pixels: whose rays hit the medium
    double unit = 0;
    std::vector<clratio::MediumErrorCounts> counts;  ///< levels x 6, as clratio::MediumErrors has them
    std::vector<clratio::MediumErrorSums> sums;      ///< seeds x levels x 6
    std::uint64_t spread_seeds = 0;                  ///< the first of the first piece; 0 in others
    std::vector<PixelSpread> spreads;                ///< of these seeds, levels x 2 x 4: mean, ratio; r, g, b, all

    /// Adds the images of the seeds that follow.
    Part& operator+=(const Part& next);
};

/// Counts and sums; its spreads are empty.
Part compute(const clratio::MediumScene& scene, const NamedScene& named, const Piece& piece,
             const clratio::Progress& progress = {});

/// Index into Part::counts, and into the sums of one seed.
constexpr std::size_t value_index(std::uint32_t level, bool ratio, std::size_t channel) {
    return level * std::size_t{6} + (ratio ? 3 : 0) + channel;
}

/// Index into Part::spreads.
constexpr std::size_t spread_index(std::uint32_t level, bool ratio, std::size_t channel) {
    return level * std::size_t{8} + (ratio ? 4 : 0) + channel;
}

/// Fills the spreads of a series' first part, from at most most_spread_seeds images; does nothing to others.
void add_spreads(Part& part, const clratio::MediumScene& scene, const Piece& piece);

/// Squared errors of at most most_error^2 each, of images of these seeds. Cost: renders each once more, at all levels.
std::vector<PixelSpread> pixel_spreads(const clratio::MediumScene& scene, const clratio::Sampler& sampler,
                                       clratio::IndexRange seeds, double most_error);

/// The variance of the mean squared error of images of `for_seeds` seeds, were their pixels drawn anew with all their
/// samples: variance components from images of `seeds` >= 2 seeds. With for_seeds = seeds it is the variance between the
/// pixels' means over the seeds, divided by their number.
double clustered_variance(const PixelSpread& spread, std::uint64_t seeds, std::uint64_t pixels, std::uint64_t for_seeds);

// ---- parts on disk

/// Parts of a study in a folder: "louvres_wvds-mis_iid_200x150_seeds0-15.sums". A part is a line with a checksum and a JSON
/// object with its settings and integers, written whole or not at all.
class PartFolder {
public:
    /// Errors: IoError where the folder cannot be made.
    PartFolder(const std::string& folder, const Plan& plan);

    std::string name_of(const Piece& piece) const;
    std::string path_of(const Piece& piece) const;
    /// False where there is none, or a damaged one, or one of another scene of this name; into `part` otherwise.
    bool read(const Piece& piece, Part& part) const;
    void write(const Piece& piece, const Part& part) const;

private:
    Json settings_of(const Piece& piece) const;

    std::string folder_;
    Plan plan_;
};

// ---- how long it took

struct PartTime {
    double samples = 0, seconds = 0;  ///< of the errors that were counted
    double spread_seconds = 0;        ///< of pixel_spreads()
    PartTime& operator+=(const PartTime& other);
};

/// DIR/times.jsonl: a line for each part that was computed in this folder, with the device. Lines of other devices or widths
/// and broken ones are left out; of several for one part the last counts.
class TimeLog {
public:
    TimeLog(const std::string& folder, const clratio::Engine& engine);
    /// Errors: IoError.
    void add(const std::string& part, const PartTime& time);
    std::optional<PartTime> find(const std::string& part) const;

private:
    std::string path_, device_;
    int lanes_;
    std::map<std::string, PartTime> times_;
};

// ---- what the integers say

struct Estimate {
    double value = 0, error = 0;  ///< one standard error, from the spread of the seeds; NaN for one seed
};

/// Of one value for each seed.
Estimate mean_of_seeds(const std::vector<double>& values);
/// Of a mean of squares.
Estimate root_of(const Estimate& square);

/// Errors of one series, level and estimator: of channel 0, 1, 2, or of all three together (3).
struct Statistics {
    Estimate mse, rmse, bias;
    double rmse_pixel_error = 0;         ///< one standard error of rmse, clustered by pixel; NaN for one seed or pixel
    double median = 0, median_size = 0;  ///< of the errors, and of their absolute values, within a bin's width
    double atom = 0;                     ///< the share of errors with |e| <= 1e-6
    double bright = 0;                   ///< the share of positive ones among all others
    double below = 0, above = 0;         ///< the shares outside the bins
    double zero_denominators = 0;        ///< the share of values with sum t = 0
    std::uint64_t values = 0;
};
Statistics statistics_of(const Part& part, std::uint32_t level, bool ratio, std::size_t channel);

/// Density over the bins, of one channel or all: count / (all errors x width).
std::vector<double> density_of(const Part& part, std::uint32_t level, bool ratio, std::size_t channel);

/// From the second moments: means over the pixels that hit, of squared errors and biases at N = 1. All go with 1 / N.
struct Predicted {
    std::array<double, 4> plain_mse{}, ratio_mse{}, ratio_bias{}, independent_mse{}, independent_bias{};
};

/// Where one sampling has the larger variance than another, as a share of the partly lit pixels' channels.
struct ScenePredictions {
    std::vector<Predicted> of;  ///< by Sampling
    /// [plain or ratio][a][b]: a worse than b.
    std::array<std::vector<std::vector<double>>, 2> worse;
};
ScenePredictions predict_scene(const clratio::Scene& scene, clratio::Frame frame);

/// One sample in pixels with nothing in their way: root mean squared errors of the plain mean and of the ratio.
struct LitErrors {
    double plain = 0, ratio = 0;
    double share = 0;  ///< of the rays that hit
    double empty = 0;  ///< the share of all rays that hit whose only sample lies outside the medium
};
LitErrors lit_errors(const clratio::MediumScene& scene, clratio::Sampling sampling);

// ---- two closer looks, at images of seeds 0, 1, .. seeds - 1

/// Root mean squares of error / tau, over channels and rays.
struct ChordErrors {
    clratio::Sampling sampling;
    Estimate plain, ratio;
    double predicted = 0;  ///< of the plain mean, exact
};
/// The rays whose ways through the medium are among the shortest tenth.
struct ShortChords {
    double longest = 0;  ///< of these ways, as a share of the longest of all
    std::uint64_t rays = 0, seeds = 0;
    std::uint32_t samples = 0;  ///< a pixel
    std::vector<ChordErrors> errors;
};
ShortChords short_chords(const clratio::MediumScene& scene, std::uint64_t seeds);

struct RmseAndBias {
    Estimate rmse, bias;
};
/// tau times the ratio of the means of m and t, and tau times the mean of the ratios of single samples.
struct Average {
    clratio::Sampling sampling;
    std::uint32_t level = 0;
    RmseAndBias of_means, of_ratios;
};
struct Averages {
    clratio::Frame frame;
    std::uint64_t pixels = 0, seeds = 0;
    std::vector<Average> lines;  ///< samplings, and in each the levels
};
/// Cost: renders one image for each sample.
Averages averages_of(const clratio::MediumScene& scene, std::uint64_t seeds);
/// The frame at most 80 x 60 pixels large, of about the same shape.
clratio::Frame averages_frame(clratio::Frame frame);

struct SceneResult {
    NamedScene named;
    std::vector<Series> series;
    std::vector<Part> parts;  ///< of the whole series, in its order
    ScenePredictions predicted;
    std::vector<LitErrors> lit;  ///< by Sampling
    ShortChords chords;
    Averages averages;

    const Part& part(const clratio::Sampler& sampler) const;
};

struct Results {
    Plan plan;
    std::vector<SceneResult> scenes;
};

/// One line of a table: a sampler, and whether its m is divided by its t.
struct Estimator {
    clratio::Sampler sampler;
    bool ratio = false;
    std::string name() const;  ///< "wvds-mis iid ratio"
};
/// All of the study: independent samples only with the ratio.
std::vector<Estimator> estimators_of(const SceneResult& scene);

/// NaN where there is no prediction: patterns other than iid.
double predicted_rmse(const SceneResult& scene, const Estimator& estimator, std::uint32_t level, std::size_t channel);
double predicted_bias(const SceneResult& scene, const Estimator& estimator, std::uint32_t level, std::size_t channel);

/// For CSV: nothing for NaN.
std::string number(double x);

void write_errors_csv(const Results& results, const std::string& file);
void write_densities_csv(const Results& results, const std::string& file);
void write_chords_csv(const Results& results, const std::string& file);
void write_averages_csv(const Results& results, const std::string& file);

}  // namespace tool::study
