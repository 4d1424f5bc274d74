// Parts of the report that stand apart, and the names it gives to samplings.
#pragma once

#include "study_report.hpp"

namespace tool::study {

/// "WVDS, MIS"; "Ray marching, stratified".
const char* title_of(clratio::Sampling sampling);
std::string title_of(const clratio::Sampler& sampler);

/// One entry of a plot's key: a mark, on a line or alone.
std::string key_of(const std::string& classes, bool line, const std::string& name);

// Whole sections, HTML.
std::string chords_section(const Results& results);
std::string averages_section(const Results& results);
std::string speed_section(const Results& results, const RunTimes& times, const std::string& device);

}  // namespace tool::study
