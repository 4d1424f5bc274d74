// What clratio combine can be asked for: every option, its help, and which ones fit together.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "bands.hpp"
#include "clratio/image.hpp"
#include "tool.hpp"

namespace tool::combining {

inline const std::map<std::string, clratio::Estimator> estimators{{"ratio", clratio::Estimator::ratio},
                                                                  {"mean", clratio::Estimator::mean},
                                                                  {"mean-of-ratios", clratio::Estimator::mean_of_ratios}};
inline const std::map<std::string, clratio::Zero> zeros{
    {"mc-mean", clratio::Zero::mc_mean}, {"zero", clratio::Zero::zero}, {"one", clratio::Zero::one}};
inline const std::map<std::string, clratio::NonFinite> nonfinites{
    {"skip", clratio::NonFinite::skip}, {"propagate", clratio::NonFinite::propagate}, {"fail", clratio::NonFinite::fail}};

struct Options {
    std::vector<std::string> m, t, tau;  ///< with `watch`: one pattern each of m and t
    std::string output, standard_error, flags, layer, reference;
    std::string estimator = "ratio", zero = "mc-mean", nonfinite = "skip";
    bool fail_on_flag = false, json = false;

    std::string state;
    bool resume = false, nonfinite_given = false;
    std::uint64_t first_batch = 0;
    double checkpoint = 30;  ///< seconds

    std::string watch;
    double settle = 1;  ///< seconds
    std::optional<std::uint64_t> until_batches;
    std::optional<double> until_error;

    clratio::CombineOptions combine() const {
        return {estimators.at(estimator), zeros.at(zero), !standard_error.empty() || until_error};
    }
    Wanted wanted() const {
        // A missing error bar is no defect of a run that asked for none.
        const std::uint32_t counted = ~std::uint32_t{standard_error.empty() ? CLR_FLAG_NO_ERROR_BAR : 0u};
        return {combine(), !reference.empty(), !flags.empty(), counted};
    }
    /// Of a state that is begun here.
    clratio::MomentsOptions moments() const {
        return {nonfinites.at(nonfinite), estimators.at(estimator) == clratio::Estimator::mean_of_ratios};
    }
};

/// Adds the options and the footer to the subcommand, which fills `options` when it is parsed.
void add_options(CLI::App& command, const std::shared_ptr<Options>& options);

/// UsageError for options that do not fit together, IoError for a folder that is not there: before the work, not after it.
void check(const Options& options);

}  // namespace tool::combining
