#include "command.hpp"

#include <CLI/CLI.hpp>

#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <type_traits>

#include "tool.hpp"

namespace tool {
namespace {

/// Refuses a text that is no number in [least, most], NaN included. An empty answer of a CLI11 check is consent.
template <class T> auto number_between(T least, T most, const std::string& expected) {
    return [=](const std::string& text) {
        T value{};
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        const bool whole = error == std::errc() && end == text.data() + text.size();
        return whole && value >= least && value <= most ? std::string()
                                                        : fmt::format("expected {}, got '{}'", expected, text);
    };
}

/// CLI11 takes no text for 0, and -1 for the largest whole number.
template <class T> std::string refuse_misread(const std::string& text) {
    if (text.empty()) return "expected a number, got nothing";
    return std::is_unsigned_v<T> && text.front() == '-' ? "expected a whole number from 0 on, got " + text : "";
}

/// As CLI11 reads it.
std::string plain_whole(const std::string& text) {
    const auto whole = whole_of(text);
    return whole ? std::to_string(*whole) : text;
}

std::string refuse_empty(const std::string& text) { return text.empty() ? "expected a text, got nothing" : ""; }

template <class T> struct Number { using type = T; };
template <class T> struct Number<std::optional<T>> { using type = T; };
template <class T> struct Number<std::vector<T>> { using type = T; };

}  // namespace

std::optional<std::uint64_t> whole_of(const std::string& text) {
    const char *const begin = text.data(), *const end = begin + text.size();
    std::uint64_t whole = 0;
    if (const auto [at, error] = std::from_chars(begin, end, whole); error == std::errc() && at == end) return whole;
    double real = 0;
    const auto [at, error] = std::from_chars(begin, end, real);
    const bool is_whole = error == std::errc() && at == end && real >= 0 && real < 0x1p63 && real == std::floor(real);
    return is_whole ? std::optional(static_cast<std::uint64_t>(real)) : std::nullopt;
}

Option& Option::type(const std::string& name) { return option_->type_name(name), *this; }
Option& Option::shows_default() { return option_->capture_default_str(), *this; }
Option& Option::required() { return option_->required(), *this; }
Option& Option::takes(int values) { return option_->expected(values), *this; }
Option& Option::commas() { return option_->delimiter(','), *this; }
Option& Option::one_of(std::vector<std::string> words) { return option_->check(CLI::IsMember(std::move(words))), *this; }
Option& Option::within(std::uint64_t least, std::uint64_t most) {
    return option_->check(number_between(least, most, fmt::format("a whole number from {} to {}", least, most))), *this;
}
Option& Option::positive() {
    constexpr double least = std::numeric_limits<float>::denorm_min(), most = std::numeric_limits<float>::max();
    return option_->check(number_between(least, most, "a number above 0 that a float holds")), *this;
}
Option& Option::seconds() { return option_->check(number_between(0.0, 1e9, "seconds, from 0 on")), *this; }
Option& Option::between(double least, double most) {
    return option_->check(number_between(least, most, fmt::format("a number from {} to {}", least, most))), *this;
}
Option& Option::excludes(Option other) { return option_->excludes(other.option_), *this; }
Option& Option::needs(Option other) { return option_->needs(other.option_), *this; }
Option& Option::tells(bool& given) {
    option_->each([&given](const std::string&) { given = true; });
    return *this;
}

Command::Command(CLI::App& app, const std::string& name, const std::string& purpose)
    : app_(app.add_subcommand(name, purpose)) {}

template <class T> Option Command::option(const std::string& names, T& value, const std::string& help) {
    CLI::Option* option = app_->add_option(names, value, help);
    using Single = typename Number<T>::type;
    if constexpr (std::is_arithmetic_v<Single>)
        option->check(refuse_misread<Single>);
    else
        option->check(refuse_empty);
    if constexpr (std::is_unsigned_v<Single>) option->transform(plain_whole);
    return Option(option);
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
