// SPDX-License-Identifier: Apache-2.0
// Goal: `takt margin` ends with its documented exit codes and its Bode plot is well-formed. Method: the real binary on
// the shipped robots, without the task, whose rollouts have tests of their own.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/cli/shell.hpp"

namespace takt::cli {
namespace {

class MarginCli : public test::Shell {};

// Two of the demo arm's joints ring, in agreement.
TEST_F(MarginCli, TheDemoArmsMarginsAgreeAndTwoJointsRing) {
  const std::string picture = in("bode.svg");
  const test::Ended ended = shell("(" TAKT_BIN_DIR "/takt margin config/arm6.yaml --no-task --json --svg " + picture +
                                  " 2>" + in("said.txt") + ")");
  EXPECT_EQ(ended.exit_code, 2) << ended.output;
  const auto json = nlohmann::json::parse(ended.output);
  EXPECT_TRUE(json["agrees"]);
  EXPECT_TRUE(json["rings"]);
  const std::string said = shell("cat " + in("said.txt")).output;
  EXPECT_TRUE(said.starts_with("takt margin: joint base_yaw rings: phase margin 29.")) << said;
  EXPECT_NE(said.find("\ntakt margin: joint shoulder rings: phase margin 25."), std::string::npos) << said;
  EXPECT_NE(said.find("degrees, below 30; lower gains.kp from 200 to "), std::string::npos) << said;
  EXPECT_EQ(std::ranges::count(said, '\n'), 2);
  EXPECT_EQ(json["joints"].size(), 6U);
  EXPECT_TRUE(json["task"].is_null());
  const test::Ended parsed = shell(
      "python3 -c \"import sys, xml.dom.minidom as d; s = d.parse(sys.argv[1]); "
      "print(len(s.getElementsByTagName('polyline')))\" " +
      picture);
  EXPECT_EQ(parsed.output, "12\n") << "gain and phase of six joints";
}

// Without the task nothing is left to say of a robot that falls: one line, which names the correction.
TEST_F(MarginCli, ARobotThatFallsHasNoLoopToShow) {
  for (const std::string robot : {"cart_pole", "balancer"}) {
    const test::Ended ended = takt("margin config/" + robot + ".yaml --no-task");
    EXPECT_EQ(ended.exit_code, 1);
    EXPECT_EQ(std::ranges::count(ended.output, '\n'), 1) << ended.output;
    EXPECT_NE(ended.output.find("without the policy; leave out --no-task and --svg\n"), std::string::npos)
        << ended.output;
  }
}

// What is known of the joints is told, also where the task says nothing: here its bound is out of reach.
TEST_F(MarginCli, ATaskThatFailsHidesNoJoint) {
  const test::Ended ended = shell(TAKT_BIN_DIR "/takt margin config/arm6.yaml --bound 0.001mm");
  EXPECT_EQ(ended.exit_code, 1) << ended.output;
  EXPECT_NE(ended.output.find("shoulder"), std::string::npos) << ended.output;
  EXPECT_NE(ended.output.find("the task fails without any added delay"), std::string::npos) << ended.output;
}

TEST_F(MarginCli, BadInputEndsWithOneLine) {
  EXPECT_EQ(takt("margin").exit_code, 64);
  EXPECT_EQ(takt("margin config/arm6.yaml --seeds 10").exit_code, 64) << "too few to show anything";
  EXPECT_EQ(takt("margin no-such-robot.yaml").exit_code, 65);
  std::filesystem::copy("config/arm6_reach.onnx", in("arm6_reach.onnx"));
  std::ifstream whole("config/arm6.yaml");
  std::ofstream cut(in("real.yaml"));
  for (std::string line; std::getline(whole, line) && !line.starts_with("simulation:");) cut << line << "\n";
  cut.close();
  const test::Ended ended = takt("margin " + in("real.yaml"));
  EXPECT_EQ(ended.exit_code, 1);
  EXPECT_EQ(ended.output, "takt margin: " + in("real.yaml") + ": no `simulation`: there is no plant to measure on\n");
}

}  // namespace
}  // namespace takt::cli
