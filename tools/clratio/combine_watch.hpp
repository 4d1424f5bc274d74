// clratio combine --watch: adds batches as a renderer writes them.
#pragma once

#include "combine_options.hpp"

namespace tool::combining {

/// Until a target of the options is met; Stopped on Ctrl-C, with the state saved and the output as of the last batch.
int combine_watch(const Options& options);

}  // namespace tool::combining
