#include <algorithm>

#include "study.hpp"

namespace tool::study {

using clratio::Pattern;
using clratio::Sampling;

std::vector<Series> Plan::series() const {
    std::vector<Series> all;
    for (std::size_t scene = 0; scene < scenes.size(); ++scene) {
        for (const auto sampling : clratio::all_samplings) all.push_back({scene, {sampling, Pattern::iid, false}});
        for (const auto sampling : {Sampling::uni, Sampling::ds, Sampling::wvds_mis})
            for (const auto pattern : {Pattern::stratified, Pattern::offset})
                all.push_back({scene, {sampling, pattern, false}});
        for (const auto sampling : {Sampling::uni, Sampling::wvds_mis})
            all.push_back({scene, {sampling, Pattern::iid, true}});
    }
    return all;
}

std::vector<Piece> pieces_of(const Plan& plan) {
    std::vector<Piece> all;
    for (const auto& series : plan.series())
        for (std::uint64_t first = 0; first < plan.seeds; first += seeds_a_piece)
            all.push_back({series, {first, std::min(seeds_a_piece, plan.seeds - first)}});
    return all;
}

Part& Part::operator+=(const Part& next) {
    if (seeds == 0) return *this = next;
    seeds += next.seeds;
    for (std::size_t i = 0; i < counts.size(); ++i) counts[i] += next.counts[i];
    sums.insert(sums.end(), next.sums.begin(), next.sums.end());
    return *this;
}

Part compute(const clratio::MediumScene& scene, const NamedScene& named, const Piece& piece,
             const clratio::Progress& progress) {
    clratio::MediumErrorOptions options;
    options.levels = levels;
    options.progress = progress;
    const auto errors =
        clratio::medium_errors(scene, piece.series.sampler, piece.seeds, {}, {-named.range, named.range, bins}, options);
    Part part{piece.seeds.count, 0, errors.unit, errors.counts, {}, 0, {}};
    for (const auto pixels : errors.pixels) part.pixels += pixels;
    if (part.pixels == 0) throw UsageError(named.name + ": no ray of the camera meets the fog, nothing to study");
    const std::size_t values = levels * std::size_t{6};
    part.sums.resize(piece.seeds.count * values);
    for (std::size_t i = 0; i < errors.sums.size(); ++i) {
        auto& to = part.sums[i / (errors.rows.count * values) * values + i % values];
        to.sum += errors.sums[i].sum;
        to.squares += errors.sums[i].squares;
    }
    return part;
}

std::string Estimator::name() const {
    return fmt::format("{} {} {}", clratio::name_of(sampler.sampling),
                       sampler.independent ? "independent" : std::string(clratio::name_of(sampler.pattern)),
                       ratio ? "ratio" : "mean");
}

const Part& SceneResult::part(const clratio::Sampler& sampler) const {
    const Series wanted{series.front().scene, sampler};
    return parts.at(static_cast<std::size_t>(std::find(series.begin(), series.end(), wanted) - series.begin()));
}

std::vector<Estimator> estimators_of(const SceneResult& scene) {
    std::vector<Estimator> all;
    for (const auto& series : scene.series) {
        if (!series.sampler.independent) all.push_back({series.sampler, false});
        all.push_back({series.sampler, true});
    }
    return all;
}

}  // namespace tool::study
