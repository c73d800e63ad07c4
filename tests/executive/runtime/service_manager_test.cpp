// SPDX-License-Identifier: Apache-2.0
// Goal: the service manager hears READY once ticks run, and WATCHDOG only while they advance. Method: a real datagram
// socket as NOTIFY_SOCKET; time and ticks are passed in.
#include "executive/runtime/service_manager.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

namespace takt::runtime {
namespace {

class ServiceManagerTest : public testing::Test {
 protected:
  void SetUp() override {
    listen_at(testing::TempDir() + "takt-notify-" + std::to_string(getpid()));
    setenv("WATCHDOG_USEC", "300000", 1);
    unsetenv("WATCHDOG_PID");
  }
  void TearDown() override {
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    deafen();
  }
  void listen_at(const std::string& path) {
    deafen();
    path_ = path;
    socket_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path_.copy(address.sun_path, sizeof address.sun_path);
    ASSERT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    setenv("NOTIFY_SOCKET", path_.c_str(), 1);
  }
  std::vector<std::string> heard() {
    std::vector<std::string> messages;
    char text[256];
    ssize_t size = 0;
    while ((size = recv(socket_, text, sizeof text, 0)) > 0)
      messages.emplace_back(text, static_cast<std::size_t>(size));
    return messages;
  }
  std::ptrdiff_t pings() { return std::ranges::count(heard(), "WATCHDOG=1"); }

  static constexpr MonoTime kStart{1'000'000'000};

 private:
  void deafen() {
    if (socket_ < 0) return;
    close(std::exchange(socket_, -1));
    unlink(path_.c_str());
  }
  std::string path_;
  int socket_ = -1;
};

using Messages = std::vector<std::string>;

TEST_F(ServiceManagerTest, ReadyComesWithTheHundredthTickAndOnce) {
  ServiceManager manager;
  EXPECT_FALSE(manager.report(kStart, 0, "standby"));
  EXPECT_FALSE(manager.report(kStart, kTicksUntilReady - 1, "standby"));
  EXPECT_EQ(heard(), (Messages{"STATUS=standby", "WATCHDOG=1"}));
  EXPECT_TRUE(manager.report(kStart, kTicksUntilReady, "standby"));
  EXPECT_EQ(heard(), Messages{"READY=1"});
  EXPECT_FALSE(manager.report(kStart, kTicksUntilReady + 1, "standby"));
  EXPECT_TRUE(heard().empty());
}

TEST_F(ServiceManagerTest, ASocketMayHaveTheLongestNameThatThereIs) {
  std::string path = testing::TempDir() + "takt-notify-";
  path.resize(sizeof sockaddr_un::sun_path, 'x');
  listen_at(path);
  EXPECT_TRUE(ServiceManager().report(kStart, kTicksUntilReady, "standby"));
  EXPECT_EQ(heard().size(), 3U);
  path.push_back('x');
  setenv("NOTIFY_SOCKET", path.c_str(), 1);
  EXPECT_TRUE(ServiceManager().report(kStart, kTicksUntilReady, "standby"));
  EXPECT_TRUE(heard().empty()) << "cut to what fits, it would be another's";
}

TEST_F(ServiceManagerTest, PingsComeThreeTimesPerWatchdogPeriodWhileTicksAdvance) {
  ServiceManager manager;
  std::ptrdiff_t count = 0;
  for (int ms = 0; ms <= 1000; ms += 10) {
    manager.report(kStart + milliseconds(ms), static_cast<std::uint64_t>(ms) + 1, "standby");
    count += pings();
  }
  EXPECT_EQ(count, 11);
}

TEST_F(ServiceManagerTest, NoPingWithoutATick) {
  ServiceManager manager;
  manager.report(kStart, 500, "standby");
  pings();
  for (int ms = 10; ms <= 1000; ms += 10) manager.report(kStart + milliseconds(ms), 500, "standby");
  EXPECT_EQ(pings(), 0) << "the control thread stands still: the watchdog must bite";
  manager.report(kStart + milliseconds(1010), 501, "standby");
  EXPECT_EQ(pings(), 1);
}

TEST_F(ServiceManagerTest, NoPingUnlessAskedFor) {
  unsetenv("WATCHDOG_USEC");
  ServiceManager manager;
  manager.report(kStart, 1, "standby");
  EXPECT_EQ(pings(), 0);
}

TEST_F(ServiceManagerTest, AManagerThatDoesNotListenIsNotWaitedForAndHearsReadyLater) {
  ServiceManager manager;
  for (int i = 0; i < 1000; ++i) manager.report(kStart, 0, std::to_string(i));  // its queue is full long before
  EXPECT_FALSE(manager.report(kStart, kTicksUntilReady, "full"));
  heard();
  EXPECT_TRUE(manager.report(kStart, kTicksUntilReady, "full"));
}

TEST_F(ServiceManagerTest, StatusIsSentWhenItChanges) {
  ServiceManager manager;
  manager.report(kStart, 0, "standby");
  manager.report(kStart, 0, "standby");
  manager.report(kStart, 0, "tracking");
  manager.stopping();
  EXPECT_EQ(heard(), (Messages{"STATUS=standby", "STATUS=tracking", "STOPPING=1"}));
}

}  // namespace
}  // namespace takt::runtime
