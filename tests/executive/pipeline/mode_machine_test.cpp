// SPDX-License-Identifier: Apache-2.0
// Goal: every mode x cause reacts as written down here a second time, the worst cause wins, and no set of causes breaks
// the latch. Method: full enumeration of single causes and pairs; random sets for the rest.
#include "executive/pipeline/mode_machine.hpp"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <map>
#include <string>

namespace takt::pipeline {
namespace {

// From standby, arming, tracking, degraded, damped_stop, fault_latched. '.': no reaction.
const std::map<Cause, std::string>& expected() {
  static const std::map<Cause, std::string> rows{{Cause::none, "......"},
                                                 {Cause::operator_arm, "a....."},
                                                 {Cause::operator_stop, ".ppp.."},
                                                 {Cause::operator_reset, "....ss"},
                                                 {Cause::shutdown, ".ppp.."},
                                                 {Cause::drives_enabled, ".t...."},
                                                 {Cause::enable_timeout, ".f...."},
                                                 {Cause::contract_violated, "..d..."},
                                                 {Cause::command_late, "..d..."},
                                                 {Cause::contract_restored, "...t.."},
                                                 {Cause::command_lost, ".ppp.."},
                                                 {Cause::bad_commands, ".ppp.."},
                                                 {Cause::recording_lost, ".ppp.."},
                                                 {Cause::feedback_lost, ".ffff."},
                                                 {Cause::drive_fault, ".ffff."},
                                                 {Cause::drive_disabled, "..fff."},
                                                 {Cause::bus_off, ".ffff."},
                                                 {Cause::bus_down, ".ffff."},
                                                 {Cause::bus_error_passive, ".ppp.."},
                                                 {Cause::transmit_queue_full, ".ppp.."},
                                                 {Cause::receive_overflow, ".ppp.."},
                                                 {Cause::replies_lost, ".ppp.."},
                                                 {Cause::replies_repeated, ".ppp.."},
                                                 {Cause::replies_delayed, ".ppp.."},
                                                 {Cause::foreign_node, ".ppp.."},
                                                 {Cause::bus_babble, ".ppp.."},
                                                 {Cause::envelope_exceeded, ".ppp.."},
                                                 {Cause::overrun, ".ppp.."},
                                                 {Cause::internal_error, ".ffff."},
                                                 {Cause::operator_deenergise, ".sssss"},
                                                 {Cause::torque_output_lost, ".ppp.."},
                                                 {Cause::tilt, ".ppp.."},
                                                 {Cause::imu_lost, ".ppp.."},
                                                 {Cause::fallback_spent, "...p.."},
                                                 {Cause::temperature_high, "..d..."},
                                                 {Cause::overtemperature, ".ppp.."},
                                                 {Cause::degraded_spent, "...p.."},
                                                 {Cause::feedback_implausible, ".ffff."},
                                                 {Cause::following_error, "..d..."},
                                                 {Cause::following_lost, "..pp.."}};
  return rows;
}

Mode mode_of(char letter, Mode present) {
  switch (letter) {
    case 's':
      return Mode::standby;
    case 'a':
      return Mode::arming;
    case 't':
      return Mode::tracking;
    case 'd':
      return Mode::degraded;
    case 'p':
      return Mode::damped_stop;
    case 'f':
      return Mode::fault_latched;
    default:
      return present;
  }
}

TEST(ModeMachine, EveryModeAndCauseReactsAsWritten) {
  ASSERT_EQ(expected().size(), kCauseCount);
  for (const auto& [cause, row] : expected()) {
    for (std::size_t m = 0; m < kModeCount; ++m) {
      const auto mode = static_cast<Mode>(m);
      const Transition transition = decide(mode, bit(cause));
      EXPECT_EQ(name(transition.to), name(mode_of(row[m], mode))) << name(cause) << " in " << name(mode);
      EXPECT_EQ(name(transition.cause), row[m] == '.' ? "none" : name(cause)) << name(cause) << " in " << name(mode);
    }
  }
}

// By hand, as the causes above: what is said may change, that it blocks may not.
TEST(ModeMachine, TheseCausesBlockArming) {
  constexpr CauseMask kBlocking =
      bit(Cause::bad_commands) | bit(Cause::bus_off) | bit(Cause::bus_down) | bit(Cause::bus_error_passive) |
      bit(Cause::transmit_queue_full) | bit(Cause::receive_overflow) | bit(Cause::foreign_node) |
      bit(Cause::bus_babble) | bit(Cause::overrun) | bit(Cause::recording_lost) | bit(Cause::internal_error) |
      bit(Cause::torque_output_lost) | bit(Cause::tilt) | bit(Cause::imu_lost) | bit(Cause::overtemperature);
  for (const Reaction& row : kReactions)
    EXPECT_EQ(!row.blocks_arming.empty(), (kBlocking & bit(row.cause)) != 0) << name(row.cause);
}

TEST(ModeMachine, TheMoreSevereOfTwoWins) {
  for (const Reaction& a : kReactions) {
    for (const Reaction& b : kReactions) {
      for (std::size_t m = 0; m < kModeCount; ++m) {
        const auto mode = static_cast<Mode>(m);
        const Transition transition = decide(mode, bit(a.cause) | bit(b.cause));
        const bool a_reacts = a.from(mode) != mode, b_reacts = b.from(mode) != mode;
        const Reaction& winner = !b_reacts || (a_reacts && a.severity > b.severity) ? a : b;
        EXPECT_EQ(name(transition.to), name(winner.from(mode)))
            << name(a.cause) << " and " << name(b.cause) << " in " << name(mode);
      }
    }
  }
}

RC_GTEST_PROP(ModeMachine, NoSetOfCausesBreaksALatch, (CauseMask causes)) {
  const CauseMask without_reset = causes & ~bit(Cause::operator_reset) & ~bit(Cause::operator_deenergise);
  RC_ASSERT(is_latched(decide(Mode::damped_stop, without_reset).to));
  RC_ASSERT(decide(Mode::fault_latched, without_reset).to == Mode::fault_latched);
  RC_ASSERT(decide(Mode::standby, causes & ~bit(Cause::operator_arm)).to == Mode::standby);
}

RC_GTEST_PROP(ModeMachine, DeenergisingWinsOverEverySetOfCauses, (CauseMask causes)) {
  for (std::size_t mode = 0; mode < kModeCount; ++mode)
    RC_ASSERT(decide(static_cast<Mode>(mode), causes | bit(Cause::operator_deenergise)).to == Mode::standby ||
              static_cast<Mode>(mode) == Mode::standby);
}

// Of bus faults at once the one nearest to the root names the transition: babble overflows queues, and that loses
// replies; a bus that is off or down outweighs them all.
TEST(ModeMachine, BusFaultsRankByTheirRoot) {
  const Cause from_leaf_to_root[] = {
      Cause::bus_error_passive,   Cause::replies_delayed,  Cause::replies_repeated, Cause::replies_lost,
      Cause::transmit_queue_full, Cause::receive_overflow, Cause::bus_babble,       Cause::foreign_node,
      Cause::feedback_lost,       Cause::bus_off,          Cause::bus_down};
  CauseMask together = 0;
  for (const Cause cause : from_leaf_to_root) {
    together |= bit(cause);
    EXPECT_EQ(name(decide(Mode::tracking, together).cause), name(cause));
  }
}

TEST(ModeMachine, AFaultWinsOverTheResetThatCameWithIt) {
  EXPECT_EQ(decide(Mode::damped_stop, bit(Cause::operator_reset) | bit(Cause::feedback_lost)).to, Mode::fault_latched);
  EXPECT_EQ(decide(Mode::arming, bit(Cause::drives_enabled) | bit(Cause::operator_stop)).to, Mode::damped_stop);
}

}  // namespace
}  // namespace takt::pipeline
