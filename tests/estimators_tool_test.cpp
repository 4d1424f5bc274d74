// clratio estimators against theory.md's table of 20 million samples a cell, printed to two digits.
#include <gtest/gtest.h>

#include <cmath>

#include "support/tool.hpp"

using namespace clratio::test;

namespace {

json simulate(const Words& more) { return answer(Words{"estimators"} + more); }

json cell(const json& result, const std::string& estimator, int n) {
    for (const auto& c : result.at("estimators").at(estimator))
        if (c.at("n") == n) return c;
    throw std::runtime_error("no cell " + estimator + " at " + std::to_string(n));
}

struct Known {
    std::string estimator;
    int n;
    double bias, rmse;
};

const std::vector<Known> model_a{{"mean", 4, 0, 1.63},
                                 {"ratio", 1, -.16, .85},
                                 {"ratio", 2, -.20, .93},
                                 {"ratio", 4, -.23, .98},
                                 {"ratio", 16, -.26, 1.04},
                                 {"beale", 2, -.14, 1.00},
                                 {"beale", 8, -.11, 1.07},
                                 {"tin", 2, -.13, 1.03},
                                 {"jackknife, 2 groups", 4, -.06, 1.13},
                                 {"jackknife, 8 groups", 8, -.03, 1.12},
                                 {"hartley-ross", 2, 0, 1.39},
                                 {"hartley-ross", 16, 0, 1.15},
                                 {"mickey, 8 groups", 8, 0, 1.16},
                                 {"mickey, 8 groups", 16, 0, 1.12},
                                 {"regression", 8, -.23, 1.12},
                                 {"crossfit-regression, 8", 8, 0, 1.39},
                                 {"crossfit-regression, 8", 16, 0, 1.23},
                                 {"mean-of-ratios, 8 batches", 8, -1.3, .95},
                                 {"mean-of-ratios, 8 batches", 16, -1.6, 1.00},
                                 {"mean-of-ratios", 16, -2.6, 1.06}};

/// How far a cell is from the table, in units of what rounding (half of the last digit printed, and of the table's own
/// noise) and 5 standard errors allow.
double excess(const json& result, const Known& k) {
    const auto c = cell(result, k.estimator, k.n);
    const double digit = std::fabs(k.bias) >= 1 ? .05 : .005;
    const auto one = [&](const char* name, double want, double rounding) {
        const auto& m = c.at(name);
        const double error = m.at("standard_error");
        return std::fabs(m.at("mean").get<double>() - want) / (2 * rounding + 5 * error);
    };
    return std::max(one("bias_times_weight", k.bias, digit), one("rmse_times_root_weight", k.rmse, .005));
}

}  // namespace

TEST(EstimatorsTool, reproduces_the_table_of_model_a) {
    const auto a = simulate({"--models", "A", "--samples", "2000000", "--most", "16"}).at(0);
    for (const Known& k : model_a) EXPECT_LE(excess(a, k), 1) << k.estimator << " at " << k.n;
    for (Known k : model_a) {
        if (k.estimator == "ratio") continue;
        k.estimator = "ratio";
        EXPECT_GT(excess(a, k), 1) << "planted fault: the ratio's numbers in another's place, at " << k.n;
    }
    const auto& at_4 = a.at("coverage").at(0);
    EXPECT_EQ(at_4.at("n"), 4);
    // The table has 40,000 replicates, .0025 each at most, and two digits.
    EXPECT_NEAR(at_4.at("delta").at("mean"), .79, .01);
    EXPECT_NEAR(at_4.at("fieller").at("mean"), .94, .01);
    EXPECT_NEAR(at_4.at("mean").at("mean"), .84, .01);
    EXPECT_NEAR(at_4.at("unbounded"), .52, .01);
}

TEST(EstimatorsTool, unbiased_estimators_stay_so_with_unequal_weights) {
    const auto all = simulate({"--models", "A", "B", "--samples", "500000", "--most", "16", "--unequal"});
    for (const auto& model : all)
        for (const char* name : {"mean", "mickey, 8 groups", "crossfit-regression, 8"}) {
            const auto bias = cell(model, name, 16).at("bias_times_weight");
            EXPECT_NEAR(bias.at("mean"), 0, 5 * bias.at("standard_error").get<double>()) << name;
        }
    const auto bias = cell(all.at(0), "ratio", 16).at("bias_times_weight");
    EXPECT_LT(bias.at("mean").get<double>() + 5 * bias.at("standard_error").get<double>(), 0)
        << "planted fault: a biased one passes";
}

TEST(EstimatorsTool, SlowTails_of_model_c) {
    const auto c = simulate({"--models", "C", "--samples", "10000000", "--most", "64"}).at(0);
    for (Known k : std::vector<Known>{{"ratio", 2, .23, .87}, {"ratio", 8, .44, 1.01}, {"ratio", 64, .82, 1.21}}) {
        EXPECT_LE(excess(c, k), 1) << k.n;
        k.estimator = "beale";
        EXPECT_GT(excess(c, k), 1) << "planted fault: another estimator's numbers, at " << k.n;
    }
}

TEST(EstimatorsTool, models_are_separated_as_one_likes_and_short_tables_end) {
    const auto one = simulate({"--models", "A,B", "--samples", "2048", "--most", "3"});
    EXPECT_EQ(one, simulate({"--models", "A", "B", "--samples", "2048", "--most", "3"}));
    EXPECT_EQ(one.at(1).at("model"), "B");
    EXPECT_EQ(one.at(0).at("coverage"), json::array());
    const auto text = [](const char* most) {
        return clratio_tool({"estimators", "--models", "A", "--samples", "2048", "--most", most}).out;
    };
    EXPECT_EQ(text("3").find("Coverage"), std::string::npos) << "of no N";
    EXPECT_NE(text("4").find("Coverage"), std::string::npos);
}

TEST(EstimatorsTool, misuse_is_refused) {
    const Said said = clratio_tool({"estimators", "--models", "Z"});
    EXPECT_EQ(said.code, 2);
    EXPECT_NE(said.err.find("--models"), std::string::npos) << said.err;
}
