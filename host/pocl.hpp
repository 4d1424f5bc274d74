// What is PoCL's alone. Private to the library.
#pragma once

#include <string>

#include "clratio/engine.hpp"

namespace clratio {

bool is_pocl(const DeviceInfo& device);

/// What is wrong with the folder of the kernels that it builds, without which it neither starts nor builds: names it, as the
/// end of a sentence; empty where nothing is.
std::string trouble_with_pocl_cache();

}  // namespace clratio
