// SPDX-License-Identifier: Apache-2.0
// Goal: kernel stamps land on CLOCK_MONOTONIC, and no stamp makes a frame younger than it is.
// Method: control messages are laid out by hand in the form recvmsg(2) describes.
#include "drivers/bus/receive_stamp.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <ctime>

namespace takt::drivers {
namespace {

constexpr ClockPair kClocks{MonoTime{5'000'000'000}, 1'700'000'000'000'000'000};

TEST(ReceiveStamp, MovesFromWallClockToMonotonic) {
  EXPECT_EQ(to_monotonic(kClocks.realtime_ns, kClocks), kClocks.monotonic);
  EXPECT_EQ(to_monotonic(kClocks.realtime_ns - 250'000, kClocks), kClocks.monotonic - microseconds(250));
}

TEST(ReceiveStamp, AFrameThatWaitedLongIsAsOldAsItIs) {
  for (const Duration waited : {seconds(1), seconds(1) + nanoseconds(1), milliseconds(4'999)})
    EXPECT_EQ(to_monotonic(kClocks.realtime_ns - waited.ns, kClocks), kClocks.monotonic - waited);
}

TEST(ReceiveStamp, AFrameWhoseAgeNobodyKnowsIsOlderThanAnything) {
  EXPECT_EQ(to_monotonic(kClocks.realtime_ns + 1, kClocks), kUndated) << "from the future";
  EXPECT_EQ(to_monotonic(0, kClocks), kUndated) << "from before the start";
  EXPECT_EQ(to_monotonic(std::nullopt, kClocks), kUndated) << "without a stamp";
  EXPECT_TRUE(kUndated.is_set());
}

TEST(ReceiveStamp, BothClocksAreSampled) {
  const ClockPair now = sample_clocks();
  EXPECT_GT(now.monotonic.ns, 0);
  EXPECT_GT(now.realtime_ns, now.monotonic.ns);
}

class ControlBuffer {
 public:
  template <class Value>
  void add(int level, int type, const Value& value, std::size_t bytes = sizeof(Value)) {
    cmsghdr header{};
    header.cmsg_level = level;
    header.cmsg_type = type;
    header.cmsg_len = CMSG_LEN(bytes);
    std::memcpy(bytes_.data() + used_, &header, sizeof header);
    std::memcpy(bytes_.data() + used_ + CMSG_LEN(0), &value, bytes);
    used_ += CMSG_SPACE(bytes);
  }
  msghdr message() {
    msghdr made{};
    made.msg_control = bytes_.data();
    made.msg_controllen = used_;
    return made;
  }

 private:
  alignas(cmsghdr) std::array<char, 256> bytes_{};
  std::size_t used_ = 0;
};

TEST(ReceiveStamp, ReadsStampAndDropCount) {
  ControlBuffer buffer;
  buffer.add(SOL_SOCKET, SO_RXQ_OVFL, std::uint32_t{17});
  buffer.add(SOL_SOCKET, SCM_TIMESTAMPNS, timespec{12, 34});
  const ControlMessages read = read_control_messages(buffer.message());
  EXPECT_EQ(read.kernel_dropped, 17U);
  EXPECT_EQ(read.realtime_ns, 12'000'000'034);
}

TEST(ReceiveStamp, IgnoresForeignAndShortControlMessages) {
  ControlBuffer buffer;
  buffer.add(SOL_SOCKET + 1, SCM_TIMESTAMPNS, timespec{1, 2});
  buffer.add(SOL_SOCKET, SCM_TIMESTAMPNS, timespec{3, 4}, 8);
  const ControlMessages read = read_control_messages(buffer.message());
  EXPECT_FALSE(read.realtime_ns);
  EXPECT_FALSE(read.kernel_dropped);
  EXPECT_FALSE(read_control_messages(msghdr{}).realtime_ns);
}

}  // namespace
}  // namespace takt::drivers
