// SPDX-License-Identifier: Apache-2.0
// Goal: the service manager's watchdog bites when the control thread hangs, and an orderly end follows a signal.
// Method: the real service loop and the real cyclic loop on a bus that hangs on demand, a real datagram socket, a real
// SIGTERM.
#include "executive/runtime/service.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <optional>
#include <thread>

#include "config/load.hpp"
#include "tests/executive/runtime/loop_rig.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::runtime::test {
namespace {

constexpr auto kWatchdogUsec = "60000";  // asks for a ping every 20 ms
constexpr int kFivePeriodsMs = 300;

class ServiceTest : public testing::Test {
 protected:
  ServiceTest() {
    notify_ = ipc::Descriptor(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    directory_.path("notify").copy(address.sun_path, sizeof address.sun_path - 1);
    EXPECT_EQ(bind(notify_.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    setenv("NOTIFY_SOCKET", address.sun_path, 1);
    setenv("WATCHDOG_USEC", kWatchdogUsec, 1);
    block_shutdown_signals();
    drain_shutdown_signals();
    rig_.buses[0]->on_send = [this] {
      while (hang_) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    };
    reception_ = Reception::open(directory_.path("executive.sock"), {robot_,
                                                                     rig_.config,
                                                                     {},
                                                                     rig_.published,
                                                                     rig_.mailboxes,
                                                                     rig_.requests,
                                                                     rig_.recorded,
                                                                     rig_.board,
                                                                     follower_})
                     .value();
    cards_.emplace(robot_, rig_.published.frame_reader(), directory_.path());
    control_ = std::thread([this] { rig_.loop.run(EvidenceSource::open().value()); });
    service_ = std::thread(
        [this] { serve(*reception_, follower_, *cards_, rig_.board, rig_.requests, queues_, introduction_); });
  }
  ~ServiceTest() override {
    hang_ = false;
    kill(getpid(), SIGTERM);
    service_.join();
    rig_.loop.finish();
    control_.join();
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
  }
  // The signal that ended the test before may have come after its service loop had ended already.
  static void drain_shutdown_signals() {
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    const timespec no_wait{};
    while (sigtimedwait(&signals, nullptr, &no_wait) > 0) {
    }
  }
  // The next message that comes within the time; empty when none does.
  std::string hear(int timeout_ms) {
    pollfd polled{notify_.get(), POLLIN, 0};
    if (poll(&polled, 1, timeout_ms) <= 0) return {};
    char text[256];
    const ssize_t size = recv(notify_.get(), text, sizeof text, 0);
    return {text, static_cast<std::size_t>(std::max<ssize_t>(size, 0))};
  }
  bool hear_this(const std::string& wanted) {
    for (std::string message = hear(10'000); !message.empty(); message = hear(10'000)) {
      if (message == wanted) return true;
    }
    return false;
  }

  const takt::test::TemporaryDirectory directory_;
  ipc::Descriptor notify_;
  config::RobotConfig robot_ = config::load("config/arm6.yaml").value();
  SystemClock clock_;
  LoopRig rig_{6, 2, {{}, {}, 1000}, &clock_};
  TickFollower follower_{rig_.published.tick_reader(), rig_.config, [](const TickRecord&) {}};
  std::optional<DriveCards> cards_;
  TransmitQueues queues_{robot_.freshness.max_age, {}};
  trace::Introduction introduction_{"takt-executive", 0, 0, robot_.joints};
  std::unique_ptr<Reception> reception_;
  std::atomic<bool> hang_ = false;
  std::thread control_, service_;
};

TEST_F(ServiceTest, PingsStopWhileTheControlThreadHangsAndComeBackWithIt) {
  ASSERT_TRUE(hear_this("READY=1"));
  ASSERT_TRUE(hear_this("WATCHDOG=1"));
  hang_ = true;
  int heard_after_hang = 0;  // what was under way may still come; then silence
  while (heard_after_hang < 20 && !hear(kFivePeriodsMs).empty()) ++heard_after_hang;
  EXPECT_LT(heard_after_hang, 20) << "pings went on for a second although no tick completed";
  EXPECT_EQ(hear(kFivePeriodsMs), "");
  hang_ = false;
  EXPECT_TRUE(hear_this("WATCHDOG=1"));
}

TEST_F(ServiceTest, ASignalIsAnnouncedAndReachesTheTick) {
  ASSERT_TRUE(hear_this("READY=1"));
  kill(getpid(), SIGTERM);
  EXPECT_TRUE(hear_this("STOPPING=1"));
  bool read = false;
  for (int i = 0; i < 2000 && !read; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    for (const TickRecord& record : rig_.records()) {
      read |= record.header.operator_request == OperatorRequest::shutdown;
    }
  }
  EXPECT_TRUE(read);
}

// Threat: runtime-directory
TEST_F(ServiceTest, ASocketThatIsTakenAwayIsSaidWithWhatStillStopsTheRobot) {
  ASSERT_TRUE(hear_this("READY=1"));
  std::string log;
  std::filesystem::remove(directory_.path("executive.sock"));
  for (int i = 0; i < 100 && log.find("SIGTERM to process") == std::string::npos; ++i) {
    ::testing::internal::CaptureStdout();
    hear(100);
    log += ::testing::internal::GetCapturedStdout();
  }
  EXPECT_NE(log.find("`takt stop` cannot reach this robot"), std::string::npos) << log;
}

}  // namespace
}  // namespace takt::runtime::test
