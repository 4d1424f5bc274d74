// What the subcommands share: how they join the command line, and how they end.
#pragma once

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <functional>
#include <stdexcept>
#include <string>

namespace CLI {
class App;
}

namespace tool {

enum Exit { ok = 0, failed = 1, usage = 2, flagged = 3, interrupted = 130 };

/// Arguments that parse, but do not fit together: exit code 2.
class UsageError : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// Stopped by a signal with everything saved that was done: exit code 130, the message says how to go on.
class Stopped : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/// What the chosen subcommand does once its options are read; returns the exit code.
using Run = std::function<int()>;

// Each adds its subcommand, which sets `run` when it is the one called.
void add_devices(CLI::App& app, Run& run);
void add_combine(CLI::App& app, Run& run);
void add_merge(CLI::App& app, Run& run);
void add_compare(CLI::App& app, Run& run);
void add_picture(CLI::App& app, Run& run);
void add_law(CLI::App& app, Run& run);
void add_errors(CLI::App& app, Run& run);
void add_figures(CLI::App& app, Run& run);
void add_estimators(CLI::App& app, Run& run);
void add_audit(CLI::App& app, Run& run);
void add_render(CLI::App& app, Run& run);
void add_study(CLI::App& app, Run& run);

/// Keys in the order they were set, as a reader would want them.
using Json = nlohmann::ordered_json;

/// Bytes of a file's name that are no UTF-8 become U+FFFD.
inline void print(const Json& object) { fmt::print("{}\n", object.dump(2, ' ', false, Json::error_handler_t::replace)); }

}  // namespace tool
