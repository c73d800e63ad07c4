// SPDX-License-Identifier: Apache-2.0
// What stands between policy and drives in a rollout, besides what the robot file says: methods that every panel knows
// by name (docs/panels.md), and protections that a study switches off one at a time. None of it is a key of a robot
// file, and no executive that moves a robot can be told any of it.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "executive/contract/mono_time.hpp"
#include "executive/pipeline/tick_config.hpp"

namespace takt::evidence {

enum class BuiltIn : std::uint8_t {
  takt,        // the robot file as it is
  plain,       // plain_loop.hpp
  timeout,     // max_age is a time-out: the robot's own degraded behaviour in that tick, back with the next command
  timeout_1s,  // the same with 1 s, over which the newest command holds
  hold_last,   // the newest command holds for ever, within the robot's limits
};
struct BuiltInMethod {
  BuiltIn which;
  std::string_view name, description;
};
std::span<const BuiltInMethod> built_in_methods();
// Null: none.
const BuiltInMethod* find_built_in(std::string_view name);

// What Takt changes or adds where a plain loop would not. Each can be switched off for a measurement.
enum class Protection : std::uint8_t {
  pursuit,        // the reference approaches its target smoothly, within acceleration and jerk
  jerk,           // the limit on jerk of that approach
  brake_reserve,  // bounds on the reference from the torque that is left to brake it
  barriers,       // torque bounds by measured position and speed
  envelope,       // a measured position or speed outside the hard limits stops the robot
  ramp,           // speed limits rise slowly when tracking begins
  hysteresis,     // the contract's window, recovery time and memory: without them `timeout`
  observer,       // the filter of the measured velocity
};
struct ProtectionName {
  Protection which;
  std::string_view name, meaning;  // meaning: what it does
};
std::span<const ProtectionName> protections();

struct Method {
  BuiltIn built_in = BuiltIn::takt;
  std::optional<Protection> without{};
};

// repeat_last.hpp stands between policy and executive.
bool repeats_last(const Method& method);
// As the method decides, from what the robot file says.
void apply(const Method& method, pipeline::TickConfig& config);
// Of a method that judges age by another limit than the robot file's.
std::optional<Duration> own_max_age(const Method& method);

}  // namespace takt::evidence
