// SPDX-License-Identifier: Apache-2.0
#include "evidence/rollout/method.hpp"

#include <algorithm>
#include <array>
#include <limits>

namespace takt::evidence {
namespace {

constexpr std::array<BuiltInMethod, 5> kBuiltIns{{
    {BuiltIn::takt, "takt", "the robot file as it is"},
    {BuiltIn::plain, "plain", "the newest target goes straight to the drives' PD; it holds while no command comes"},
    {BuiltIn::timeout, "timeout", "in the tick after max_age the robot's own fallback; back with the next command"},
    {BuiltIn::timeout_1s, "timeout_1s", "the newest command holds for 1 s, then the robot's own fallback"},
    {BuiltIn::hold_last, "hold_last", "the newest command holds for ever, within the robot's limits"},
}};

constexpr std::array<ProtectionName, 8> kProtections{{
    {Protection::pursuit, "pursuit", "approaches a target smoothly"},
    {Protection::jerk, "jerk", "limits the jerk of that approach"},
    {Protection::brake_reserve, "brake_reserve", "bounds references by the torque left to brake"},
    {Protection::barriers, "barriers", "bounds torque by measured position and speed"},
    {Protection::envelope, "envelope", "stops outside the hard limits"},
    {Protection::ramp, "ramp", "raises speed limits slowly when tracking begins"},
    {Protection::hysteresis, "hysteresis", "counts misses, and waits before it tracks again"},
    {Protection::observer, "observer", "filters the measured velocity"},
}};

constexpr Duration kLongTimeout = seconds(1);
constexpr Duration kForEver = seconds(1'000'000);

// One tick without a usable command violates the contract, one with it restores it.
void forget_hysteresis(pipeline::FreshnessContract& contract) {
  contract.epsilon = 1;
  contract.degrade_after = Duration{1};
  contract.recover_after = contract.flap_memory = Duration{};
}

void hold_for_ever(pipeline::TickConfig& config) {
  config.freshness.max_age = config.freshness.stop_after = kForEver;
  config.freshness.epsilon = 1;
  config.freshness.degrade_after = {};
  config.freshness.bad_command_limit = std::numeric_limits<std::uint32_t>::max();
  config.clamped_share = 1;
}

void switch_off(Protection protection, pipeline::TickConfig& config) {
  switch (protection) {
    case Protection::pursuit:
      config.without.pursuit = true;
      break;
    case Protection::jerk:
      config.without.jerk = true;
      break;
    case Protection::brake_reserve:
      config.without.brake_reserve = true;
      break;
    case Protection::barriers:
      config.without.barriers = true;
      break;
    case Protection::envelope:
      config.without.envelope = true;
      break;
    case Protection::ramp:
      config.resume_over = {};
      break;
    case Protection::hysteresis:
      forget_hysteresis(config.freshness);
      break;
    case Protection::observer:
      config.without.observer = true;
      break;
  }
}

}  // namespace

std::span<const BuiltInMethod> built_in_methods() {
  return kBuiltIns;
}

const BuiltInMethod* find_built_in(std::string_view name) {
  const auto* const found = std::ranges::find(kBuiltIns, name, &BuiltInMethod::name);
  return found == kBuiltIns.end() ? nullptr : found;
}

std::span<const ProtectionName> protections() {
  return kProtections;
}

bool repeats_last(const Method& method) {
  return method.built_in == BuiltIn::timeout_1s || method.built_in == BuiltIn::hold_last;
}

void apply(const Method& method, pipeline::TickConfig& config) {
  switch (method.built_in) {
    case BuiltIn::takt:
      break;
    case BuiltIn::plain:  // waits for no fallback policy when it is armed
      config.degraded = pipeline::DegradedBehaviour::hold;
      break;
    case BuiltIn::timeout_1s:
      config.freshness.stop_after = config.freshness.stop_after - config.freshness.max_age + kLongTimeout;
      config.freshness.max_age = kLongTimeout;
      forget_hysteresis(config.freshness);
      break;
    case BuiltIn::timeout:
      forget_hysteresis(config.freshness);
      break;
    case BuiltIn::hold_last:
      hold_for_ever(config);
      break;
  }
  if (method.without) switch_off(*method.without, config);
}

std::optional<Duration> own_max_age(const Method& method) {
  switch (method.built_in) {
    case BuiltIn::takt:
    case BuiltIn::plain:
    case BuiltIn::timeout:
      return std::nullopt;
    case BuiltIn::timeout_1s:
      return kLongTimeout;
    case BuiltIn::hold_last:
      return kForEver;
  }
  return std::nullopt;
}

}  // namespace takt::evidence
