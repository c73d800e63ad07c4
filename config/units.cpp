// SPDX-License-Identifier: Apache-2.0
#include "config/units.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>

namespace takt::config {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

constexpr std::array kUnits{
    Unit{"ns", Dimension::time, 1},
    Unit{"us", Dimension::time, 1e3},
    Unit{"ms", Dimension::time, 1e6},
    Unit{"s", Dimension::time, 1e9},
    Unit{"min", Dimension::time, 60e9},
    Unit{"h", Dimension::time, 3600e9},
    Unit{"rad", Dimension::angle, 1},
    Unit{"deg", Dimension::angle, kDegree},
    Unit{"rad/s", Dimension::angular_velocity, 1},
    Unit{"deg/s", Dimension::angular_velocity, kDegree},
    Unit{"rad/s2", Dimension::angular_acceleration, 1},
    Unit{"deg/s2", Dimension::angular_acceleration, kDegree},
    Unit{"Nm", Dimension::torque, 1},
    Unit{"Nm/s", Dimension::torque_rate, 1},
    Unit{"Nm/rad", Dimension::stiffness, 1},
    Unit{"Nms/rad", Dimension::damping, 1},
    Unit{"kgm2", Dimension::inertia, 1},
    Unit{"kg", Dimension::mass, 1},
    Unit{"m", Dimension::length, 1},
    Unit{"mm", Dimension::length, 1e-3},
    Unit{"m/s2", Dimension::acceleration, 1},
    Unit{"Hz", Dimension::frequency, 1},
    Unit{"bit/s", Dimension::bit_rate, 1},
    Unit{"kbit/s", Dimension::bit_rate, 1e3},
    Unit{"Mbit/s", Dimension::bit_rate, 1e6},
    Unit{"N", Dimension::force, 1},
    Unit{"degC", Dimension::temperature, 1},
    Unit{"m/s", Dimension::velocity, 1},
    Unit{"mm/s", Dimension::velocity, 1e-3},
    Unit{"N/s", Dimension::force_rate, 1},
    Unit{"N/m", Dimension::linear_stiffness, 1},
    Unit{"Ns/m", Dimension::linear_damping, 1},
    Unit{"rad/m", Dimension::angle_per_length, 1},
    Unit{"Nm/m", Dimension::torque_per_length, 1},
    Unit{"N/rad", Dimension::force_per_angle, 1},
    Unit{"Nms/m", Dimension::torque_per_velocity, 1},
    Unit{"Ns/rad", Dimension::force_per_angular_velocity, 1},
};

constexpr std::array<std::string_view, kDimensionCount> kNouns{"a plain number",
                                                               "a time",
                                                               "an angle",
                                                               "an angular velocity",
                                                               "an angular acceleration",
                                                               "a torque",
                                                               "a torque rate",
                                                               "a stiffness",
                                                               "a damping",
                                                               "an inertia",
                                                               "a mass",
                                                               "a length",
                                                               "an acceleration",
                                                               "a frequency",
                                                               "a bit rate",
                                                               "a force",
                                                               "a temperature",
                                                               "a velocity",
                                                               "a force rate",
                                                               "a linear stiffness",
                                                               "a linear damping",
                                                               "an angle per length",
                                                               "a torque per length",
                                                               "a force per angle",
                                                               "a torque per velocity",
                                                               "a force per angular velocity"};

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

// "010" or "-007": YAML 1.1 reads these as octal, people as decimal.
bool looks_octal(std::string_view text) {
  if (text.starts_with('-')) text.remove_prefix(1);
  return text.size() > 1 && text[0] == '0' && is_digit(text[1]);
}

std::string_view without_leading_zeros(std::string_view text) {
  while (text.size() > 1 && text[0] == '0' && is_digit(text[1])) text.remove_prefix(1);
  return text;
}

// Of the number that `text` begins with; 0: it begins with none.
std::size_t number_length(std::string_view text) {
  double ignored = 0;
  return static_cast<std::size_t>(std::from_chars(text.data(), text.data() + text.size(), ignored).ptr - text.data());
}

}  // namespace

std::span<const Unit> units() {
  return kUnits;
}

std::string_view noun(Dimension dimension) {
  return kNouns[static_cast<std::size_t>(dimension)];
}

std::string_view base_symbol(Dimension dimension) {
  const auto found = std::ranges::find(kUnits, dimension, &Unit::dimension);
  return found == kUnits.end() ? "" : found->symbol;
}

std::string_view usual_symbol(Dimension dimension) {
  return dimension == Dimension::time ? "ms" : base_symbol(dimension);
}

std::string symbols(Dimension dimension) {
  std::string all;
  for (const Unit& unit : kUnits) {
    if (unit.dimension != dimension) continue;
    if (!all.empty()) all += " or ";
    all += unit.symbol;
  }
  return all;
}

namespace {

// Of a number without a unit: every unit that a person may have meant, for one alone is copied unread.
std::string with_each_unit(std::string_view number, Dimension dimension) {
  std::string all;
  for (const Unit& unit : kUnits) {
    const bool is_usual = dimension != Dimension::time || unit.symbol == "ms" || unit.symbol == "s";
    if (unit.dimension == dimension && is_usual)
      all += fmt::format("{}`{} {}`", all.empty() ? "" : " or ", number, unit.symbol);
  }
  return all;
}

}  // namespace

constexpr std::string_view kWithoutComma = "a point before decimals, and nothing between thousands";

// "0,15 s"; "10,000 ms", which another reads as ten thousand.
bool has_comma_between_digits(std::string_view text) {
  const std::size_t comma = text.find(',');
  const auto is_digit = [&](std::size_t at) { return at < text.size() && text[at] >= '0' && text[at] <= '9'; };
  return comma != 0 && comma != std::string_view::npos && is_digit(comma - 1) && is_digit(comma + 1);
}

std::expected<double, std::string> parse_number(std::string_view text) {
  if (looks_octal(text)) {
    const bool negative = text.starts_with('-');
    return std::unexpected(fmt::format("{} reads as octal in YAML; write {}{}", text, negative ? "-" : "",
                                       without_leading_zeros(text.substr(negative ? 1 : 0))));
  }
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc::result_out_of_range)
    return std::unexpected(fmt::format("{} is too large or too small", text));
  if (error != std::errc{} || end != text.data() + text.size())
    return std::unexpected(fmt::format("`{}` is not a number; write {}", text,
                                       has_comma_between_digits(text) ? kWithoutComma : "digits such as 0.5 or 1e-3"));
  if (!std::isfinite(value)) return std::unexpected(fmt::format("{} is not finite; write a real number", text));
  return value;
}

std::expected<double, std::string> parse_quantity(std::string_view text, Dimension dimension) {
  if (dimension == Dimension::none) return parse_number(text);
  if (has_comma_between_digits(text))
    return std::unexpected(fmt::format("{} is not {}; write {}", text, noun(dimension), kWithoutComma));
  const std::string wanted = symbols(dimension);
  const std::size_t digits = number_length(text);
  if (digits == 0)
    return std::unexpected(fmt::format("`{}` is not {}; write a number and {}", text, noun(dimension), wanted));
  const auto number = parse_number(text.substr(0, digits));
  if (!number) return std::unexpected(number.error());
  std::string_view symbol = text.substr(digits);
  if (symbol.empty())
    return std::unexpected(fmt::format("{} has no unit; write {}", text, with_each_unit(text, dimension)));
  if (symbol.starts_with(' ')) symbol.remove_prefix(1);
  const auto unit = std::ranges::find(kUnits, symbol, &Unit::symbol);
  if (unit == kUnits.end())
    return std::unexpected(fmt::format("{} is not {}; write it in {}", text, noun(dimension), wanted));
  if (unit->dimension != dimension)
    return std::unexpected(
        fmt::format("{} is {}, not {}; write it in {}", text, noun(unit->dimension), noun(dimension), wanted));
  const double value = *number * unit->factor;
  if (!std::isfinite(value)) return std::unexpected(fmt::format("{} is too large", text));
  return value;
}

std::string format_quantity(double base_value, Dimension dimension) {
  if (dimension == Dimension::none) return fmt::format("{}", base_value);
  if (dimension == Dimension::time) return format_duration({std::llround(base_value)});
  return fmt::format("{} {}", base_value, base_symbol(dimension));
}

std::string format_duration(Duration duration) {
  if (duration.ns != 0 && duration.ns % 1'000'000'000 == 0) return fmt::format("{} s", duration.ns / 1'000'000'000);
  if (duration.ns % 1'000'000 == 0) return fmt::format("{} ms", duration.ns / 1'000'000);
  if (duration.ns % 1'000 == 0) return fmt::format("{} us", duration.ns / 1'000);
  return fmt::format("{} ns", duration.ns);
}

}  // namespace takt::config
