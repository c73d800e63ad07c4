// SPDX-License-Identifier: Apache-2.0
// Goal: the smoke run lets the demo robots through and catches a policy that does not fit, or whose robot does not
// stand the first seconds; a policy that looks is tried where a world shows it something. Method: the committed robot
// files, the arm with one value changed, and the arm under docs/examples/python-sensor/look.onnx.
#include "systemd/deploy/smoke.hpp"

#include <gtest/gtest.h>

#include <regex>

#include "config/load.hpp"
#include "tests/simulation/looking_arm.hpp"
#include "tests/support/temporary_directory.hpp"

namespace takt::deploy {
namespace {

std::expected<std::string, std::string> tried(const std::vector<config::Override>& changes,
                                              const std::string& file = "config/arm6.yaml") {
  const auto robot = config::with_overrides(config::load(file).value(), changes);
  EXPECT_TRUE(robot.has_value()) << robot.error();
  return smoke_run(*robot);
}

TEST(SmokeRun, TheDemoRobotsPass) {
  for (const char* file : {"config/arm6.yaml", "config/cart_pole.yaml", "config/balancer.yaml"}) {
    const auto passed = tried({}, file);
    ASSERT_TRUE(passed.has_value()) << file << ": " << passed.error();
    EXPECT_NE(passed->find("tracked for 5 s"), std::string::npos) << *passed;
  }
}

TEST(SmokeRun, AContractThatThePolicyCannotKeepFails) {
  const auto failed = tried({{"freshness.max_age", "22 ms"}});
  ASSERT_FALSE(failed.has_value());
  EXPECT_NE(failed.error().find("virtual time"), std::string::npos) << failed.error();
}

// Goal: what ended a smoke run is told with its cause and tick, a stop in its incident's sentence. Method: a policy
// that takes longer than the arm's contract allows now and then, degraded, and stopped for it.
TEST(SmokeRun, TellsTheCauseAndTheTick) {
  const auto degraded = tried({}, "config/arm6_flow.yaml");
  ASSERT_FALSE(degraded.has_value());
  EXPECT_TRUE(std::regex_match(
      degraded.error(),
      std::regex("5 s in virtual time: degraded at tick \\d+: command_late: no usable command came for 10 ms "
                 "\\(freshness.epsilon of freshness.window\\); the newest is \\d+ ms old")))
      << degraded.error();
  const auto stopped = tried({{"degraded.for", "20 ms"}}, "config/arm6_flow.yaml");
  ASSERT_FALSE(stopped.has_value());
  EXPECT_EQ(stopped.error().find("5 s in virtual time: stop at tick "), 0U) << stopped.error();
  EXPECT_NE(stopped.error().find(": degraded_spent: the robot has been degraded for 0.02 s"), std::string::npos)
      << stopped.error();
}

TEST(SmokeRun, AnotherRobotsPolicyFails) {
  const auto failed = tried({{"policy.file", "cart_pole_balance.onnx"}});
  ASSERT_FALSE(failed.has_value());
  EXPECT_EQ(failed.error().find("virtual time"), std::string::npos) << "found before anything ran: " << failed.error();
}

TEST(SmokeRun, APolicyThatLooksIsTriedWhereAWorldShowsItSomething) {
  const test::TemporaryDirectory directory;
  const auto robot = config::load(test::looking_arm(directory.path())).value();
  const auto alone = smoke_run(robot);
  ASSERT_TRUE(alone.has_value()) << alone.error();
  EXPECT_NE(alone->find("nothing was run: give it a world that does (--world)"), std::string::npos) << *alone;

  const test::ForkedWorld spots([](const std::string& path) { test::play_spots(path, TAKT_WORLD_ERROR); });
  const auto shown = smoke_run(robot, {spots.path(), {}});
  ASSERT_TRUE(shown.has_value()) << shown.error();
  EXPECT_NE(shown->find("tracked for 5 s"), std::string::npos) << *shown;

  const test::ForkedWorld dark([](const std::string& path) {
    takt_world world;
    if (takt_world_listen(&world, path.c_str()) != 0) return;
    while (takt_world_accept(&world, "dark", TAKT_WORLD_ERROR) == 0)
      for (takt_world_state state{}; takt_world_next(&world) == 0;) takt_world_answer(&world, &state);
  });
  const auto refused = smoke_run(robot, {dark.path(), {}});
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().find("sees images of cam0, which world dark does not give"), std::string::npos)
      << refused.error();
}

}  // namespace
}  // namespace takt::deploy
