#include <gtest/gtest.h>

#include "clratio/engine.hpp"

using namespace clratio;

TEST(Engine, self_test_passes_at_every_width) {
    for (const int width : {1, 2, 4, 8, 16})
        for (const auto path : {EngineOptions::Path::ranges, EngineOptions::Path::groups})
            EXPECT_TRUE(Engine({.width = width, .path = path}).self_test()) << "width " << width;
}
