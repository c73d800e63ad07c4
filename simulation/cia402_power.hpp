// SPDX-License-Identifier: Apache-2.0
// The power state machine of CiA 402, in the drive: what a controlword does, what the statusword says.
//
// state                leaves with the controlword                                  or by itself
// switch on disabled   x110 shutdown: ready
// ready                0111 switch on: switched on; 1111 likewise; xx0x, x01x: switch on disabled
// switched on          1111: operation enabled; x110: ready; xx0x, x01x: switch on disabled
// operation enabled    0111: switched on; x110: ready; xx0x: switch on disabled; x01x: quick stop active
// quick stop active    xx0x: switch on disabled
// fault                bit 7 rising: switch on disabled
// any                                                                               trip(): fault reaction, then fault
// One transition per controlword. Pure.
#pragma once

#include <cstdint>

namespace takt::simulation {

class Cia402Power {
 public:
  enum class State : std::uint8_t {
    switch_on_disabled,
    ready,
    switched_on,
    operation_enabled,
    quick_stop,
    fault_reaction,
    fault
  };

  void obey(std::uint16_t controlword);
  void trip() { state_ = State::fault_reaction; }
  // The fault reaction is over.
  void settle();
  void reset() { *this = {}; }
  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] bool enabled() const { return state_ == State::operation_enabled; }
  [[nodiscard]] bool faulty() const { return state_ == State::fault_reaction || state_ == State::fault; }
  [[nodiscard]] std::uint16_t statusword() const;

 private:
  State state_ = State::switch_on_disabled;
  std::uint16_t before_ = 0;  // the controlword before this one
};

}  // namespace takt::simulation
