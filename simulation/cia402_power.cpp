// SPDX-License-Identifier: Apache-2.0
#include "simulation/cia402_power.hpp"

namespace takt::simulation {
namespace {

using State = Cia402Power::State;

State after(State state, std::uint16_t controlword) {
  const bool switch_on = (controlword & 1U) != 0, voltage = (controlword & 2U) != 0,
             no_quick_stop = (controlword & 4U) != 0, operate = (controlword & 8U) != 0;
  const bool powered = state == State::operation_enabled || state == State::quick_stop;
  if (!voltage) return State::switch_on_disabled;
  if (!no_quick_stop) return powered ? State::quick_stop : State::switch_on_disabled;
  if (state == State::quick_stop) return state;
  if (!switch_on) return State::ready;
  switch (state) {
    case State::switch_on_disabled:
      return state;
    case State::ready:
      return State::switched_on;
    case State::switched_on:
    case State::operation_enabled:
      return operate ? State::operation_enabled : State::switched_on;
    case State::quick_stop:
    case State::fault_reaction:
    case State::fault:
      return state;
  }
  return state;
}

}  // namespace

void Cia402Power::obey(std::uint16_t controlword) {
  const bool reset_edge = (controlword & 0x80U) != 0 && (before_ & 0x80U) == 0;
  before_ = controlword;
  if (state_ == State::fault && reset_edge) {
    state_ = State::switch_on_disabled;
    return;
  }
  if (!faulty()) state_ = after(state_, controlword);
}

void Cia402Power::settle() {
  if (state_ == State::fault_reaction) state_ = State::fault;
}

std::uint16_t Cia402Power::statusword() const {
  // Bit 9: the bus commands. Bit 4: the supply is there. Bit 12: the target is followed.
  constexpr std::uint16_t kRemote = 0x200, kVoltage = 0x10, kFollows = 0x1000;
  switch (state_) {
    case State::switch_on_disabled:
      return kRemote | kVoltage | 0x40;
    case State::ready:
      return kRemote | kVoltage | 0x21;
    case State::switched_on:
      return kRemote | kVoltage | 0x23;
    case State::operation_enabled:
      return kRemote | kVoltage | kFollows | 0x27;
    case State::quick_stop:
      return kRemote | kVoltage | 0x07;
    case State::fault_reaction:
      return kRemote | kVoltage | 0x0F;
    case State::fault:
      return kRemote | kVoltage | 0x08;
  }
  return 0;
}

}  // namespace takt::simulation
