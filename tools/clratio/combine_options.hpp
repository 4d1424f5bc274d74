// What clratio combine can be asked for: every option, its help, and which ones fit together.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bands.hpp"
#include "clratio/image.hpp"
#include "command.hpp"

namespace tool::combining {

inline const std::map<std::string, clratio::Estimator> estimators = [] {
    std::map<std::string, clratio::Estimator> names;
    for (const auto e : clratio::all_estimators()) names[clratio::name_of(e)] = e;
    return names;
}();
inline const std::map<std::string, clratio::IntervalMethod> methods{{"fieller", clratio::IntervalMethod::fieller},
                                                                    {"delta", clratio::IntervalMethod::delta}};
inline const std::map<std::string, clratio::Weights> weightings{{"samples", clratio::Weights::samples},
                                                                {"reliability", clratio::Weights::reliability}};
inline const std::map<std::string, clratio::Zero> zeros{
    {"mc-mean", clratio::Zero::mc_mean}, {"zero", clratio::Zero::zero}, {"one", clratio::Zero::one}};
inline const std::map<std::string, clratio::NonFinite> nonfinites{
    {"skip", clratio::NonFinite::skip}, {"propagate", clratio::NonFinite::propagate}, {"fail", clratio::NonFinite::fail}};

struct Options {
    std::vector<std::string> m, t, tau;  ///< with `watch`: one pattern each of m and t
    std::string output, standard_error, flags, layer, reference;
    std::string estimator = "ratio", zero = "mc-mean", nonfinite = "skip";
    bool fail_on_flag = false, json = false;

    std::optional<std::uint32_t> groups;
    std::vector<double> weight;  ///< none: 1 each; one: of all; else of each listed batch
    std::string weights = "samples";
    std::optional<std::uint32_t> fixed, range;  ///< bits after and before the point

    std::optional<double> interval;
    std::string method = "fieller", lower, upper, kind, bias, gain, needed;
    float target = 0, relative_target = 0;

    std::string state;
    bool resume = false, nonfinite_given = false, weights_given = false;
    std::uint64_t first_batch = 0;
    double checkpoint = 30;  ///< seconds

    std::string watch;
    double settle = 1;  ///< seconds
    std::optional<std::uint64_t> until_batches;
    std::optional<double> until_error;

    clratio::Estimator chosen() const { return estimators.at(estimator); }
    /// The plain mean, its error and its delta interval are the same for any tau.
    bool uses_tau() const {
        return chosen() != clratio::Estimator::mean || !bias.empty() || (interval && method != "delta");
    }
    clratio::CombineOptions combine() const;
    Wanted wanted() const;
    /// Of a state that is begun here.
    Sums sums() const;
    double weight_of(std::uint64_t index) const;
};

/// Adds the options and the footer to the subcommand, which fills `options` when it is parsed.
void add_options(Command& command, const std::shared_ptr<Options>& options);

/// UsageError for options that do not fit together, IoError for a folder that is not there: before the work, not after it.
void check(const Options& options);

/// IoError for a batch that is missing: before the others are read, where nothing keeps them.
void require_batches(const Options& options);

}  // namespace tool::combining
