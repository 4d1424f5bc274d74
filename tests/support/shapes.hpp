// Every way a kernel can be cut: all widths, both paths (work-groups that share: three widths), several work sizes.
#pragma once

#include <string>
#include <vector>

#include "clratio/engine.hpp"

namespace clratio::test {

struct Shape {
    std::string name;
    EngineOptions options;
};

inline std::vector<Shape> all_shapes() {
    using Path = EngineOptions::Path;
    std::vector<Shape> shapes{{"automatic", {}}};
    for (const int width : {1, 2, 4, 8, 16}) {
        shapes.push_back({"ranges, width " + std::to_string(width), {.width = width, .path = Path::ranges}});
        if (width == 2 || width == 8) continue;
        shapes.push_back({"groups, width " + std::to_string(width), {.width = width, .path = Path::groups}});
    }
    shapes.push_back({"one work-item", {.path = Path::ranges, .work_items = 1}});
    shapes.push_back({"7 work-items", {.path = Path::ranges, .work_items = 7}});
    shapes.push_back({"groups of 3", {.path = Path::groups, .work_items = 3}});
    return shapes;
}

/// Both paths and four widths in six builds, for kernels that take seconds to build.
inline std::vector<Shape> some_shapes() {
    using Path = EngineOptions::Path;
    return {{"ranges, width 1", {.width = 1, .path = Path::ranges}},
            {"groups, width 4", {.width = 4, .path = Path::groups}},
            {"ranges, width 8", {.width = 8, .path = Path::ranges}},
            {"ranges, width 16", {.width = 16, .path = Path::ranges}},
            {"7 work-items", {.width = 16, .path = Path::ranges, .work_items = 7}},
            {"groups of 3", {.width = 1, .path = Path::groups, .work_items = 3}}};
}

/// Both paths and the ends of the widths, for kernels that take longer still.
inline std::vector<Shape> fewest_shapes() {
    using Path = EngineOptions::Path;
    return {{"ranges, width 1", {.width = 1, .path = Path::ranges}},
            {"groups, width 4", {.width = 4, .path = Path::groups}},
            {"ranges, width 16", {.width = 16, .path = Path::ranges}}};
}

/// Both paths, small enough for oclgrind's interpreter; kept programs would be another driver's.
inline std::vector<Shape> smallest_shapes() {
    using Path = EngineOptions::Path;
    return {{"ranges, width 4", {.width = 4, .path = Path::ranges, .work_items = 2, .disk_cache = false}},
            {"groups, width 1", {.width = 1, .path = Path::groups, .work_items = 4, .disk_cache = false}}};
}

}  // namespace clratio::test
