// Errors of the estimators of a scene: counted and summed as the host does it, and as theory and the published claims have
// them.
#include <gtest/gtest.h>

#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <map>

#include "clratio/medium.hpp"
#include "medium_state.hpp"
#include "support/medium_table.hpp"
#include "support/scenes.hpp"
#include "support/shapes.hpp"

using namespace clratio;
using namespace clratio::test;

namespace {

const Engine& engine() {
    static const Engine e;
    return e;
}

constexpr std::array<double, 4> reach{0.25, 0.6, 0.25, 0.25};
constexpr Frame small{80, 60};

/// Errors of one scene and sampler, and what is asked of them. Values are pixels whose rays hit x seeds x channels.
struct Study {
    Study(std::size_t which, const Sampler& sampler, std::uint64_t seeds, Frame frame = small, std::uint64_t first_seed = 1)
        : scene(engine(), scenes()[which], frame),
          errors(medium_errors(scene, sampler, {first_seed, seeds}, {}, {-reach[which], reach[which], 256})) {
        for (const auto p : errors.pixels) hits += p;
    }

    double values() const { return 3 * hits * static_cast<double>(errors.seeds.count); }

    /// Summed over channels, in radiance.
    double sum(std::uint32_t level, bool ratio, bool squares, std::uint64_t seed) const {
        double total = 0;
        for (std::uint32_t row = 0; row < errors.rows.count; ++row)
            for (std::uint32_t c = 0; c < 3; ++c) {
                const auto& s = errors.sums[((seed * errors.rows.count + row) * errors.levels + level) * 6 + 3 * ratio + c];
                total += squares ? std::ldexp(static_cast<double>(s.squares), 12) * errors.unit * errors.unit
                                 : static_cast<double>(s.sum) * errors.unit;
            }
        return total;
    }

    /// A mean over all values, with its standard error from the spread of the seeds.
    struct Mean {
        double value, error;
    };
    Mean mean(std::uint32_t level, bool ratio, bool squares) const {
        const auto n = static_cast<double>(errors.seeds.count);
        double total = 0, square = 0;
        for (std::uint64_t s = 0; s < errors.seeds.count; ++s) {
            const double x = sum(level, ratio, squares, s) / (3 * hits);
            total += x;
            square += x * x;
        }
        const double variance = std::max(0.0, (square - total * total / n) / (n - 1));
        return {total / n, std::sqrt(variance / n)};
    }
    double rmse(std::uint32_t level, bool ratio) const { return std::sqrt(mean(level, ratio, true).value); }
    double bias(std::uint32_t level, bool ratio) const { return mean(level, ratio, false).value; }

    /// Share of bright errors among those off the atom, over all channels.
    double bright(std::uint32_t level, bool ratio) const {
        std::uint64_t above = 0, all = 0;
        for (std::uint32_t c = 0; c < 3; ++c) {
            const auto& h = errors.counts[level * 6 + 3 * ratio + c];
            for (std::size_t i = h.bins.size() / 2; i < h.bins.size(); ++i) above += h.bins[i];
            above += h.overflow;
            all += h.total() - h.atom;
        }
        return static_cast<double>(above) / static_cast<double>(all);
    }

    MediumScene scene;
    MediumErrors errors;
    double hits = 0;
};

/// Root of the mean predicted squared error over all values that hit.
struct Predicted {
    double plain = 0, ratio = 0, independent = 0, ratio_bias = 0;
};
Predicted predicted(std::size_t which, Sampling sampling, std::uint64_t n, Frame frame = small) {
    Predicted sum;
    double values = 0;
    const Scene scene = scenes()[which];
    for (std::uint32_t y = 0; y < frame.height; ++y)
        for (std::uint32_t x = 0; x < frame.width; ++x) {
            const Sightline line(scene, camera_ray(scene.camera, frame, x, y));
            if (!line.hit()) continue;
            const SecondMoments moments = line.second_moments(sampling);
            for (std::size_t c = 0; c < 3; ++c) {
                const Prediction p = predict(line.mu()[c], line.tau()[c], moments.mm[c], moments.tt[c], n);
                sum.plain += p.plain_mse;
                sum.ratio += p.ratio_mse;
                sum.independent += p.independent_mse;
                sum.ratio_bias += p.ratio_bias;
                ++values;
            }
        }
    return {std::sqrt(sum.plain / values), std::sqrt(sum.ratio / values), std::sqrt(sum.independent / values),
            sum.ratio_bias / values};
}

/// The errors of a few images as the host makes them: every count and every sum.
struct HostTally {
    HostTally(const MediumScene& scene, const Sampler& sampler, const MediumErrors& like)
        : counts(like.levels * 6), sums(like.sums.size()) {
        using namespace device;
        const clr_bins bins{static_cast<float>(like.bins.lo), static_cast<float>(like.bins.hi),
                            static_cast<float>(like.bins.count) /
                                (static_cast<float>(like.bins.hi) - static_cast<float>(like.bins.lo)),
                            like.bins.count};
        const auto& s = scene.state();
        for (auto& h : counts) h.bins.resize(like.bins.count);
        for (std::uint64_t seed = 0; seed < like.seeds.count; ++seed)
            for (std::uint32_t row = 0; row < like.rows.count; ++row)
                for (std::uint32_t x = 0; x < s.frame.width; ++x)
                    for (std::uint32_t level = 0; level < like.levels; ++level) {
                        const std::uint32_t y = like.rows.first + row, n = 1u << level;
                        const auto pixel = render_pixel(scene, sampler, {like.seeds.first + seed}, n, x, y);
                        if (!pixel.hit) continue;
                        for (std::uint32_t c = 0; c < 3; ++c) {
                            const std::uint32_t to = s.device.channel[c];
                            const float share = s.shares[c * s.device.plane + y * s.frame.width + x];
                            // The means times n are the sums again: n is a power of two.
                            const auto e =
                                clr_errors_of(pixel.m[to] * static_cast<float>(n), pixel.t[to] * static_cast<float>(n),
                                              1 / static_cast<float>(n), pixel.tau[to], share);
                            auto* out = &sums[((seed * like.rows.count + row) * like.levels + level) * 6];
                            add(counts[level * 6 + to], out[to], bins, e.plain, like.unit);
                            add(counts[level * 6 + 3 + to], out[3 + to], bins, e.ratio, like.unit);
                            counts[level * 6 + 3 + to].zero_denominators += e.zero;
                        }
                    }
    }

    static void add(MediumErrorCounts& h, MediumErrorSums& s, const device::clr_bins& bins, float e, double unit) {
        const std::uint32_t slot = device::clr_slot(bins, e);
        const std::int64_t units = device::clr_error_units(e, static_cast<float>(1 / unit));
        s.sum += units;
        s.squares += (units * units + 2048) >> 12;
        if (std::abs(e) <= CLR_ATOM)
            ++h.atom;
        else if (slot < bins.count)
            ++h.bins[slot];
        else
            ++(slot == bins.count + CLR_UNDERFLOW  ? h.underflow
               : slot == bins.count + CLR_OVERFLOW ? h.overflow
                                                   : h.nonfinite);
    }

    std::vector<MediumErrorCounts> counts;
    std::vector<MediumErrorSums> sums;
};

bool same(const std::vector<MediumErrorCounts>& a, const std::vector<MediumErrorCounts>& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const auto& x, const auto& y) {
        return x.bins == y.bins && x.underflow == y.underflow && x.overflow == y.overflow && x.nonfinite == y.nonfinite &&
               x.atom == y.atom && x.zero_denominators == y.zero_denominators;
    });
}

bool same(std::span<const MediumErrorSums> a, std::span<const MediumErrorSums> b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](const auto& x, const auto& y) { return x.sum == y.sum && x.squares == y.squares; });
}

/// Chi-square of the number of lit samples of n, over the pixels of each group by v = mu / tau, against Binomial(n, v): the
/// least p-value of all groups, Sidak-corrected. `shift` moves v: the planted fault.
double binomial_p_value(const MediumScene& scene, const ExactImage& exact, std::uint32_t n, std::uint64_t seeds,
                        double shift) {
    constexpr std::size_t groups = 10;
    std::vector<std::vector<double>> observed(groups, std::vector<double>(n + 1)), expected = observed;
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        const auto image = render(scene, {Sampling::wvds_mean}, {seed}, n);
        for (std::size_t p = 0; p < exact.hit.size(); ++p) {
            const double v = exact.hit[p] ? exact.mu[3 * p] / exact.tau[3 * p] : 0;
            if (v < 0.06 || v > 0.94) continue;
            const double lit = n * static_cast<double>(image.m[3 * p] / image.t[3 * p]);
            EXPECT_NEAR(lit, std::round(lit), 1e-4);
            const auto group = std::min(groups - 1, static_cast<std::size_t>(v * groups));
            ++observed[group][static_cast<std::size_t>(std::lround(lit))];
            const boost::math::binomial law(n, v + shift);
            for (std::uint32_t k = 0; k <= n; ++k) expected[group][k] += boost::math::pdf(law, k);
        }
    }
    double least = 1;
    std::size_t tested = 0;
    for (std::size_t g = 0; g < groups; ++g) {
        double chi = 0, o = 0, e = 0;
        int cells = 0;
        for (std::uint32_t k = 0; k <= n; ++k) {
            o += observed[g][k];
            e += expected[g][k];
            if (e < 10 && k < n) continue;
            if (e > 0) chi += (o - e) * (o - e) / e;
            ++cells;
            o = e = 0;
        }
        if (cells < 2) continue;
        ++tested;
        least = std::min(least, boost::math::cdf(boost::math::complement(boost::math::chi_squared(cells - 1), chi)));
    }
    EXPECT_GE(tested, 5u);
    return 1 - std::pow(1 - least, static_cast<double>(tested));
}

double worst_of(double a, double b) { return std::abs(a / b - 1); }

}  // namespace

TEST(MediumErrors, counts_and_sums_are_the_hosts_in_every_shape) {
    for (const auto& shape : some_shapes()) {
        const MediumScene scene(Engine(shape.options), scenes()[3], {21, 16});
        const auto got = medium_errors(scene, {}, {5, 3}, {2, 9}, {-0.25, 0.25, 16}, {.levels = 4});
        const HostTally want(scene, {}, got);
        EXPECT_TRUE(same(got.counts, want.counts)) << shape.name;
        EXPECT_TRUE(same(got.sums, want.sums)) << shape.name;
    }
}

TEST(MediumErrors, other_samplers_are_the_hosts_too) {
    const MediumScene scene(engine(), scenes()[0], {21, 16});
    for (const Sampler& sampler :
         {Sampler{Sampling::dsa, Pattern::iid, false}, Sampler{Sampling::uni, Pattern::stratified, false},
          Sampler{Sampling::wvds_mis, Pattern::iid, true}}) {
        const auto got = medium_errors(scene, sampler, {1, 2}, {}, {-0.25, 0.25, 256});
        const HostTally want(scene, sampler, got);
        EXPECT_TRUE(same(got.counts, want.counts));
        EXPECT_TRUE(same(got.sums, want.sums));
    }
}

TEST(MediumErrors, a_study_is_its_parts) {
    const MediumScene scene(engine(), scenes()[1], {40, 30});
    const Bins bins{-0.6, 0.6, 64};
    const auto whole = medium_errors(scene, {}, {0, 5}, {}, bins);
    std::vector<MediumErrorCounts> counts(whole.counts.size());
    std::size_t joined = 0;
    for (const IndexRange seeds : {IndexRange{0, 2}, {2, 3}})
        for (const Rows rows : {Rows{0, 11}, {11, 0}}) {
            const auto part = medium_errors(scene, {}, seeds, rows, bins);
            for (std::size_t i = 0; i < counts.size(); ++i) {
                if (counts[i].bins.empty())
                    counts[i] = MediumErrorCounts(Histogram{std::vector<std::uint64_t>(64), 0, 0, 0, -0.6, 0.6});
                counts[i] += part.counts[i];
            }
            const std::size_t row = whole.levels * 6;
            for (std::uint64_t s = 0; s < seeds.count; ++s)
                for (std::uint32_t y = 0; y < part.rows.count; ++y, ++joined)
                    EXPECT_TRUE(same(std::span(part.sums).subspan((s * part.rows.count + y) * row, row),
                                     std::span(whole.sums).subspan(((seeds.first + s) * 30 + rows.first + y) * row, row)));
        }
    EXPECT_EQ(joined, 150u);
    EXPECT_TRUE(same(counts, whole.counts));
}

TEST(MediumErrors, every_value_of_a_hit_is_counted_once) {
    const Study s(3, {Sampling::dsa}, 3);
    for (const auto& h : s.errors.counts) EXPECT_EQ(h.total(), static_cast<std::uint64_t>(s.hits) * 3);
    EXPECT_GT(s.errors.counts[3].zero_denominators, 0u);
    EXPECT_EQ(s.errors.counts[0].zero_denominators, 0u);
}

// Errors of the mean of squares from the spread of the seeds: 5 of them, and the delta method's own 5 % for the ratio.
TEST(MediumErrors, errors_are_as_the_second_moments_predict) {
    for (const std::size_t which : {0, 2}) {
        for (const Sampling sampling : {Sampling::uni, Sampling::wvds_mis}) {
            const Study s(which, {sampling}, 12);
            for (const std::uint32_t level : {0u, 6u}) {
                const double want = predicted(which, sampling, 1u << level).plain;
                const auto got = s.mean(level, false, true);
                EXPECT_NEAR(got.value, want * want, 5 * got.error) << which << " " << name_of(sampling) << " " << level;
            }
            EXPECT_LE(worst_of(s.rmse(6, true), predicted(which, sampling, 64).ratio), 0.05);
            const auto bias = s.mean(6, false, false);
            EXPECT_LE(std::abs(bias.value), 5 * bias.error);
        }
    }
}

TEST(MediumErrors, the_prediction_catches_a_wrong_moment) {
    const Study s(2, {Sampling::uni}, 12);
    const auto got = s.mean(0, false, true);
    const double wrong = predicted(2, Sampling::ds, 1).plain;
    EXPECT_GT(std::abs(got.value - wrong * wrong), 5 * got.error);
}

TEST(MediumErrors, gray_wvds_follows_the_binomial_law) {
    for (const std::size_t which : {0, 1}) {
        const Scene scene = gray(scenes()[which]);
        const Frame frame{100, 75};
        const MediumScene on_device(engine(), scene, frame);
        const ExactImage exact = exact_image(scene, frame);
        for (const std::uint32_t n : {1, 4, 16}) {
            EXPECT_GT(binomial_p_value(on_device, exact, n, 4, 0), 1e-4) << which << " n " << n;
            EXPECT_LT(binomial_p_value(on_device, exact, n, 4, 0.05), 1e-4) << "the planted fault, " << which << " n " << n;
        }
    }
}

TEST(MediumErrors, ratio_and_mean_are_the_same_in_gray_media) {
    const MediumScene scene(engine(), gray(scenes()[2]), small);
    const auto tau = tau_image(scene);
    for (const Sampling sampling : {Sampling::wvds_mean, Sampling::wvds_min, Sampling::wvds_mis}) {
        const auto image = render(scene, {sampling}, {1}, 16);
        for (std::size_t i = 0; i < tau.size(); ++i)
            ASSERT_NEAR(static_cast<double>(image.t[i]), static_cast<double>(tau[i]), 1e-6 * static_cast<double>(tau[i]));
    }
}

// The mean of one-sample ratios is biased, however many there are.
TEST(MediumErrors, averaged_ratios_keep_their_bias) {
    const Scene scene = scenes()[1];
    const MediumScene on_device(engine(), scene, small);
    const ExactImage exact = exact_image(scene, small);
    const auto tau = tau_image(on_device);
    constexpr std::uint32_t images = 64;
    std::vector<double> mean(tau.size());
    double ratio_of_sums = 0, mean_of_ratios = 0, count = 0;
    std::vector<double> m(tau.size()), t(tau.size());
    for (std::uint32_t id = 0; id < images; ++id) {
        const auto one = render(on_device, {Sampling::uni}, {1, id}, 1);
        for (std::size_t i = 0; i < tau.size(); ++i) {
            m[i] += static_cast<double>(one.m[i]);
            t[i] += static_cast<double>(one.t[i]);
            if (one.t[i] > 0) mean[i] += static_cast<double>(tau[i]) * static_cast<double>(one.m[i] / one.t[i]) / images;
        }
    }
    for (std::size_t i = 0; i < tau.size(); ++i) {
        if (!exact.hit[i / 3]) continue;
        mean_of_ratios += mean[i] - exact.mu[i];
        ratio_of_sums += static_cast<double>(tau[i]) * m[i] / t[i] - exact.mu[i];
        ++count;
    }
    // 0.010 is what it tends to; 64 x 4800 samples give it to 0.0006 or so (3 standard errors).
    EXPECT_NEAR(mean_of_ratios / count, 0.010, 0.002);
    EXPECT_LT(std::abs(ratio_of_sums / count), 0.002);
}

// (i) One sample is exact in the light, but for untruncated distance sampling.
TEST(MediumErrors, claim_1_one_sample_is_exact_in_the_light) {
    const Scene scene = scenes()[2];
    const ExactImage exact = exact_image(scene, small);
    const MediumScene on_device(engine(), scene, small);
    const auto tau = tau_image(on_device), reference = reference_image(on_device);
    for (const Sampling sampling : all_samplings) {
        const auto image = render(on_device, {sampling}, {1}, 1);
        double ratio = 0, plain = 0, count = 0;
        for (std::size_t i = 0; i < tau.size(); ++i) {
            if (!exact.hit[i / 3] || exact.mu[i] != exact.tau[i]) continue;
            const float q = image.t[i] > 0 ? image.m[i] / image.t[i] : 0;
            ratio += std::pow(static_cast<double>(tau[i] * q - reference[i]), 2);
            plain += std::pow(static_cast<double>(image.m[i] - reference[i]), 2);
            ++count;
        }
        if (sampling == Sampling::dsa)
            EXPECT_NEAR(std::sqrt(ratio / count), 0.160, 0.01);
        else
            EXPECT_EQ(ratio, 0);
        EXPECT_GT(std::sqrt(plain / count), 0.02);
    }
}

// (ii) Where the medium is nearly lit, most errors of a few samples are bright, and the mean is not.
TEST(MediumErrors, claim_2_most_errors_of_few_samples_are_bright) {
    const Study s(2, {Sampling::wvds_mis}, 8);
    const std::array<double, 7> share{.87, .77, .67, .58, .57, .55, .53};
    for (std::uint32_t level = 0; level < 7; ++level) EXPECT_NEAR(s.bright(level, true), share[level], 0.025) << level;
    EXPECT_LT(s.bias(0, true), 0.001);
    const Study window(1, {Sampling::wvds_mis}, 4);
    EXPECT_NEAR(window.bright(0, true), 0.24, 0.03);
}

// (iii) One sample with the ratio beats ray marching without in three scenes, and not in the window.
TEST(MediumErrors, claim_3_one_ratio_sample_against_ray_marching) {
    const std::array<double, 4> ratio{92.4, 339, 26.6, 74.8}, marching{120.0, 325, 168.3, 425};
    for (std::size_t which = 0; which < 4; ++which) {
        const Study wvds(which, {Sampling::wvds_mis}, 8), march(which, {Sampling::uni, Pattern::stratified, false}, 8);
        EXPECT_LE(worst_of(1e3 * wvds.rmse(0, true), ratio[which]), 0.05) << which;
        EXPECT_LE(worst_of(1e3 * march.rmse(0, false), marching[which]), 0.05) << which;
        EXPECT_EQ(wvds.rmse(0, true) < march.rmse(0, false), which != 1) << which;
    }
}

TEST(MediumErrors, SlowTheWholeTable) {
    std::map<std::pair<std::size_t, std::string>, Study> done;
    for (const TableLine& line : medium_table()) {
        const std::string key = std::string(name_of(line.sampler.sampling)) + std::string(name_of(line.sampler.pattern)) +
                                (line.sampler.independent ? "i" : "");
        const auto [at, fresh] = done.try_emplace({line.scene, key}, line.scene, line.sampler, 128);
        for (std::uint32_t level = 0; level < 7; ++level) {
            const auto got = at->second.mean(level, line.ratio, true);
            // The table's 16 seeds spread sqrt(8) times as much as these 128: 4 of both errors together, and half its last
            // digit.
            const double slack = 4 * 3 * got.error + 2 * line.rmse[level] * line.half_digit[level] * 1e-6;
            EXPECT_NEAR(got.value, std::pow(1e-3 * line.rmse[level], 2), slack) << line.name() << " N=" << (1u << level);
        }
    }
}

TEST(MediumErrors, SlowGrayVarianceIsBinomial) {
    for (std::size_t which = 0; which < 4; ++which) {
        const Scene scene = gray(scenes()[which]);
        const MediumScene on_device(engine(), scene, small);
        const ExactImage exact = exact_image(scene, small);
        for (const std::uint32_t n : {1, 4, 16, 64}) {
            double square = 0, expected = 0;
            for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6, 7, 8}) {
                const auto image = render(on_device, {Sampling::wvds_mean}, {seed}, n);
                for (std::size_t p = 0; p < exact.hit.size(); ++p) {
                    if (!exact.hit[p]) continue;
                    const double v = exact.mu[3 * p] / exact.tau[3 * p];
                    square += std::pow(n * (static_cast<double>(image.m[3 * p] / image.t[3 * p]) - v), 2);
                    expected += n * v * (1 - v);
                }
            }
            EXPECT_LE(worst_of(square, expected), 0.05) << which << " n " << n;
        }
    }
}

// The delta method's range of validity: S4 with bounded weights only, DSA not in S3.
TEST(MediumErrors, SlowEverySamplingIsAsPredicted) {
    for (std::size_t which = 0; which < 4; ++which)
        for (const Sampling sampling : all_samplings) {
            const bool bounded = sampling == Sampling::wvds_mis || sampling == Sampling::wvds_min;
            if (which == 3 && !bounded) continue;
            const Study s(which, {sampling}, 32);
            const Predicted want = predicted(which, sampling, 64);
            EXPECT_LE(worst_of(s.rmse(6, false), want.plain), 0.05) << which << " " << name_of(sampling);
            if (which == 2 && sampling == Sampling::dsa) continue;
            EXPECT_LE(worst_of(s.rmse(6, true), want.ratio), 0.05) << which << " " << name_of(sampling);
        }
    for (const std::size_t which : {0, 1, 2}) {
        const Study s(which, {Sampling::uni, Pattern::iid, true}, 32);
        EXPECT_LE(worst_of(s.rmse(6, true), predicted(which, Sampling::uni, 64).independent), 0.05) << which;
    }
}

// (iv) WVDS against both distance samplings: the summed asymptotic variances.
TEST(MediumErrors, SlowClaim4VarianceRatios) {
    const std::array<double, 4> against_ds{.95, .76, .36, .78}, ratio_ds{.99, .86, 1.15, .96};
    for (std::size_t which = 0; which < 4; ++which) {
        const Predicted wvds = predicted(which, Sampling::wvds_mis, 1), ds = predicted(which, Sampling::dsm, 1);
        EXPECT_NEAR(std::pow(wvds.plain / ds.plain, 2), against_ds[which], 0.01) << which;
        EXPECT_NEAR(std::pow(wvds.ratio / ds.ratio, 2), ratio_ds[which], 0.01) << which;
        const Predicted mean = predicted(which, Sampling::wvds_mean, 1), dsa = predicted(which, Sampling::dsa, 1);
        const std::array<double, 4> against_dsa{.17, .41, .04, 1.02};
        EXPECT_NEAR(std::pow(mean.plain / dsa.plain, 2), against_dsa[which], 0.01) << which;
    }
}
