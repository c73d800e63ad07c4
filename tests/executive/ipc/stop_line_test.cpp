// SPDX-License-Identifier: Apache-2.0
// Goal: a stop crosses on its own way, and nothing that is no stop does. Method: a line in a temporary directory, real
// and rude senders.
#include "executive/ipc/stop_line.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <filesystem>
#include <thread>

#include "tests/support/temporary_directory.hpp"

namespace takt::ipc {
namespace {

class StopLineTest : public testing::Test {
 protected:
  [[nodiscard]] std::string path() const { return stop_socket_beside(directory_.path("executive.sock")); }
  void send_raw(const void* what, std::size_t size) const {
    const Descriptor socket(::socket(AF_UNIX, SOCK_DGRAM, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path().copy(address.sun_path, sizeof address.sun_path - 1);
    EXPECT_EQ(sendto(socket.get(), what, size, 0, reinterpret_cast<sockaddr*>(&address), sizeof address),
              static_cast<ssize_t>(size));
  }

  const test::TemporaryDirectory directory_;
};

TEST_F(StopLineTest, EachStopCrosses) {
  StopLine line = StopLine::listen(path()).value();
  for (const OperatorVerb verb : {OperatorVerb::stop, OperatorVerb::press_stop, OperatorVerb::deenergise}) {
    EXPECT_TRUE(hand_over_stop(path(), verb));
    EXPECT_EQ(line.wait(), verb);
  }
}

// Threat: user-stop-line
TEST_F(StopLineTest, WhatIsNoStopIsPassedOver) {
  StopLine line = StopLine::listen(path()).value();
  OperatorMessage arm;
  arm.verb = OperatorVerb::arm;
  OperatorMessage unknown;
  unknown.verb = static_cast<OperatorVerb>(200);
  OperatorMessage foreign;
  foreign.verb = OperatorVerb::deenergise;
  foreign.magic = 7;
  send_raw("", 0);
  send_raw(&arm, sizeof arm);
  send_raw(&unknown, sizeof unknown);
  send_raw(&foreign, sizeof foreign);
  send_raw(&arm, sizeof arm - 1);
  EXPECT_TRUE(hand_over_stop(path(), OperatorVerb::stop));
  EXPECT_EQ(line.wait(), OperatorVerb::stop);
}

// A flooder of the line has asked for a stop already: a sender finds it full, not broken, and is not held up for
// long.
TEST_F(StopLineTest, AFullLineHoldsNobodyUp) {
  StopLine line = StopLine::listen(path()).value();
  int handed_over = 0;
  while (handed_over < 10'000 && hand_over_stop(path(), OperatorVerb::stop)) ++handed_over;
  EXPECT_GT(handed_over, 0);
  EXPECT_EQ(line.wait(), OperatorVerb::stop);
  EXPECT_TRUE(hand_over_stop(path(), OperatorVerb::deenergise)) << "there is room again";
}

TEST_F(StopLineTest, ItIsForOurOwnUserAndGoesWithItsOwner) {
  {
    StopLine line = StopLine::listen(path()).value();
    struct stat status {};
    ASSERT_EQ(stat(path().c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777U, 0600U);
  }
  EXPECT_FALSE(std::filesystem::exists(path()));
  EXPECT_FALSE(hand_over_stop(path(), OperatorVerb::stop));
}

TEST_F(StopLineTest, WhatADeadPredecessorLeftIsReplaced) {
  { std::filesystem::create_directory(directory_.path("keep")); }
  const Descriptor dead(socket(AF_UNIX, SOCK_DGRAM, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path().copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(bind(dead.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  StopLine line = StopLine::listen(path()).value();
  EXPECT_TRUE(hand_over_stop(path(), OperatorVerb::stop));
  EXPECT_EQ(line.wait(), OperatorVerb::stop);
}

TEST_F(StopLineTest, ClosingEndsAWait) {
  StopLine line = StopLine::listen(path()).value();
  std::thread other([&line] { line.close(); });
  EXPECT_EQ(line.wait(), std::nullopt);
  other.join();
}

}  // namespace
}  // namespace takt::ipc
