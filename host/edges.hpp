// Edges of bins of equal width. Private to the library and the command line.
#pragma once

#include <cstdint>
#include <vector>

namespace clratio {

/// lo and, for each of `count` bins, its upper edge; hi to the bit.
inline std::vector<double> equal_edges(double lo, double hi, std::uint32_t count) {
    std::vector<double> edges{lo};
    for (std::uint32_t i = 1; i < count; ++i) edges.push_back(lo + (hi - lo) * i / count);
    if (count > 0) edges.push_back(hi);
    return edges;
}

}  // namespace clratio
