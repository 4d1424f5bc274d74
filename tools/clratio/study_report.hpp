// What a study shows: verdicts on the published claims, and one page of HTML.
#pragma once

#include "study.hpp"

namespace tool::study {

enum class Verdict { holds, weakly, fails, undecided };
const char* name_of(Verdict verdict);

/// One thing that a claim says of one scene: two numbers, and how they compare.
struct Finding {
    std::string scene, what;
    Verdict verdict = Verdict::undecided;
    std::string numbers;
};

struct Claim {
    std::string id;       ///< "i"
    std::string said;     ///< by the supplement, in our words
    std::string summary;  ///< what the run says
    std::vector<Finding> findings;
};

/// The four claims of the supplement's section on single scattering, each with verdicts from these numbers alone.
std::vector<Claim> claims_of(const Results& results);
Json json_of(const Claim& claim);
std::string text_of(const Claim& claim);

/// The parts of one series: those that have a time in this folder and on this device, of how many.
struct SeriesTime {
    Series series;
    std::uint64_t parts = 0;
    std::vector<PartTime> timed;
};

struct RunTimes {
    bool quick = false;
    PartTime computed;               ///< of the parts that this run computed
    double whole = 0;                ///< seconds, of all up to the report
    double looks = 0;                ///< seconds of these: predictions, lit pixels, short chords, averages
    std::vector<SeriesTime> series;  ///< of the plan
};
void write_report(const Results& results, const std::vector<Claim>& claims, const clratio::Engine& engine,
                  const RunTimes& times, const std::string& file);

}  // namespace tool::study
