// What clratio audit says of the supplement's equations: claims, and the numbers that decide them.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "clratio/engine.hpp"

namespace tool::audit {

enum class Verdict { right, misleading, wrong };

/// How a number must stand to what is expected of it.
enum class Relation { equal, below, above };

/// One number, computed, and what we say it is.
struct Number {
    std::string what;
    double value = 0;
    double error = 0;  ///< one standard error where `sampled`, else a bound on how far the value may be off
    bool sampled = true;
    double expected = 0;
    Relation relation = Relation::equal;
    std::optional<double> refuted{};  ///< what the number would be if the supplement were taken at its word
};

/// A sampled number may be this many standard errors off: by chance one of 1.7 million is further.
constexpr double standard_errors = 5;

/// An average of independent values, with its standard error.
struct Average {
    double value = 0, error = 0;
};

inline Number sampled(std::string what, Average a, double expected, std::optional<double> refuted = {}) {
    return {std::move(what), a.value, a.error, true, expected, Relation::equal, refuted};
}

inline Number sampled(std::string what, Average a, Relation relation, double expected) {
    return {std::move(what), a.value, a.error, true, expected, relation};
}

inline Number computed(std::string what, double value, double bound, double expected, std::optional<double> refuted = {}) {
    return {std::move(what), value, bound, false, expected, Relation::equal, refuted};
}

inline double tolerance(const Number& n) { return n.sampled ? standard_errors * n.error : n.error; }

/// Is the value where we say, and not where the supplement has it? A NaN holds nothing.
inline bool holds(const Number& n) {
    const double off = n.value - n.expected, room = tolerance(n);
    const bool where_expected = n.relation == Relation::equal   ? std::abs(off) <= room
                                : n.relation == Relation::above ? off > room
                                                                : off < -room;
    return where_expected && (!n.refuted || std::abs(n.value - *n.refuted) > room);
}

/// What the numbers are computed with.
struct Work {
    clratio::Engine engine;
    std::uint64_t samples;  ///< of an error law, and, up to a limit, pairs (m, t) of a model
};

/// A sentence or an equation of the supplement, and what became of it.
struct Finding {
    std::string equation;  ///< "5"; "18, 19"; "text" for a sentence without a number
    std::string said;
    Verdict verdict;
    std::string truth;
    std::vector<Number> numbers;
};

/// Equations (1) to (13), and the sentences around them: expectations, estimators, progressive sums.
std::vector<Finding> estimator_findings(const Work& work);
/// Equations (14) to (23): the law of the error.
std::vector<Finding> law_findings(const Work& work);
/// The sentences on Figures 1 and 2: variance, spread, brightness, precision.
std::vector<Finding> figure_findings(const Work& work);

struct Report {
    std::string device;
    std::uint64_t samples = 0;
    double seconds = 0;
    std::vector<Finding> findings{};
};

/// All findings; `tell` hears of each part before it starts.
Report examine(const Work& work, const std::function<void(const char* part)>& tell);

bool all_hold(const Report& report);
/// "right", "right, misleading", "wrong".
const char* name_of(Verdict verdict);
/// A number and its error, what is expected of it, and what it would be if the supplement were right, for people.
std::string value_of(const Number& number, const char* plus_minus);
std::string expected_of(const Number& number);
std::string text_of(const Report& report);
std::string markdown_of(const Report& report);
std::string json_of(const Report& report);

}  // namespace tool::audit
