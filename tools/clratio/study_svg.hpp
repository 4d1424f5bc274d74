// The report's pictures, as SVG to stand in a page that gives the classes their colours.
#pragma once

#include "plot.hpp"
#include "study.hpp"

namespace tool::study {

/// Text as it may stand in HTML.
std::string escaped(const std::string& text);

/// Densities of the three channels' errors: density to the right, error upwards over the scene's range, each cell to its own
/// peak.
std::string density_cell(const SceneResult& scene, const Estimator& estimator, std::uint32_t level);

/// One line of a plot of RMSE against N.
struct Line {
    Estimator estimator;
    std::string colour_class;
};
/// Both axes logarithmic; marks are measured, lines the prediction where there is one.
std::string convergence_plot(const SceneResult& scene, const std::vector<Line>& lines);

/// Bias x 1000 against N of the mean of ratios (filled) and of the ratio of means (dashed), each sampling in its class.
std::string bias_plot(const SceneResult& scene, const std::vector<std::string>& colour_classes);

/// Panels side by side, as plot.hpp has them.
std::string panels(const std::vector<Panel>& all);

}  // namespace tool::study
