// SPDX-License-Identifier: Apache-2.0
// One look at a running robot, as plain values: what a screen or a script is told. Made by LiveView.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"
#include "monitor/judge/freshness_statistics.hpp"
#include "monitor/telemetry/live_metrics.hpp"

namespace takt::monitor::top {

// waiting: no executive; live: ticks come; silent: attached, but no tick came for a while.
enum class Link : std::uint8_t { waiting, live, silent };
constexpr std::string_view name(Link link) {
  constexpr std::array<std::string_view, 3> names{"waiting", "live", "silent"};
  const auto index = static_cast<std::size_t>(link);
  return index < names.size() ? names[index] : "invalid";
}

// A stretch of the recent past.
struct Slice {
  std::uint32_t ticks = 0;    // 0: nothing is known of it
  Mode mode = Mode::standby;  // the gravest
  Duration age{};             // of the command in use, the largest; zero: there was none
  bool missed = false;        // a tick that relied on the policy had no fresh command
  bool marked = false;        // the operator marked it
};

struct BusPicture {
  std::string name{};
  BusHealth health{};
  std::optional<Duration> tick_to_wire{};  // of the newest tick whose frames are known to have left
  double load = 0;                         // frames of the last second at worst stuffing, share of the bit rate
  std::optional<double> planned{};         // the same from the robot file
};

struct JointPicture {
  std::string name{};
  config::JointKind kind = config::JointKind::hinge;
  JointRecord newest{};
  std::string error{};                                    // in the drive's own words; empty: none
  InterventionMask recent = 0;                            // in the last second
  std::array<std::uint64_t, kInterventionCount> ticks{};  // with each, since attached
};

struct Picture {
  Link link = Link::waiting;
  std::string why{};      // waiting: one sentence
  Duration since_tick{};  // how long ago the newest tick was
  std::string robot{};
  TickRecordHeader tick{};  // newest; its number 0: none yet
  Duration in_mode{};       // since the mode was entered, or since attached
  Cause entered_by = Cause::none;
  std::string incident{};  // why the robot stands, in one sentence; empty: it does not

  Duration max_age{};
  double epsilon = 0, confidence = 0;
  std::vector<Slice> history{};                    // oldest first, kSlice each, up to now
  Quantiles age{};                                 // ns, each tick of the last kWindow that relied on the policy
  std::array<Quantiles, kAgeStageCount> stages{};  // ns, each command first used in the last kWindow
  MissRate misses{};                               // per tick since attached

  std::uint64_t ticks = 0;                                   // seen since attached
  std::array<std::uint64_t, kOverrunCauseCount> overruns{};  // since attached, as the rest of this block
  std::array<std::uint64_t, kArrivalCount> arrivals{};
  std::uint64_t skipped_periods = 0;
  std::uint64_t lost_ticks = 0;  // overwritten before they were read here

  double policy_rate = 0;                         // accepted commands per second
  double planned_rate = 0;                        // configured; 0: the robot has no policy
  std::uint64_t policy_pid = 0, monitor_pid = 0;  // 0: not attached
  std::optional<bool> realtime{};                 // as the executive says; unknown until it was asked

  std::vector<BusPicture> buses{};
  std::vector<JointPicture> joints{};
};

}  // namespace takt::monitor::top
