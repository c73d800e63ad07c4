// SPDX-License-Identifier: Apache-2.0
// The person who ends stops, in real time, by the rule of the simulated one (evidence/rollout/operator.hpp): `after` a
// stop or fault began, reset, reset in standby (joints stand where they read), and arm again once nothing blocks it.
// What another operator stopped is that operator's to arm. Knows what a person could see: the executive's status. Pure.
// Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <optional>

#include "executive/contract/mode.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::cli {

enum class OperatorStep : std::uint8_t {
  none,
  arm,
  reset,
  reset_if_only_the_stop_blocks,  // a robot that is reset before lets go of itself
};

class Rearming {
 public:
  // Empty: a stop is not ended.
  explicit Rearming(std::optional<Duration> after) : after_(after) {}

  // What the person does who sees `mode` at `now`. The first arming is another's. `stopped_by_another`: an operator
  // asked for a stop in the newest one or since, and it was not this one.
  OperatorStep next(Mode mode, bool stopped_by_another, Duration now);

 private:
  std::optional<Duration> after_;
  std::optional<Duration> stopped_at_;  // none: no stop since the robot was last armed
  bool looked_ = false;                 // in standby, since then
  bool is_anothers_ = false;            // until the robot is armed
};

}  // namespace takt::cli
