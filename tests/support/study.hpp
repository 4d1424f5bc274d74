// The study as a user runs it, and the numbers of its files.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "support/split.hpp"
#include "support/tool.hpp"

namespace clratio::test {

struct StudyFiles {
    std::string errors, densities, chords, averages;
    explicit StudyFiles(const std::string& folder)
        : errors(bytes_of(folder + "/errors.csv")), densities(bytes_of(folder + "/densities.csv")),
          chords(bytes_of(folder + "/short_chords.csv")), averages(bytes_of(folder + "/averages.csv")) {}
    bool operator==(const StudyFiles&) const = default;
};

/// Numbers of a CSV file by column name; rows by their first columns, with spaces between. errors.csv: "scene sampling
/// pattern t estimate n channel".
struct Errors {
    explicit Errors(const std::string& csv, std::size_t names_of_row = 7) {
        const auto lines = split(csv, '\n');
        const auto names = split(lines.at(0), ',');
        for (std::size_t i = 1; i < lines.size(); ++i) {
            const auto cells = split(lines[i], ',');
            std::string key = cells[0];
            for (std::size_t k = 1; k < names_of_row; ++k) key += " " + cells[k];
            for (std::size_t k = names_of_row; k < cells.size(); ++k)
                rows[key][names[k]] = cells[k].empty() ? NAN : std::stod(cells[k]);
        }
    }
    double at(const std::string& row, const std::string& column) const { return rows.at(row).at(column); }
    std::map<std::string, std::map<std::string, double>> rows;
};

inline std::string verdict(const json& claims, const std::string& id, const std::string& scene, const std::string& what) {
    for (const auto& claim : claims)
        if (claim["id"] == id)
            for (const auto& f : claim["findings"])
                if (f["scene"] == scene && f["what"].get<std::string>().rfind(what, 0) == 0) return f["verdict"];
    return "no such finding";
}

}  // namespace clratio::test
