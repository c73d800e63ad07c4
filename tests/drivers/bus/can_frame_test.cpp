// SPDX-License-Identifier: Apache-2.0
// Goal: every frame survives the way to the kernel's layout and into the run's record, and no other frame does.
#include "drivers/bus/can_frame.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace takt::drivers {
namespace {

CanFrame frame(std::uint32_t id, std::uint8_t length) {
  CanFrame made;
  made.id = id;
  made.length = length;
  for (std::uint8_t i = 0; i < length; ++i) made.data[i] = static_cast<std::uint8_t>(0xA0 + i);
  return made;
}

bool same(const CanFrame& a, const CanFrame& b) {
  return a.id == b.id && a.extended == b.extended && a.fd == b.fd && a.bit_rate_switch == b.bit_rate_switch &&
         a.remote == b.remote && a.error == b.error && a.length == b.length && std::ranges::equal(a.data, b.data);
}

std::vector<CanFrame> every_kind() {
  std::vector<CanFrame> frames{frame(0, 0),     frame(0x7FF, 8), frame(0x123, 4), frame(0x1FFFFFFF, 8),
                               frame(0x11, 64), frame(0x12, 12), frame(0x13, 0),  frame(0x44, 8)};
  frames[3].extended = true;
  frames[4].fd = frames[4].bit_rate_switch = true;
  frames[5].fd = true;
  frames[6].remote = true;
  frames[6].length = 5;
  frames[7].error = true;
  return frames;
}

TEST(CanFrame, SurvivesTheKernelsLayoutAndTheRecord) {
  for (const CanFrame& sent : every_kind()) {
    ASSERT_TRUE(is_legal(sent)) << sent.id;
    const auto read = from_kernel(to_kernel(sent));
    ASSERT_TRUE(read);
    EXPECT_TRUE(same(sent, *read)) << sent.id;
    const FrameRecord record = to_record(sent, MonoTime{5}, 7, 1, FrameDirection::sent);
    EXPECT_EQ(record.stamp.ns, 5);
    EXPECT_EQ(record.tick, 7U);
    EXPECT_EQ(record.bus, 1);
    EXPECT_EQ(record.direction, FrameDirection::sent);
    const auto recorded = from_record(record);
    ASSERT_TRUE(recorded);
    EXPECT_TRUE(same(sent, *recorded)) << sent.id;
  }
}

TEST(CanFrame, IdWordCarriesTheKernelsFlags) {
  CanFrame any = frame(0x12345, 1);
  any.extended = true;
  EXPECT_EQ(id_word(any), 0x12345U | 0x80000000U);
  any.remote = true;
  EXPECT_EQ(id_word(any), 0x12345U | 0xC0000000U);
}

TEST(CanFrame, RefusesWhatNoBusCarries) {
  canfd_frame raw = to_kernel(frame(0x10, 8));
  raw.len = 9;
  EXPECT_FALSE(from_kernel(raw)) << "classic frames hold 8 bytes";
  raw.flags = CANFD_FDF;
  EXPECT_FALSE(from_kernel(raw)) << "9 is no FD length";
  raw.len = 255;
  EXPECT_FALSE(from_kernel(raw)) << "longer than the buffer";
  raw.len = 12;
  EXPECT_TRUE(from_kernel(raw));
  raw.can_id |= CAN_RTR_FLAG;
  EXPECT_FALSE(from_kernel(raw)) << "FD has no remote frames";
  EXPECT_FALSE(is_legal(frame(0x800, 1))) << "12-bit id in a standard frame";
  FrameRecord record;
  record.length = 200;
  EXPECT_FALSE(from_record(record));
}

}  // namespace
}  // namespace takt::drivers
