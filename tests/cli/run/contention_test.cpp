// SPDX-License-Identifier: Apache-2.0
// Goal: a load lasts until its own end and no longer, and one that ended early is told. Method: real processes that
// sleep for absurd, distinct times, looked for in /proc.
#include "cli/run/contention.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <filesystem>
#include <thread>

#include "tests/support/files.hpp"

namespace takt::cli {
namespace {

const std::string kSleep = "/bin/sleep";

int running(const std::string& seconds) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string line = test::text_of(entry.path() / "cmdline");
    if (line == kSleep + '\0' + seconds + '\0') ++count;
  }
  return count;
}

bool becomes(const std::string& seconds, int count) {
  for (int poll = 0; poll < 1000 && running(seconds) != count; ++poll)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  return running(seconds) == count;
}

class ContentionTest : public testing::Test {
 protected:
  static Event event(ActionKind action, std::size_t count, const std::string& seconds) {
    Event event;
    event.action = action;
    event.count = count;
    event.command = {kSleep, seconds};
    return event;
  }
  const config::RobotConfig robot_;
  Contention contention_{robot_, "/dev/null"};
};

TEST_F(ContentionTest, ALoadsEndLeavesAnotherAlone) {
  ASSERT_TRUE(contention_.apply(event(ActionKind::load, 2, "7654321")));
  ASSERT_TRUE(contention_.apply(event(ActionKind::load, 1, "7654322")));
  ASSERT_TRUE(becomes("7654321", 2) && becomes("7654322", 1));
  EXPECT_TRUE(contention_.apply(event(ActionKind::unload, 2, "7654321")));
  EXPECT_EQ(running("7654321"), 0);
  EXPECT_EQ(running("7654322"), 1);
  EXPECT_TRUE(contention_.apply(event(ActionKind::unload, 1, "7654322")));
  EXPECT_EQ(running("7654322"), 0);
}

TEST_F(ContentionTest, ALoadThatEndedBeforeItsTimeIsTold) {
  const Event load = event(ActionKind::load, 1, "not-a-time");
  ASSERT_TRUE(contention_.apply(load));
  siginfo_t dead{};
  ASSERT_EQ(waitid(P_ALL, 0, &dead, WEXITED | WNOWAIT), 0);
  const auto ended = contention_.apply(event(ActionKind::unload, 1, "not-a-time"));
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error().exit_code, kExitFailed);
  EXPECT_NE(ended.error().sentence.find("before its time"), std::string::npos) << ended.error().sentence;
}

}  // namespace
}  // namespace takt::cli
