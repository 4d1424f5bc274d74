// A subcommand and its options. Only command.cpp and main.cpp know CLI11, whose headers take long to compile.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tool.hpp"

namespace CLI {
class Option;
}

namespace tool {

/// A whole number, written as 1000000 or 1e6; nothing where it is none. Options of whole numbers take both.
std::optional<std::uint64_t> whole_of(const std::string& text);

/// One option; each call says more of it.
class Option {
public:
    explicit Option(CLI::Option* option) : option_(option) {}

    Option& type(const std::string& name);  ///< what --help calls its values
    Option& shows_default();
    Option& required();
    Option& takes(int values);
    Option& commas();  ///< its values may have commas between them
    Option& one_of(std::vector<std::string> words);
    Option& within(std::uint64_t least, std::uint64_t most);
    Option& positive();
    Option& seconds();  ///< not negative
    Option& between(double least, double most);
    Option& excludes(Option other);
    Option& needs(Option other);
    Option& tells(bool& given);  ///< sets it where the option is there

private:
    CLI::Option* option_;
};

class Command {
public:
    Command(CLI::App& app, const std::string& name, const std::string& purpose);

    /// `names`: "-o,--output", or without dashes for what stands alone. command.cpp lists the types that T can be.
    template <class T> Option option(const std::string& names, T& value, const std::string& help);
    Option flag(const std::string& names, bool& value, const std::string& help);
    void footer(const std::string& text);
    void on_call(Run& run, Run work);  ///< `run` is to be `work` where this is the subcommand called

private:
    CLI::App* app_;
};

}  // namespace tool
