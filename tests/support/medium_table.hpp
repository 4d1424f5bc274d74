// The published table of root mean squared errors: a prototype in NumPy, in double and with another hash, 16 seeds of 80 x
// 60 pixels.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <sstream>
#include <string>
#include <vector>

#include "clratio/medium.hpp"

namespace clratio::test {

/// RMSE x 1000 at N = 1, 2, .. 64, and half a unit of each number's last digit.
struct TableLine {
    std::size_t scene = 0;  ///< of scenes(): louvres, window, spheres, dense
    Sampler sampler;
    bool ratio = false;
    std::array<double, 7> rmse{}, half_digit{};

    /// As errors.csv begins its lines, with spaces: "louvres uni iid shared mean".
    std::string name() const {
        constexpr const char* names[] = {"louvres", "window", "spheres", "dense"};
        return std::string(names[scene]) + " " + std::string(name_of(sampler.sampling)) + " " +
               std::string(name_of(sampler.pattern)) + (sampler.independent ? " independent" : " shared") +
               (ratio ? " ratio" : " mean");
    }
};

inline std::vector<TableLine> medium_table() {
    constexpr const char* text = R"(
0 uni stratified shared mean 120.0 67.7 34.4 16.8 8.32 4.08 2.07
0 uni stratified shared ratio 94.0 61.4 32.9 16.4 8.22 4.06 2.06
0 uni iid shared mean 120.0 84.8 59.9 42.4 29.9 21.2 14.98
0 ds iid shared mean 96.9 67.9 48.0 33.9 24.1 17.2 12.2
0 ds iid shared ratio 92.1 64.9 45.9 32.5 23.1 16.5 11.7
0 dsa iid shared mean 227 160 114 80.8 56.5 40.0 28.3
0 dsa iid shared ratio 152 112 75.7 48.6 31.5 21.1 14.6
0 wvds-mis iid shared mean 94.4 66.8 47.5 33.5 23.4 16.7 11.8
0 wvds-mis iid shared ratio 92.4 65.5 46.5 32.8 23.0 16.3 11.6
1 uni stratified shared mean 325 193 123 72.8 39.1 19.5 9.86
1 uni stratified shared ratio 348 197 124 72.8 39.1 19.5 9.86
1 ds iid shared mean 392 274 195 139 98.6 69.3 49.0
1 ds iid shared ratio 321 242 178 129 91.6 64.6 45.8
1 dsa iid shared mean 541 376 266 187 132 94.2 65.7
1 dsa iid shared ratio 289 280 234 169 118 83.4 58.3
1 wvds-mis iid shared mean 339 240 171 121 84.5 59.9 42.8
1 wvds-mis iid shared ratio 339 239 171 121 84.5 59.9 42.7
2 uni stratified shared mean 168.3 74.0 28.8 11.2 4.52 1.90 .84
2 uni stratified shared ratio 30.9 19.7 10.6 5.69 2.92 1.46 .72
2 ds iid shared mean 66.5 47.0 33.6 23.7 16.8 11.8 8.42
2 ds iid shared ratio 29.2 19.6 13.5 9.16 6.50 4.52 3.19
2 dsa iid shared mean 207 147 103 73.2 51.8 36.7 25.9
2 dsa iid shared ratio 148 85.4 42.8 21.5 10.5 5.96 3.72
2 wvds-mis iid shared mean 39.5 27.9 19.8 14.0 9.91 7.06 5.00
2 wvds-mis iid shared ratio 26.6 19.0 13.6 9.56 6.79 4.85 3.44
2 uni iid independent ratio 383 238 147 92.7 61.9 42.2 29.4
2 wvds-mis iid independent ratio 51.0 35.4 24.9 17.5 12.3 8.73 6.15
3 uni stratified shared mean 425 269 157 80.6 33.2 13.6 5.66
3 uni stratified shared ratio 89.6 71.9 64.7 46.4 20.0 9.51 4.44
3 dsm iid shared mean 138 97.6 68.8 49.1 34.8 24.6 17.3
3 dsm iid shared ratio 75.4 54.5 37.1 25.8 18.3 13.0 9.15
3 wvds-mis iid shared mean 123 87.2 61.8 43.7 30.7 21.7 15.2
3 wvds-mis iid shared ratio 74.8 54.7 37.7 25.8 18.1 12.7 8.97)";
    std::vector<TableLine> table;
    std::istringstream in(text);
    TableLine line;
    for (std::string sampling, pattern, t, estimate; in >> line.scene >> sampling >> pattern >> t >> estimate;) {
        line.sampler = {sampling_of(sampling), pattern_of(pattern), t == "independent"};
        line.ratio = estimate == "ratio";
        for (std::size_t level = 0; level < line.rmse.size(); ++level) {
            std::string digits;
            in >> digits;
            const auto point = digits.find('.');
            const std::size_t decimals = point == std::string::npos ? 0 : digits.size() - point - 1;
            line.rmse[level] = std::stod(digits);
            line.half_digit[level] = 0.5 * std::pow(10.0, -static_cast<double>(decimals));
        }
        table.push_back(line);
    }
    return table;
}

}  // namespace clratio::test
