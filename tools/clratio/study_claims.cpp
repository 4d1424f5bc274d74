// The claims of the supplement's section on single scattering, decided by the numbers of a run.
#include <algorithm>
#include <cmath>

#include "study_report.hpp"

namespace tool::study {
namespace {

using clratio::Pattern;
using clratio::Sampler;
using clratio::Sampling;

constexpr double standard_errors = 4;  // how far apart two numbers must be to differ: one chance of 16,000
constexpr double weak = 0.75;          // an advantage of less than a quarter of the error is called weak
constexpr Sampler marching{Sampling::uni, Pattern::stratified, false}, mis{Sampling::wvds_mis, Pattern::iid, false},
    ds{Sampling::ds, Pattern::iid, false}, dsa{Sampling::dsa, Pattern::iid, false}, dsm{Sampling::dsm, Pattern::iid, false},
    mean{Sampling::wvds_mean, Pattern::iid, false};

Statistics all_of(const SceneResult& scene, const Sampler& sampler, std::uint32_t level, bool ratio) {
    return statistics_of(scene.part(sampler), level, ratio, all_channels);
}

std::string percent(double share) { return fmt::format("{:.0f} %", 100 * share); }
std::string milli(const Estimate& e) {
    return std::isnan(e.error) ? fmt::format("{:.4g}", 1e3 * e.value)
                               : fmt::format("{:.4g} ± {:.2g}", 1e3 * e.value, 1e3 * e.error);
}

/// Is `a` below `b`, and by how much?
Verdict below(const Estimate& a, const Estimate& b) {
    const double room = standard_errors * std::hypot(a.error, b.error);
    if (a.value < b.value - room) return a.value < weak * b.value ? Verdict::holds : Verdict::weakly;
    return a.value > b.value + room ? Verdict::fails : Verdict::undecided;
}

Claim exact_in_the_light(const Results& results) {
    Claim claim{"i", "With a single sample the ratio estimator is exact wherever nothing is in the way.", "", {}};
    bool all = true, untruncated_fails = true, some = false;
    for (const auto& scene : results.scenes)
        for (const auto sampling : clratio::all_samplings) {
            const auto& lit = scene.lit[static_cast<std::size_t>(sampling)];
            if (!(lit.share > 0)) continue;
            some = true;
            const bool exact = lit.ratio == 0;
            (sampling == Sampling::dsa ? untruncated_fails : all) &= sampling == Sampling::dsa ? !exact : exact;
            claim.findings.push_back(
                {scene.named.name, std::string(clratio::name_of(sampling)), exact ? Verdict::holds : Verdict::fails,
                 fmt::format("RMSE × 1000 of one sample on lit pixels ({}): plain mean {:.4g}, ratio {:.4g}{}",
                             percent(lit.share), 1e3 * lit.plain, 1e3 * lit.ratio,
                             lit.empty > 0 ? fmt::format("; {} of all samples lie behind the medium", percent(lit.empty))
                                           : "")});
        }
    claim.summary = !some ? "No pixel of these scenes is fully lit: nothing to decide."
                    : all ? "Holds for every sampling within the medium: the error is 0 to the last bit."
                          : "Does not hold: see the samplings below.";
    if (some && untruncated_fails)
        claim.summary += " Fails for untruncated distance sampling, whose sample may lie behind the medium: 0/0.";
    return claim;
}

/// Most errors bright (or dark) at N = 1, 2 and 4: by a twentieth at least, and by more than chance.
Verdict majority(const SceneResult& scene) {
    bool bright = true, dark = true;
    for (std::uint32_t level = 0; level < 3; ++level) {
        const auto s = all_of(scene, mis, level, true);
        const double pixels = static_cast<double>(s.values) * (1 - s.atom) / 3;  // their channels share samples
        const double room = std::max(0.05, standard_errors * std::sqrt(0.25 / std::max(1.0, pixels)));
        bright &= s.bright > 0.5 + room;
        dark &= s.bright < 0.5 - room;
    }
    return bright ? Verdict::holds : dark ? Verdict::fails : Verdict::undecided;
}

Finding few_samples(const SceneResult& scene) {
    std::string shares;
    for (std::uint32_t level = 0; level < levels; ++level) {
        const double bright = all_of(scene, mis, level, true).bright;
        shares += std::isnan(bright) ? " –" : fmt::format(" {:.2f}", bright);
    }
    return {scene.named.name, "wvds-mis ratio", majority(scene),
            fmt::format("share of bright errors at N = 1 .. 64:{}; mean error × 1000 at N = 1: {}, at 4: {}", shares,
                        milli(all_of(scene, mis, 0, true).bias), milli(all_of(scene, mis, 2, true).bias))};
}

Claim bright_majority(const Results& results) {
    Claim claim{"ii", "With few samples the ratio estimator makes shadows too bright.", "", {}};
    std::string bright, dark;
    bool mean_bright = false;
    for (const auto& scene : results.scenes) {
        claim.findings.push_back(few_samples(scene));
        const Verdict v = claim.findings.back().verdict;
        auto& list = v == Verdict::holds ? bright : dark;
        if (v == Verdict::holds || v == Verdict::fails) list += (list.empty() ? "" : ", ") + scene.named.name;
        const auto bias = all_of(scene, mis, 0, true).bias;
        mean_bright |= v == Verdict::holds && bias.value > standard_errors * bias.error;
    }
    claim.summary = bright.empty()
                        ? "Not seen in these scenes."
                        : "True of the majority of errors in " + bright +
                              (mean_bright ? "." : "; their mean is not bright: few, but large, errors are dark.");
    if (!dark.empty()) claim.summary += " Most errors are dark in " + dark + ".";
    return claim;
}

/// The first N from which on plain stratified marching is ahead of the iid ratio; none: 0.
std::uint32_t crossing(const SceneResult& scene) {
    std::uint32_t from = 0;
    for (std::uint32_t level = levels; level-- > 0;) {
        if (all_of(scene, marching, level, false).rmse.value >= all_of(scene, mis, level, true).rmse.value) break;
        from = 1u << level;
    }
    return from;
}

Claim one_sample(const Results& results) {
    Claim claim{"iii", "One sample with the ratio is better than ray marching without it.", "", {}};
    std::string holds, fails, overtaken;
    for (const auto& scene : results.scenes) {
        const auto ratio = all_of(scene, mis, 0, true).rmse, plain = all_of(scene, marching, 0, false).rmse;
        const Verdict v = below(ratio, plain);
        const std::uint32_t n = crossing(scene);
        claim.findings.push_back({scene.named.name, "wvds-mis ratio against uni stratified mean, N = 1", v,
                                  fmt::format("RMSE × 1000: {} against {}; {}", milli(ratio), milli(plain),
                                              n == 0 ? std::string("marching is not ahead by N = 64")
                                                     : fmt::format("marching is ahead from N = {}", n))});
        if (v == Verdict::holds || v == Verdict::weakly)
            holds += (holds.empty() ? "" : ", ") + scene.named.name + (v == Verdict::weakly ? " (weakly)" : "");
        if (v == Verdict::fails) fails += (fails.empty() ? "" : ", ") + scene.named.name;
        if (n > 0) overtaken += fmt::format("{}{} (N = {})", overtaken.empty() ? "" : ", ", scene.named.name, n);
    }
    claim.summary = (holds.empty() ? "" : "Holds in " + holds + ". ") + (fails.empty() ? "" : "Fails in " + fails + ". ") +
                    (overtaken.empty() ? ""
                                       : "With more samples stratified marching gets ahead: " + overtaken +
                                             ". Its error goes like 1/N, that of independent samples like 1/√N: "
                                             "compare like patterns.");
    return claim;
}

struct Duel {
    Sampler own, other;
    const char* name;  ///< of the other
};
constexpr Duel duels[] = {{mis, dsa, "untruncated"},
                          {mis, ds, "truncated"},
                          {mis, dsm, "truncated, MIS"},
                          {mean, dsa, "untruncated"},
                          {mean, ds, "truncated"}};

/// Mean squared errors at N = 64, measured, and as the second moments have them.
Finding fought(const SceneResult& scene, const Duel& duel, bool ratio) {
    const auto own = all_of(scene, duel.own, levels - 1, ratio), other = all_of(scene, duel.other, levels - 1, ratio);
    const auto a = static_cast<std::size_t>(duel.own.sampling), b = static_cast<std::size_t>(duel.other.sampling);
    const auto& p = scene.predicted;
    const auto& pa = ratio ? p.of[a].ratio_mse : p.of[a].plain_mse;
    const auto& pb = ratio ? p.of[b].ratio_mse : p.of[b].plain_mse;
    const Estimate& x = own.mse;
    const Estimate& y = other.mse;
    Verdict v = below(x, y);
    if (v == Verdict::weakly && x.value < 0.9 * y.value) v = Verdict::holds;
    return {scene.named.name,
            fmt::format("{} against {} ({}), {}", clratio::name_of(duel.own.sampling), clratio::name_of(duel.other.sampling),
                        duel.name, ratio ? "ratio" : "plain mean"),
            v,
            y.value > 0 ? fmt::format("variance ratio {:.2f} at N = 64, {:.2f} by the second moments; worse in {} of partly "
                                      "lit values",
                                      x.value / y.value, pa[all_channels] / pb[all_channels], percent(p.worse[ratio][a][b]))
                        : "the other has no error"};
}

Claim beats_distance_sampling(const Results& results) {
    Claim claim{"iv", "Sampling by the fog toward light and camera is consistently better than distance sampling.", "", {}};
    std::size_t untruncated = 0, won = 0;
    std::string lost;
    for (const auto& scene : results.scenes)
        for (const auto& duel : duels)
            for (const bool ratio : {false, true}) {
                claim.findings.push_back(fought(scene, duel, ratio));
                const auto& f = claim.findings.back();
                if (duel.own.sampling != Sampling::wvds_mis) continue;
                if (duel.other.sampling == Sampling::dsa) {
                    ++untruncated;
                    won += f.verdict == Verdict::holds;
                } else if (f.verdict == Verdict::fails && duel.other.sampling == Sampling::ds) {
                    lost +=
                        fmt::format("{}{} ({})", lost.empty() ? "" : ", ", scene.named.name, ratio ? "ratio" : "plain mean");
                }
            }
    claim.summary =
        fmt::format("Against untruncated distance sampling it holds in {} of {} comparisons. ", won, untruncated);
    claim.summary += lost.empty() ? "Against the truncated form it never loses here, and gains little with the ratio."
                                  : "Against the truncated form it is reversed in " + lost +
                                        ": shadows lie downstream of the light, where it puts fewer samples.";
    return claim;
}

}  // namespace

const char* name_of(Verdict v) {
    return v == Verdict::holds    ? "holds"
           : v == Verdict::weakly ? "holds weakly"
           : v == Verdict::fails  ? "fails"
                                  : "no difference";
}

std::vector<Claim> claims_of(const Results& results) {
    std::vector<Claim> claims{exact_in_the_light(results), bright_majority(results), one_sample(results),
                              beats_distance_sampling(results)};
    if (results.plan.seeds == 1)
        for (const std::size_t compared : {2u, 3u})
            claims[compared].summary = "Not decided: a single image of each has no standard error.";
    return claims;
}

Json json_of(const Claim& claim) {
    Json out{{"id", claim.id}, {"said", claim.said}, {"summary", claim.summary}, {"findings", Json::array()}};
    for (const auto& f : claim.findings)
        out["findings"].push_back(
            {{"scene", f.scene}, {"what", f.what}, {"verdict", name_of(f.verdict)}, {"numbers", f.numbers}});
    return out;
}

std::string text_of(const Claim& claim) { return fmt::format("({}) {}\n    {}\n", claim.id, claim.said, claim.summary); }

}  // namespace tool::study
