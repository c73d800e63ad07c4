// SPDX-License-Identifier: Apache-2.0
// What a person wants, out of a gamepad's events: sticks become the values of a `command` sensor while the dead-man
// button is held and the pad is heard.
//
// A stick's middle says the sensor's when_absent, its ends the sensor's limits, in straight lines; the inner 8 % of its
// way are the middle. Values never leave the limits. Before the first press, after a release, after events that were
// lost (SYN_DROPPED) and after a lie (a stick outside its own range) the button counts as released until it is pressed
// anew. A pad that said nothing for `still_for` while the button is held is not believed until it speaks again: the
// kernel tells changes only, and a pad that froze looks like a still hand.
// Pure: time is passed in; events carry CLOCK_MONOTONIC. An event from the future is a lie as well. Thread rule: one
// thread at a time.
#pragma once

#include <linux/input.h>

#include <cstdint>
#include <optional>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::sensors {

struct Stick {
  std::uint16_t code = 0;  // ABS_*
  bool reversed = false;   // towards its minimum is the value's maximum
  std::int32_t minimum = 0, maximum = 0;
};

struct GamepadMapping {
  std::uint16_t dead_man = 0;  // BTN_*
  std::vector<Stick> sticks;   // one per value
  config::CommandLimits limits;
  Duration still_for;
};

class Gamepad {
 public:
  explicit Gamepad(GamepadMapping mapping);

  void take(const input_event& event, MonoTime now);
  // The values, while they may be said.
  [[nodiscard]] std::optional<std::vector<float>> wish(MonoTime now) const;
  [[nodiscard]] bool is_held() const { return held_; }

 private:
  void move(std::uint16_t code, std::int32_t position);

  GamepadMapping mapping_;
  std::vector<double> deflections_;  // -1..1, one per value
  bool held_ = false, dropped_ = false;
  MonoTime heard_at_;
};

// The nearest float32 within [low, high].
float float_within(double value, double low, double high);

}  // namespace takt::sensors
