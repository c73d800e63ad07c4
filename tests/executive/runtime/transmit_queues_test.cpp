// SPDX-License-Identifier: Apache-2.0
// Goal: the queue of a bus that stands still is emptied, and only that one's. Method: ticks whose second bus holds a
// setpoint for too long; interfaces that this machine lacks, so that a purge that was tried says so in the log.
#include "executive/runtime/transmit_queues.hpp"

#include <gtest/gtest.h>

#include <string>

namespace takt::runtime {
namespace {

// What the service logs from `from` to `to`, ticks of a bus that has stood still since the tenth.
std::string logged(TransmitQueues& queues, int from, int to) {
  constexpr MonoTime kStart{1'000'000'000};
  ::testing::internal::CaptureStdout();
  for (int tick = from; tick < to; ++tick) {
    TickRecordHeader header{};
    header.now = kStart + milliseconds(tick);
    header.player = Player::policy;
    header.bus_count = 2;
    header.age.hold = milliseconds(40);
    if (tick >= 10) header.buses[1].waiting_since = kStart + milliseconds(9);
    queues.watch().take(header);
    queues.serve(header.now);
  }
  return ::testing::internal::GetCapturedStdout();
}

TEST(TransmitQueues, ABusThatStandsStillIsEmptied) {
  TransmitQueues queues(milliseconds(150), {"takt-none0", "takt-none1"});
  EXPECT_EQ(logged(queues, 0, 30), "");
  const std::string log = logged(queues, 30, 300);
  EXPECT_NE(log.find("takt-none1"), std::string::npos) << log;
  EXPECT_EQ(log.find("takt-none0"), std::string::npos) << log;
}

}  // namespace
}  // namespace takt::runtime
