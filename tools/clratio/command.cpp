#include "command.hpp"

#include <CLI/CLI.hpp>

#include <optional>

namespace tool {

Option& Option::type(const std::string& name) { return option_->type_name(name), *this; }
Option& Option::shows_default() { return option_->capture_default_str(), *this; }
Option& Option::required() { return option_->required(), *this; }
Option& Option::takes(int values) { return option_->expected(values), *this; }
Option& Option::commas() { return option_->delimiter(','), *this; }
Option& Option::one_of(std::vector<std::string> words) { return option_->check(CLI::IsMember(std::move(words))), *this; }
Option& Option::within(std::uint64_t least, std::uint64_t most) { return option_->check(CLI::Range(least, most)), *this; }
Option& Option::positive() { return option_->check(CLI::PositiveNumber), *this; }
Option& Option::not_negative() { return option_->check(CLI::NonNegativeNumber), *this; }
Option& Option::excludes(Option other) { return option_->excludes(other.option_), *this; }
Option& Option::needs(Option other) { return option_->needs(other.option_), *this; }
Option& Option::tells(bool& given) {
    option_->each([&given](const std::string&) { given = true; });
    return *this;
}

Command::Command(CLI::App& app, const std::string& name, const std::string& purpose)
    : app_(app.add_subcommand(name, purpose)) {}

template <class T> Option Command::option(const std::string& names, T& value, const std::string& help) {
    return Option(app_->add_option(names, value, help));
}

template Option Command::option(const std::string&, std::string&, const std::string&);
template Option Command::option(const std::string&, std::vector<std::string>&, const std::string&);
template Option Command::option(const std::string&, float&, const std::string&);
template Option Command::option(const std::string&, double&, const std::string&);
template Option Command::option(const std::string&, std::vector<double>&, const std::string&);
template Option Command::option(const std::string&, std::optional<double>&, const std::string&);
template Option Command::option(const std::string&, int&, const std::string&);
template Option Command::option(const std::string&, std::uint32_t&, const std::string&);
template Option Command::option(const std::string&, std::optional<std::uint32_t>&, const std::string&);
template Option Command::option(const std::string&, std::uint64_t&, const std::string&);
template Option Command::option(const std::string&, std::optional<std::uint64_t>&, const std::string&);

Option Command::flag(const std::string& names, bool& value, const std::string& help) {
    return Option(app_->add_flag(names, value, help));
}

void Command::footer(const std::string& text) { app_->footer(text); }

void Command::on_call(Run& run, Run work) {
    app_->callback([&run, work = std::move(work)] { run = work; });
}

}  // namespace tool
