#include "clratio/device/twofloat.h"

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>

#include "support/samples.hpp"

using namespace clratio;
using namespace clratio::test;
using namespace clratio::device;
using Exact = boost::multiprecision::cpp_bin_float_100;  // holds every sum and product here without rounding

namespace {

constexpr int draws = 200'000;
constexpr double unit = 0x1p-24;  // what one rounding may lose

Exact of(float x) { return Exact(x); }
Exact of(clr_two x) { return Exact(x.hi) + Exact(x.lo); }
double size(Exact x) { return std::abs(static_cast<double>(x)); }

/// Both signs, 2^-20 to 2^20, and whole numbers, where sums cancel.
float draw_float(Samples& s) {
    const double sign = s.uniform() < 0.5 ? -1 : 1;
    if (s.uniform() < 0.2) return static_cast<float>(sign * static_cast<double>(s.bits() % 5));
    return static_cast<float>(sign * std::exp2(40 * s.uniform() - 20));
}

clr_two draw_tight(Samples& s) {
    const float hi = draw_float(s);
    return clr_two_quick_sum(hi, static_cast<float>(hi * unit * (2 * s.uniform() - 1)));
}

clr_two draw_loose(Samples& s) {
    const float hi = draw_float(s);
    return {hi, static_cast<float>(16 * hi * unit * (2 * s.uniform() - 1))};
}

/// The largest error of `pair` against `exact`, in units of the bound that goes with it.
template <class Case> double worst(std::uint64_t seed, Case one) {
    Samples s(seed);
    double most = 0;
    for (int k = 0; k < draws; ++k) {
        const auto [pair, exact, bound] = one(s);
        const double error = size(of(pair) - exact);
        if (error > 0) most = std::max(most, error / bound);
    }
    return most;
}

struct Drawn {
    clr_two pair;
    Exact exact;
    double bound;
};

/// x + a b: 5 roundings, each of a number that is at most the sum of the parts of lo.
Drawn gathered(clr_two sum, clr_two x, clr_two a, clr_two b) {
    const double ab = size(of(a) * of(b));
    const double parts = size(of(x.lo)) + 2 * unit * (size(of(x.hi)) + ab) + size(of(a.lo) * of(b.hi)) +
                         size(of(a.hi) * of(b.lo)) + size(of(a.lo) * of(b.lo));
    return {sum, of(x) + of(a) * of(b), 5 * unit * parts};
}

bool takes_more_than_half(clr_two x, clr_two a, clr_two b) {
    const Exact ab = of(a.hi) * of(b.hi);
    return ab * of(x.hi) < 0 && 2 * size(ab) > size(of(x.hi));
}

}  // namespace

TEST(TwoFloat, transformations_are_without_error) {
    Samples s(1);
    for (int k = 0; k < draws; ++k) {
        const float a = draw_float(s), b = draw_float(s);
        ASSERT_EQ(of(clr_two_sum(a, b)), of(a) + of(b)) << a << ' ' << b;
        ASSERT_EQ(of(clr_two_difference(a, b)), of(a) - of(b)) << a << ' ' << b;
        ASSERT_EQ(of(clr_two_product(a, b)), of(a) * of(b)) << a << ' ' << b;
        const float large = std::abs(a) < std::abs(b) ? b : a, little = std::abs(a) < std::abs(b) ? a : b;
        ASSERT_EQ(of(clr_two_quick_sum(large, little)), of(a) + of(b)) << a << ' ' << b;
    }
}

TEST(TwoFloat, sums_and_quotients_keep_their_bounds) {
    EXPECT_LT(worst(2,
                    [](Samples& s) {
                        const clr_two x = draw_tight(s), y = draw_tight(s);
                        return Drawn{clr_two_add(x, y), of(x) + of(y), 0x1p-46 * (size(of(x)) + size(of(y)))};
                    }),
              1);
    EXPECT_LT(worst(3,
                    [](Samples& s) {
                        const clr_two x = draw_tight(s), y = draw_tight(s);
                        return Drawn{clr_two_subtract(x, y), of(x) - of(y), 0x1p-46 * (size(of(x)) + size(of(y)))};
                    }),
              1);
    EXPECT_LT(worst(4,
                    [](Samples& s) {
                        const clr_two x = draw_tight(s);
                        clr_two y = draw_tight(s);
                        if (y.hi == 0) y.hi = 1;
                        const Exact q = of(x) / of(y);
                        return Drawn{clr_two_divide(x, y), q, 0x1p-43 * size(q)};
                    }),
              1);
}

TEST(TwoFloat, gathered_products_keep_their_bounds) {
    EXPECT_LT(worst(5,
                    [](Samples& s) {
                        const clr_two x = draw_loose(s), a = draw_loose(s), b = draw_loose(s);
                        Drawn d = gathered(clr_two_gather_product(x, a, b), x, a, b);
                        if (takes_more_than_half(x, a, b)) d.bound += unit * size(of(x.hi));
                        return d;
                    }),
              1);
    const double times = worst(6, [](Samples& s) {
        const clr_two x = draw_loose(s), a = draw_loose(s), b = draw_tight(s);
        Drawn d = gathered(clr_two_gather_times(x, a, b), x, a, b);
        d.bound += size(of(a.lo) * of(b.lo));
        return d;
    });
    EXPECT_LT(times, 1);
}

TEST(TwoFloat, a_gathered_product_that_takes_more_than_half_loses_what_it_says) {
    EXPECT_GT(worst(7,
                    [](Samples& s) {
                        const clr_two x = draw_loose(s);
                        const clr_two a = {-x.hi * (0.5f + 2 * static_cast<float>(s.uniform())), 0};
                        const clr_two b = {1 + 0x1p-20f * static_cast<float>(s.uniform()), 0};
                        return gathered(clr_two_gather_product(x, a, b), x, a, b);
                    }),
              1000);
}

TEST(TwoFloat, a_gathered_product_that_forgets_a_part_is_noticed) {
    const auto forgetful = [](bool sum, bool square) {
        return worst(5, [=](Samples& s) {
            const clr_two x = draw_loose(s), a = draw_loose(s), b = draw_loose(s);
            clr_two bad = clr_two_gather_product(x, a, b);
            const clr_two p = clr_two_product(a.hi, b.hi);
            if (sum) bad.lo -= clr_two_sum(x.hi, p.hi).lo;
            if (square) bad.lo -= p.lo;
            return gathered(bad, x, a, b);
        });
    };
    EXPECT_GT(forgetful(true, false), 1000) << "what the sum loses";
    EXPECT_GT(forgetful(false, true), 1000) << "what the product loses";
}
