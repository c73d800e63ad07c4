// SPDX-License-Identifier: Apache-2.0
// Goal: each error class and each errno has the one reaction that the header names.
// Expectations: bit values of linux/can/error.h, written out.
#include "drivers/bus/error_frame.hpp"

#include <gtest/gtest.h>

#include <cerrno>

namespace takt::drivers {
namespace {

CanFrame error(std::uint32_t classes, std::uint8_t controller_bits = 0) {
  CanFrame made;
  made.error = true;
  made.id = classes;
  made.length = 8;
  made.data[1] = controller_bits;
  return made;
}

TEST(ErrorFrame, SaysWhatBecameOfTheBus) {
  struct Row {
    const char* when;
    CanFrame frame;
    std::optional<BusState> state;
    bool lost;
    bool overflowed = false;
  };
  const Row rows[] = {
      {"bus off", error(0x40), BusState::bus_off, false},
      {"restarted", error(0x100), BusState::up, false},
      {"receiver passive", error(0x4, 0x10), BusState::error_passive, false},
      {"transmitter passive", error(0x4, 0x20), BusState::error_passive, false},
      {"back to error-active", error(0x4, 0x40), BusState::up, false},
      {"warning only", error(0x4, 0x08), BusState::up, false},
      {"receive buffer overflow", error(0x4, 0x01), std::nullopt, false, true},
      {"transmit buffer overflow", error(0x4, 0x02), std::nullopt, true},
      {"transmit time-out", error(0x1), std::nullopt, true},
      {"worst of several", error(0x40 | 0x4, 0x40), BusState::bus_off, false},
      {"arbitration lost says nothing", error(0x2), std::nullopt, false},
  };
  for (const Row& row : rows) {
    const BusEvent event = read_error_frame(row.frame);
    EXPECT_EQ(event.state, row.state) << row.when;
    EXPECT_EQ(event.frame_lost, row.lost) << row.when;
    EXPECT_EQ(event.overflowed, row.overflowed) << row.when;
  }
}

TEST(ErrorFrame, WhatIsMadeReadsTheSame) {
  for (const std::optional<BusState> state :
       {std::optional<BusState>{}, {BusState::up}, {BusState::error_passive}, {BusState::bus_off}})
    for (const bool lost : {false, true})
      for (const bool overflowed : {false, true}) {
        const BusEvent event{state, lost, overflowed};
        const CanFrame made = make_error_frame(event);
        EXPECT_TRUE(made.error);
        EXPECT_EQ(made.length, 8);
        EXPECT_EQ(read_error_frame(made), event);
      }
  EXPECT_EQ(read_error_frame(make_error_frame({.state = BusState::down})), BusEvent{}) << "no controller says that";
}

TEST(ErrorFrame, CountsIntoTheHealthAndStopsSendingWhileOff) {
  BusHealth health;
  note_error_frame(make_error_frame({.frame_lost = true}), health);
  note_error_frame(make_error_frame({.overflowed = true}), health);
  EXPECT_EQ(health.tx_dropped, 1U);
  EXPECT_EQ(health.rx_dropped, 1U);
  EXPECT_FALSE(drops_while_off(health));
  note_error_frame(make_error_frame({.state = BusState::bus_off}), health);
  EXPECT_TRUE(drops_while_off(health));
  EXPECT_EQ(health.tx_dropped, 2U);
}

TEST(ErrorFrame, AsksForTheClassesItReads) {
  EXPECT_EQ(error_classes(), 0x1U | 0x4U | 0x40U | 0x100U);
}

TEST(ErrorFrame, EveryErrnoOfAWriteHasItsReaction) {
  for (const int full : {ENOBUFS, EAGAIN}) {
    EXPECT_EQ(read_send_error(full).result, SendResult::queue_full);
    EXPECT_FALSE(read_send_error(full).state);
  }
  for (const int gone : {ENETDOWN, ENXIO, ENODEV, EPIPE}) {
    EXPECT_EQ(read_send_error(gone).result, SendResult::bus_down);
    EXPECT_EQ(read_send_error(gone).state, BusState::down);
  }
}

}  // namespace
}  // namespace takt::drivers
