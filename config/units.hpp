// SPDX-License-Identifier: Apache-2.0
// The units a robot file may use, and the quantities written in them ("120 ms", "1.57 rad", "18 Nm").
//
// Each dimension has one base unit (the first of its list) in which Takt computes; the others are converted when read.
// Errors: half a sentence that says what is wrong and how to write it. Source of the list: docs/configuration.md.
#pragma once

#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <string_view>

#include "executive/contract/mono_time.hpp"

namespace takt::config {

enum class Dimension : std::uint8_t {
  none,  // a plain number
  time,
  angle,
  angular_velocity,
  angular_acceleration,
  torque,
  torque_rate,
  stiffness,
  damping,
  inertia,
  mass,
  length,
  acceleration,
  frequency,
  bit_rate,
  force,
  temperature,
  velocity,
  force_rate,
  linear_stiffness,
  linear_damping,
  angle_per_length,
  torque_per_length,
  force_per_angle,
  torque_per_velocity,
  force_per_angular_velocity
};
inline constexpr std::size_t kDimensionCount = 26;

struct Unit {
  std::string_view symbol;
  Dimension dimension;
  double factor;  // base units in one of it
};
std::span<const Unit> units();
std::string_view noun(Dimension dimension);          // "a torque"
std::string_view base_symbol(Dimension dimension);   // "Nm"; time is held in nanoseconds
std::string_view usual_symbol(Dimension dimension);  // for examples in messages
std::string symbols(Dimension dimension);            // "rad or deg"

// Decimal number: optional sign, digits, fraction, exponent. Refuses octal-looking 010, nan, inf, 1_000 and +1.
std::expected<double, std::string> parse_number(std::string_view text);
// Number and unit, with or without one space between them; the result is in the base unit.
std::expected<double, std::string> parse_quantity(std::string_view text, Dimension dimension);

// Shortest text that parse_quantity reads back to the same value.
std::string format_quantity(double base_value, Dimension dimension);
std::string format_duration(Duration duration);

}  // namespace takt::config
