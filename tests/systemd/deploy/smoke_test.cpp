// Goal: the smoke run lets the demo robots through and catches a policy that does not fit, or whose robot does not
// stand the first seconds. Method: the committed robot files, and the arm with one value changed.
#include "systemd/deploy/smoke.hpp"

#include <gtest/gtest.h>

#include "config/load.hpp"

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

TEST(SmokeRun, AnotherRobotsPolicyFails) {
  const auto failed = tried({{"policy.file", "cart_pole_balance.onnx"}});
  ASSERT_FALSE(failed.has_value());
  EXPECT_EQ(failed.error().find("virtual time"), std::string::npos) << "found before anything ran: " << failed.error();
}

}  // namespace
}  // namespace takt::deploy
