// SPDX-License-Identifier: Apache-2.0
// A gamepad as the kernel shows it: /dev/input/event*, by linux/input.h alone.
//
// Events are stamped by the kernel with CLOCK_MONOTONIC. Errors: one sentence. Thread rule: one thread.
#pragma once

#include <linux/input.h>

#include <chrono>
#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "sensors/gamepad/gamepad.hpp"

namespace takt::sensors {

// "y" or "-y": an absolute axis, with a minus sign reversed; "tl": a button. Nothing: there is no such name.
std::optional<Stick> stick_named(std::string_view name);
std::optional<std::uint16_t> button_named(std::string_view name);
std::string known_sticks();
std::string known_buttons();

class Evdev {
 public:
  // Also asks for the ranges of `sticks`. Refused: no input device, or one that lacks a stick or the button.
  static std::expected<Evdev, std::string> open(const std::string& path, std::vector<Stick>& sticks,
                                                std::uint16_t button);
  Evdev(Evdev&& other) noexcept;
  Evdev& operator=(Evdev&& other) = delete;
  ~Evdev();

  // Waits for events until `limit` passed; at most one page of them. An error: the device is gone.
  std::expected<std::vector<input_event>, std::string> read(std::chrono::milliseconds limit);

 private:
  Evdev(int fd, std::string path) : fd_(fd), path_(std::move(path)) {}
  int fd_;
  std::string path_;
};

}  // namespace takt::sensors
