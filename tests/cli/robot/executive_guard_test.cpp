// SPDX-License-Identifier: Apache-2.0
// Goal: what must not be done beside an executive is refused whenever one may be there, and only then. Method: sockets
// in a folder of their own: none, one whose server died, one whose server never answers. One that answers is in
// bus_tools_test, an armed one in deploy_cli_test.
#include "cli/robot/executive_guard.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "config/paths.hpp"
#include "executive/ipc/unix_socket.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::cli {
namespace {

class ExecutiveGuard : public testing::Test {
 protected:
  [[nodiscard]] ipc::Descriptor listen() const {
    return ipc::listen_at(config::executive_socket(directory_.path())).value();
  }
  void expect_free() const {
    const std::vector<std::string> places{directory_.path("absent"), directory_.path()};
    EXPECT_TRUE(require_no_executive(places));
    EXPECT_TRUE(require_disarmed(places));
  }
  const test::TemporaryDirectory directory_;
};

TEST_F(ExecutiveGuard, NobodyAndADeadServerAreFree) {
  expect_free();
  (void)listen();  // closed at once: its socket stays behind, as after SIGKILL
  ASSERT_TRUE(std::filesystem::exists(config::executive_socket(directory_.path())));
  expect_free();
}

TEST_F(ExecutiveGuard, OneThatDoesNotAnswerIsNotDisturbed) {
  const ipc::Descriptor server = listen();
  const std::vector<std::string> places{directory_.path("absent"), directory_.path()};
  const auto free = require_no_executive(places);
  ASSERT_FALSE(free);
  EXPECT_NE(free.error().sentence.find("an executive may run in " + directory_.path()), std::string::npos)
      << free.error().sentence;
  EXPECT_NE(free.error().sentence.find("did not answer in time"), std::string::npos) << free.error().sentence;
  const auto disarmed = require_disarmed(places);
  ASSERT_FALSE(disarmed);
  EXPECT_NE(disarmed.error().sentence.find("whether the robot in " + directory_.path() + " is armed is unknown"),
            std::string::npos)
      << disarmed.error().sentence;
}

// Goal: no command tells a person to press the stop of a robot that is stopped: that takes its power.
TEST(StepsToDisarm, AskForNoSecondPress) {
  for (const Mode stands : {Mode::damped_stop, Mode::fault_latched})
    EXPECT_EQ(steps_to_disarm(stands).find("stop"), std::string_view::npos);
  for (const Mode armed : {Mode::arming, Mode::tracking, Mode::degraded})
    EXPECT_NE(steps_to_disarm(armed).find("takt stop"), std::string_view::npos);
}

}  // namespace
}  // namespace takt::cli
