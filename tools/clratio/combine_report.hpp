// What clratio combine was asked for, and what it has to say at the end.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "bands.hpp"
#include "clratio/image.hpp"
#include "difference.hpp"
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
    std::vector<std::string> m, t, tau;
    std::string output, standard_error, flags, layer, reference;
    std::string estimator = "ratio", zero = "mc-mean", nonfinite = "skip";
    bool fail_on_flag = false, json = false;

    clratio::CombineOptions combine() const { return {estimators.at(estimator), zeros.at(zero), !standard_error.empty()}; }
    Wanted wanted() const {
        // A missing error bar is no defect of a run that asked for none.
        const std::uint32_t counted = ~std::uint32_t{standard_error.empty() ? CLR_FLAG_NO_ERROR_BAR : 0u};
        return {combine(), !reference.empty(), !flags.empty(), counted};
    }
    clratio::MomentsOptions moments() const {
        return {nonfinites.at(nonfinite), estimators.at(estimator) == clratio::Estimator::mean_of_ratios};
    }
};

struct Seconds {
    double decode = 0, device = 0, encode = 0;
};

struct Scores {
    Difference estimate, mean;
};

struct Report {
    std::string device;
    clratio::Image shape;  ///< of the first batch, without its values
    std::uint64_t batches = 0, negatives = 0;
    clratio::FlagCounts flags;
    std::uint64_t flagged = 0;  ///< values with a flag that matters to this run
    Seconds seconds;
    std::optional<Scores> scores;
};

Json json_of(const Options& options, const Report& report);
void print_text(const Options& options, const Report& report);

}  // namespace tool::combining
