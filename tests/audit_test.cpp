// clratio audit: every equation is there, every number as expected, and a number that is not would be seen.
#include "audit.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <sstream>

#include "support/tool.hpp"

using clratio::test::clratio_tool;
using clratio::test::Words;
using nlohmann::json;
using tool::audit::computed;
using tool::audit::holds;
using tool::audit::Number;
using tool::audit::Relation;
using tool::audit::sampled;

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

Number number_of(const json& row) {
    const std::string relation = row["relation"];
    Number n{row["number"], row["value"], row["error"], row["error_kind"] == "standard error", row["expected"]};
    n.relation = relation == "=" ? Relation::equal : relation == "<" ? Relation::below : Relation::above;
    if (!row["refuted"].is_null()) n.refuted = row["refuted"].get<double>();
    return n;
}

void every_number_is_as_expected(const json& rows) {
    for (const auto& row : rows) EXPECT_TRUE(row["ok"].get<bool>()) << row.dump(2);
}

void no_equation_is_missing(const json& rows) {
    std::set<int> missing;
    for (int k = 1; k <= 23; ++k) missing.insert(k);
    int sentences = 0;
    for (const auto& row : rows) {
        const std::string equation = row["equation"];
        sentences += equation == "text";
        std::istringstream parts(equation);
        for (std::string part; std::getline(parts, part, ',');) missing.erase(std::atoi(part.c_str()));
        for (const char* key : {"said", "truth", "verdict"}) EXPECT_FALSE(row[key].get<std::string>().empty());
        EXPECT_TRUE(row["value"].is_number()) << row.dump(2);
    }
    EXPECT_EQ(missing, std::set<int>{});
    EXPECT_GT(sentences, 0);
}

// The planted fault: each number expected elsewhere, by twice its room and a little for those that have none.
void an_expectation_that_is_off_is_seen(const json& rows) {
    for (const auto& row : rows) {
        const Number n = number_of(row);
        ASSERT_TRUE(holds(n)) << row.dump(2);
        const double room = 2 * tool::audit::tolerance(n) + 1e-9 * std::max(1.0, std::abs(n.value));
        Number shifted = n;
        shifted.expected = n.value + (n.relation == Relation::below ? -room : room);
        EXPECT_FALSE(holds(shifted)) << row.dump(2);
        if (n.relation != Relation::equal) continue;
        shifted.expected = n.value - room;
        EXPECT_FALSE(holds(shifted)) << row.dump(2);
    }
}

// What the supplement's words give is kept away from, wherever the audit names it, by enough to notice with 10^6 samples.
void what_is_refuted_is_far_away(const json& rows) {
    std::size_t refuted = 0;
    for (const auto& row : rows) {
        Number n = number_of(row);
        if (!n.refuted) continue;
        ++refuted;
        n.expected = *n.refuted;
        EXPECT_FALSE(holds(n)) << row.dump(2);
    }
    EXPECT_GT(refuted, 20u);
}

TEST(Audit, Holds) {
    EXPECT_TRUE(holds(sampled("at 4.9 standard errors", {1.49, 0.1}, 1)));
    EXPECT_FALSE(holds(sampled("at 5.1", {1.51, 0.1}, 1)));
    EXPECT_TRUE(holds(computed("in the bound", 1.1, 0.2, 1)));
    EXPECT_FALSE(holds(computed("outside", 1.3, 0.2, 1)));
    EXPECT_TRUE(holds(computed("and what is refuted is not in it", 1.1, 0.2, 1, 1.5)));
    EXPECT_FALSE(holds(computed("it is", 1.1, 0.2, 1, 1.25)));
    EXPECT_TRUE(holds(sampled("above", {2, 0.1}, Relation::above, 1)));
    EXPECT_FALSE(holds(sampled("above, hardly", {1.4, 0.1}, Relation::above, 1)));
    EXPECT_TRUE(holds(sampled("below", {0, 0.1}, Relation::below, 1)));
    EXPECT_FALSE(holds(sampled("below, hardly", {0.6, 0.1}, Relation::below, 1)));
    for (const auto relation : {Relation::equal, Relation::above, Relation::below}) {
        Number none{"no value", nan, 0.1, false, 0, relation};
        EXPECT_FALSE(holds(none));
        none = {"no expectation", 0, 0.1, false, nan, relation};
        EXPECT_FALSE(holds(none));
    }
    EXPECT_FALSE(holds(computed("no refuted value", 1, 0.1, 1, nan)));
}

// docs/audit.md was printed by the command as it is now: the same claims word for word.
void the_page_is_up_to_date(const json& rows) {
    const std::string page = clratio::test::bytes_of(CLRATIO_SOURCE "/docs/audit.md");
    for (const auto& row : rows)
        for (const char* key : {"said", "truth"})
            EXPECT_NE(page.find(row[key].get<std::string>()), std::string::npos)
                << row[key] << ": run clratio audit --markdown";
    EXPECT_EQ(page.find("FAILS"), std::string::npos);
}

TEST(Audit, Quick) {
    const auto said = clratio_tool({"audit", "--quick", "--json"});
    ASSERT_EQ(said.code, 0) << said.err << said.out;
    EXPECT_EQ(said.err, "");
    const json rows = json::parse(said.out, nullptr, false);
    ASSERT_TRUE(rows.is_array());
    every_number_is_as_expected(rows);
    no_equation_is_missing(rows);
    an_expectation_that_is_off_is_seen(rows);
    what_is_refuted_is_far_away(rows);
    the_page_is_up_to_date(rows);
}

TEST(Audit, TextFitsItsColumns) {
    const auto said = clratio_tool({"audit", "--quick"});
    EXPECT_EQ(said.code, 0);
    std::istringstream lines(said.out);
    for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 100u) << line;
}

TEST(Audit, RefusesWhatDoesNotFit) {
    for (const Words& words :
         {Words{"audit", "--samples", "10"}, {"audit", "-q", "--samples", "2000000"}, {"audit", "--json", "--markdown"}}) {
        const auto said = clratio_tool(words);
        EXPECT_EQ(said.code, 2) << said.err;
        EXPECT_EQ(said.out, "");
    }
}

}  // namespace
