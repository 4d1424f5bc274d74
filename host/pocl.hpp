// Where PoCL keeps the kernels that it builds, without which it neither starts nor builds. Private to the library.
#pragma once

#include <string>

namespace clratio {

/// What is wrong with that folder, which it names, as the end of a sentence; empty where nothing is.
std::string trouble_with_pocl_cache();

}  // namespace clratio
