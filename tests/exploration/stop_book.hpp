// SPDX-License-Identifier: Apache-2.0
// How a damped stop may go on, by the robot file's `stops` and docs/design.md ("How a stop stops"): books of its own,
// kept from what each tick says of its causes. Which joints are stiff, and who moves them, is held against it
// (oracles.hpp).
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <utility>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::exploration {

class StopBook {
 public:
  explicit StopBook(const config::RobotConfig& robot) : robot_(robot) {}

  // Every tick, in order.
  void tick(const TickRecordHeader& header);
  // The first rule that the ticks broke: "stop_by_policy: ..."; empty: none.
  [[nodiscard]] const std::string& broken() const { return broken_; }

  // Of the newest tick. In a damped stop:
  [[nodiscard]] config::StopHow way() const { return way_; }  // of a manner whose time is over: rest
  // The way itself has stiffness, whether the robot rests or not.
  [[nodiscard]] bool may_be_stiff() const { return way_ == config::StopHow::hold || way_ == config::StopHow::policy; }
  // Rest that was before says nothing: the stop began, or the fallback policy let the robot go. Unset: no stop.
  [[nodiscard]] MonoTime rest_counts_from() const { return rest_counts_from_; }

  // Ways in which a stop went on, and whether the way's own time ended it.
  using Met = std::set<std::pair<config::StopHow, bool>>;
  [[nodiscard]] const Met& met() const { return met_; }

 private:
  void follow(const TickRecordHeader& header);
  void judge(const TickRecordHeader& header);
  [[nodiscard]] const config::StopConfig* rule_of(Cause cause) const;
  [[nodiscard]] config::StopHow how_of(Cause cause) const;
  void breaks(const std::string& how) {
    if (broken_.empty()) broken_ = how;
  }

  const config::RobotConfig& robot_;
  Mode mode_ = Mode::standby;
  Player player_ = Player::none;              // of the tick before
  MonoTime degraded_since_, fallback_since_;  // unset: it is not, it does not play
  Cause cause_ = Cause::none;                 // whose way
  MonoTime since_;
  bool moves_ = false;  // a policy moved the robot, or the fallback policy does: it may go on being moved
  config::StopHow way_ = config::StopHow::rest;
  MonoTime rest_counts_from_;
  std::string broken_;
  Met met_;
};

}  // namespace takt::exploration
