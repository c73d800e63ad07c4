// Goal: each error class and each errno has the one reaction that the header names.
// Expectations: bit values of linux/can/error.h, written out.
#include "drivers/error_frame.hpp"

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
  };
  const Row rows[] = {
      {"bus off", error(0x40), BusState::bus_off, false},
      {"restarted", error(0x100), BusState::up, false},
      {"receiver passive", error(0x4, 0x10), BusState::error_passive, false},
      {"transmitter passive", error(0x4, 0x20), BusState::error_passive, false},
      {"back to error-active", error(0x4, 0x40), BusState::up, false},
      {"warning only", error(0x4, 0x08), BusState::up, false},
      {"buffer overflow says nothing about the state", error(0x4, 0x01), std::nullopt, false},
      {"transmit time-out", error(0x1), std::nullopt, true},
      {"worst of several", error(0x40 | 0x4, 0x40), BusState::bus_off, false},
      {"arbitration lost says nothing", error(0x2), std::nullopt, false},
  };
  for (const Row& row : rows) {
    const BusEvent event = read_error_frame(row.frame);
    EXPECT_EQ(event.state, row.state) << row.when;
    EXPECT_EQ(event.frame_lost, row.lost) << row.when;
  }
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
