// The audit as text of 100 columns, as JSON and as a page of the docs.
#include <algorithm>
#include <cmath>
#include <sstream>

#include "audit.hpp"
#include "tool.hpp"

namespace tool::audit {
namespace {

constexpr std::size_t columns = 100;

const char* sign_of(Relation r) { return r == Relation::equal ? "=" : r == Relation::below ? "<" : ">"; }

std::vector<std::string> wrap(const std::string& text, std::size_t width) {
    std::vector<std::string> lines{""};
    std::istringstream words(text);
    for (std::string word; words >> word;) {
        if (!lines.back().empty() && lines.back().size() + 1 + word.size() > width) lines.emplace_back();
        lines.back() += (lines.back().empty() ? "" : " ") + word;
    }
    return lines;
}

// A bound that shows among the digits of what is expected, not mere rounding.
bool shows(const Number& n) { return !n.sampled && n.expected != 0 && n.error > 1e-4 * std::abs(n.expected); }

// With decimals that show two digits of the error, where there is one to show.
std::string plain(const Number& n, double v) {
    if (v == 0) return "0";
    if (shows(n) || (n.sampled && n.error > 0))
        return fmt::format("{:.{}f}", v, std::clamp(1 - static_cast<int>(std::floor(std::log10(n.error))), 0, 9));
    return fmt::format("{:.{}g}", v, n.sampled ? 3 : 6);
}

}  // namespace

const char* name_of(Verdict v) {
    return v == Verdict::right ? "right" : v == Verdict::misleading ? "right, misleading" : "wrong";
}

std::string value_of(const Number& n, const char* plus_minus) {
    if (n.sampled && n.error > 0) return fmt::format("{} {} {:.2g}", plain(n, n.value), plus_minus, n.error);
    if (shows(n)) return fmt::format("{} ({:.2g})", plain(n, n.value), n.error);
    return plain(n, n.value);
}

std::string expected_of(const Number& n) {
    std::string out = fmt::format("{} {}", sign_of(n.relation), plain(n, n.expected));
    if (n.relation == Relation::equal && !n.sampled && n.expected == 0 && n.error > 0)
        out = fmt::format("< {:.2g}", n.error);
    return out;
}

namespace {

std::string refuted_of(const Number& n) { return n.refuted ? "not " + plain(n, *n.refuted) : ""; }

const char* outcome_of(const Number& n) { return holds(n) ? "ok" : "FAILS"; }

std::string heading(const std::string& equation) { return equation == "text" ? "text" : "(" + equation + ")"; }

void paragraph(std::string& out, const char* label, const std::string& text) {
    for (const auto& line : wrap(text, columns - 10)) {
        out += fmt::format("    {:<6}{}\n", label, line);
        label = "";
    }
}

void number_line(std::string& out, const Number& n) {
    constexpr std::size_t what_width = 40;
    const auto what = wrap(n.what, what_width);
    for (std::size_t i = 0; i + 1 < what.size(); ++i) out += fmt::format("    {}\n", what[i]);
    std::string line = fmt::format("    {:<{}}  {:<20} {:<13} {:<13}", what.back(), what_width, value_of(n, "+-"),
                                   expected_of(n), refuted_of(n));
    out += fmt::format("{} {}\n", line, outcome_of(n));
}

struct Tally {
    std::size_t verdicts[3]{}, numbers = 0, failed = 0;
};

Tally tally(const Report& report) {
    Tally t;
    for (const auto& finding : report.findings) {
        ++t.verdicts[static_cast<std::size_t>(finding.verdict)];
        t.numbers += finding.numbers.size();
        t.failed +=
            static_cast<std::size_t>(std::ranges::count_if(finding.numbers, [](const Number& n) { return !holds(n); }));
    }
    return t;
}

std::string summary(const Report& report) {
    const Tally t = tally(report);
    return fmt::format("{} claims: {} right, {} right but misleading, {} wrong. {} numbers: {}.", report.findings.size(),
                       t.verdicts[0], t.verdicts[1], t.verdicts[2], t.numbers,
                       t.failed == 0 ? "all as expected" : fmt::format("{} NOT AS EXPECTED", t.failed));
}

constexpr auto page_head = R"(# The supplement's equations, checked
Printed by `clratio audit --markdown`; do not edit it, run that command again.

The library computes what *Ratio Estimator Properties*, supplemental material IV by Velinov and Mitchell, describes. Some of its equations and
sentences say more than is true, and a reader who implements them as printed gets a density that does not integrate to 1 and progressive weights
that do not sum to 1. Each is taken in turn here: what is said (in our words), what is true, and the numbers that decide it, drawn or integrated
when the command ran. `clratio audit` repeats it on your device, in under a minute, and exits with 1 if any number is not what it should be.

How to read the tables: *value* has its standard error behind ± where it comes from samples; such a number must be within 5 standard errors of
what is *expected*. The others are computed within a bound, in brackets where it shows. *Not* is what the claim as printed would give: the value
must be further from it than that. The seeds were fixed beforehand. The models of pairs (m, t), with tau = 1 but for C:

- A: t lognormal, .8 in the log; m = V t, visible (V = 1) with probability .2 + .7 t / (1 + t). Correlation .77. A0: the same with .6.
- B: m and t lognormal, .6 in the log, independent.
- C: t Pareto of exponent 2.2; m = V t, V = 1 with probability .8 / (1 + .3 (t - 1)). Correlation .13.

s is the relative deviation of the denominator, st / |tau + i|; sd the deviation of the residual m - (mu / tau) t; n the samples in an
estimate; KS the largest distance of two distribution functions.
)";

}  // namespace

bool all_hold(const Report& report) { return tally(report).failed == 0; }

std::string text_of(const Report& report) {
    std::string out;
    for (const auto& finding : report.findings) {
        out += fmt::format("{:<8}  {}\n", heading(finding.equation), name_of(finding.verdict));
        paragraph(out, "said", finding.said);
        paragraph(out, "true", finding.truth);
        for (const auto& n : finding.numbers) number_line(out, n);
        out += "\n";
    }
    return out +
           fmt::format("{}\n{} samples, {:.1f} s on {}\n", summary(report), report.samples, report.seconds, report.device);
}

std::string markdown_of(const Report& report) {
    std::string out = page_head;
    for (const auto& finding : report.findings) {
        out += fmt::format("\n## {}: {}\n", heading(finding.equation), name_of(finding.verdict));
        out += fmt::format("*Said:* {}.  \n*True:* {}\n\n", finding.said, finding.truth);
        out += "| number | value | expected | not | |\n|---|---|---|---|---|\n";
        for (const auto& n : finding.numbers) {
            std::string what = n.what;
            for (std::size_t at = 0; (at = what.find('|', at)) != std::string::npos; at += 2) what.replace(at, 1, "\\|");
            out += fmt::format("| {} | {} | {} | {} | {} |\n", what, value_of(n, "±"), expected_of(n),
                               refuted_of(n).substr(n.refuted ? 4 : 0), outcome_of(n));
        }
    }
    return out + fmt::format("\n## In all\n{} {} samples.\n", summary(report), report.samples);
}

std::string json_of(const Report& report) {
    Json out = Json::array();
    for (const auto& finding : report.findings)
        for (const auto& n : finding.numbers)
            out.push_back({{"equation", finding.equation},
                           {"said", finding.said},
                           {"verdict", name_of(finding.verdict)},
                           {"truth", finding.truth},
                           {"number", n.what},
                           {"value", n.value},
                           {"error", n.error},
                           {"error_kind", n.sampled ? "standard error" : "bound"},
                           {"expected", n.expected},
                           {"relation", sign_of(n.relation)},
                           {"refuted", n.refuted ? Json(*n.refuted) : Json()},
                           {"ok", holds(n)}});
    return out.dump(2) + "\n";
}

}  // namespace tool::audit
