// SPDX-License-Identifier: Apache-2.0
// A gamepad for tests: its events go through a FIFO, for which the program that links this answers the kernel's
// questions about an input device. Sticks x, y and rx, each 0..255; one button, the left shoulder.
#pragma once

#include <cstdint>
#include <string>

#include "executive/contract/mono_time.hpp"

namespace takt::test {

class SimulatedPad {
 public:
  explicit SimulatedPad(const std::string& path);
  SimulatedPad(const SimulatedPad&) = delete;
  SimulatedPad& operator=(const SimulatedPad&) = delete;
  ~SimulatedPad() { unplug(); }
  // One event and its report, stamped now, or `ahead` of it.
  void send(std::uint16_t type, std::uint16_t code, std::int32_t value, Duration ahead = {}) const;
  void unplug();

 private:
  int fd_;
};

}  // namespace takt::test
