// SPDX-License-Identifier: Apache-2.0
// Goal: the SocketCAN bus reads and writes frames, keeps health, and refuses to open what is not there.
// Method: a socket pair stands in for the raw socket (one message is one frame there too); what only a kernel with
// CAN could show, the options and filters, is not tested here.
#include "drivers/bus/socketcan_bus.hpp"

#include <gtest/gtest.h>
#include <linux/can.h>
#include <sys/socket.h>

#include <array>
#include <cstring>

namespace takt::drivers {
namespace {

class Pair {
 public:
  Pair() {
    int ends[2];
    EXPECT_EQ(::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends), 0);
    wire = FileHandle(ends[0]);
    const int on = 1;
    ::setsockopt(ends[1], SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
    bus = std::make_unique<SocketCanBus>(FileHandle(ends[1]));
  }
  void arrive(const canfd_frame& raw, std::size_t bytes) {
    ASSERT_EQ(::send(wire.get(), &raw, bytes, 0), static_cast<ssize_t>(bytes));
  }
  std::size_t receive() { return bus->receive(got); }

  FileHandle wire;
  std::unique_ptr<SocketCanBus> bus;
  std::array<ReceivedFrame, 8> got;
};

canfd_frame raw_frame(std::uint32_t id, std::uint8_t length) {
  canfd_frame raw{};
  raw.can_id = id;
  raw.len = length;
  std::memset(raw.data, 0x5A, length);
  return raw;
}

TEST(SocketCanBus, WritesClassicAndFdFramesInTheirSizes) {
  Pair pair;
  CanFrame frame;
  frame.id = 0x123;
  frame.length = 8;
  EXPECT_EQ(pair.bus->send(frame), SendResult::sent);
  frame.fd = true;
  frame.length = 12;
  EXPECT_EQ(pair.bus->send(frame), SendResult::sent);
  canfd_frame raw{};
  EXPECT_EQ(::recv(pair.wire.get(), &raw, sizeof raw, 0), 16);
  EXPECT_EQ(raw.can_id, 0x123U);
  EXPECT_EQ(::recv(pair.wire.get(), &raw, sizeof raw, 0), 72);
  EXPECT_EQ(raw.len, 12);
}

TEST(SocketCanBus, ReadsFramesWithTheirKernelStamp) {
  Pair pair;
  const MonoTime before = sample_clocks().monotonic;
  canfd_frame classic = raw_frame(0x11, 8);
  classic.flags = 0xFF;  // a classic frame's byte 5 is padding: it must not be read as FD flags
  pair.arrive(classic, CAN_MTU);
  pair.arrive(raw_frame(0x12, 16), CANFD_MTU);
  const MonoTime arrived = sample_clocks().monotonic;
  while (sample_clocks().monotonic < arrived + milliseconds(20)) {  // read late, so that the time of reading is another
  }
  ASSERT_EQ(pair.receive(), 2U);
  EXPECT_EQ(pair.got[0].frame.id, 0x11U);
  EXPECT_FALSE(pair.got[0].frame.fd);
  EXPECT_EQ(pair.got[0].frame.data[7], 0x5A);
  EXPECT_TRUE(pair.got[1].frame.fd) << "by its size, whatever its flags";
  EXPECT_EQ(pair.got[1].frame.length, 16);
  for (int i = 0; i < 2; ++i) {
    EXPECT_LE(pair.got[static_cast<std::size_t>(i)].received_at, arrived + milliseconds(1));
    EXPECT_GT(pair.got[static_cast<std::size_t>(i)].received_at, before - milliseconds(1));
  }
  EXPECT_EQ(pair.receive(), 0U) << "nothing waits";
  EXPECT_EQ(pair.bus->health().state, BusState::up);
}

TEST(SocketCanBus, SkipsWhatIsNoFrame) {
  Pair pair;
  pair.arrive(raw_frame(0x11, 9), CAN_MTU);
  pair.arrive(raw_frame(0x11, 8), 20);
  pair.arrive(raw_frame(0x11, 8), CAN_MTU);
  EXPECT_EQ(pair.receive(), 1U);
}

TEST(SocketCanBus, BusOffStopsSendingUntilTheControllerRestarts) {
  Pair pair;
  pair.arrive(raw_frame(CAN_ERR_FLAG | 0x40, 8), CAN_MTU);
  EXPECT_EQ(pair.receive(), 0U) << "error frames do not come out";
  EXPECT_EQ(pair.bus->health().state, BusState::bus_off);
  EXPECT_EQ(pair.bus->send({}), SendResult::bus_down);
  EXPECT_EQ(pair.bus->health().tx_dropped, 1U);
  char nothing[80];
  EXPECT_EQ(::recv(pair.wire.get(), nothing, sizeof nothing, 0), -1) << "a stale setpoint was queued";
  pair.arrive(raw_frame(CAN_ERR_FLAG | 0x100, 8), CAN_MTU);
  pair.receive();
  EXPECT_EQ(pair.bus->health().state, BusState::up);
  EXPECT_EQ(pair.bus->send({}), SendResult::sent);
}

TEST(SocketCanBus, AnOverrunControllerCountsAsReceiveLoss) {
  Pair pair;
  canfd_frame overflow = raw_frame(CAN_ERR_FLAG | 0x4, 8);
  overflow.data[1] = 0x01;
  pair.arrive(overflow, CAN_MTU);
  pair.arrive(overflow, CAN_MTU);
  EXPECT_EQ(pair.receive(), 0U);
  EXPECT_EQ(pair.bus->health().rx_dropped, 2U);
  EXPECT_EQ(pair.bus->health().state, BusState::up);
}

TEST(SocketCanBus, AFullQueueDropsAndCounts) {
  Pair pair;
  SendResult result = SendResult::sent;
  for (int i = 0; i < 100'000 && result == SendResult::sent; ++i) result = pair.bus->send({});
  EXPECT_EQ(result, SendResult::queue_full);
  EXPECT_EQ(pair.bus->health().tx_dropped, 1U);
  EXPECT_EQ(pair.bus->health().state, BusState::up);
}

TEST(SocketCanBus, OpeningWhatIsNotThereIsOneClearSentence) {
  const auto opened = SocketCanBus::open({.interface = "takt-none0", .fd = false, .receive = {}}, 1'000'000);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().find("takt-none0: "), 0U) << opened.error();
  EXPECT_EQ(opened.error().find('\n'), std::string::npos);
}

}  // namespace
}  // namespace takt::drivers
