// Normal numbers from Boost.Compute on the library's own device and queue.
#pragma once

#include <cstdint>
#include <functional>

#include "clratio/engine.hpp"

namespace peers {

/// A function that fills `count` floats on the device with standard normals (mt19937 and Box-Muller) and waits.
std::function<void()> boost_normals(const clratio::Engine& engine, std::uint64_t count);

}  // namespace peers
