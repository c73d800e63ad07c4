// SPDX-License-Identifier: Apache-2.0
// Goal: a limb that loses a drive does not fall: the joints between the base and the lost one hold where they are, and
// no reset takes the power of a joint that moves; without a model a stop holds as well. Method: robots with gravity in
// virtual time, each drive silenced in turn, the true motion of the simulated joints.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>
#include <vector>

#include "config/cautions.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "tests/evidence/rollout/scenario_run.hpp"

namespace takt::lab {
namespace {

using test::arm6;
using test::dual_arm12;
using test::ScenarioRun;

constexpr double kHeld = 0.05;       // rad
constexpr double kResetBelow = 0.1;  // rad/s

std::string silence(const config::Joint& joint, const char* lasting, const char* at = "1 s") {
  const std::string path = testing::TempDir() + "silent-" + joint.name + ".yaml";
  std::ofstream(path) << "schema: takt.scenario/1\nevents:\n  - { after: enabled, at: " << at
                      << ", joint: " << joint.name << ", fault: silent, for: " << lasting << " }\n";
  return path;
}

bool hangs_on(const pipeline::TickConfig& config, std::size_t joint, std::size_t on) {
  for (auto at = static_cast<std::int32_t>(joint); at >= 0; at = config.links[static_cast<std::size_t>(at)].parent)
    if (static_cast<std::size_t>(at) == on) return true;
  return false;
}

// Of each joint, how far it was from where the robot latched the fault.
std::vector<double> moved_after_loss(const config::RobotConfig& robot, std::size_t lost) {
  ScenarioRun run(robot, silence(robot.joints[lost], "60 s"));
  const auto incident = run.run();
  EXPECT_TRUE(incident && incident->cause == Cause::feedback_lost);
  const std::vector<double> at = run.positions();
  std::vector<double> moved(at.size());
  for (int tick = 0; tick < 3000; ++tick) {
    run.step();
    const std::vector<double> now = run.positions();
    for (std::size_t j = 0; j < at.size(); ++j) moved[j] = std::max(moved[j], std::abs(now[j] - at[j]));
  }
  EXPECT_EQ(run.record().header.mode, Mode::fault_latched);
  return moved;
}

TEST(LostDrive, EveryJointThatDoesNotHangOnItHolds) {
  for (const config::RobotConfig* robot : {&arm6(), &dual_arm12()}) {
    const pipeline::TickConfig config = setup::tick_config_of(*robot, 0);
    for (std::size_t lost = 0; lost < robot->joints.size(); ++lost) {
      const std::vector<double> moved = moved_after_loss(*robot, lost);
      for (std::size_t j = 0; j < moved.size(); ++j)
        EXPECT_TRUE(hangs_on(config, j, lost) || moved[j] <= kHeld)
            << robot->robot << ": without " << robot->joints[lost].name << ", " << robot->joints[j].name << " moved by "
            << moved[j] << " rad";
    }
  }
}

// The drive is heard again soon; a person asks for a reset in every tick, and takes the power where none is granted.
TEST(LostDrive, NoResetTakesThePowerOfAJointThatMoves) {
  int granted = 0;
  for (const config::RobotConfig* robot : {&arm6(), &dual_arm12()})
    for (std::size_t lost = 0; lost < robot->joints.size(); ++lost) {
      ScenarioRun run(*robot, silence(robot->joints[lost], "100 ms"));
      ASSERT_TRUE(run.run());
      JointMask powered = 0;
      int ticks = 0;
      for (; ticks < 5000 && run.record().header.mode != Mode::standby; ++ticks) {
        powered = 0;
        for (std::size_t j = 0; j < robot->joints.size(); ++j)
          if (run.output().drive_enabled[j]) powered |= bit_of_joint(j);
        run.step(OperatorRequest::reset);
      }
      if (run.record().header.mode != Mode::standby) {  // what hangs on the lost joint sags still
        run.step(OperatorRequest::deenergise);
        EXPECT_EQ(run.record().header.mode, Mode::standby) << "a person's other way";
        continue;
      }
      ++granted;
      const std::vector<double> speeds = run.speeds();
      for (std::size_t j = 0; j < robot->joints.size(); ++j)
        EXPECT_TRUE((powered & bit_of_joint(j)) == 0 || std::abs(speeds[j]) < kResetBelow)
            << robot->robot << ": without " << robot->joints[lost].name << ", reset with " << robot->joints[j].name
            << " at " << speeds[j] << " rad/s after " << ticks << " ms";
    }
  EXPECT_GE(granted, 6) << "where nothing that sags hangs on the lost joint";
}

// Goal: where no model says what a joint carries, a stop and a fault do not let it fall. Method: the same arms, whose
// executive has no model of them: a person's stop, and each drive silenced.
TEST(WithoutAModel, NoJointFallsInAStopOrAFault) {
  constexpr double kSag = 0.2;  // rad, of the load over gains.kp
  for (const config::RobotConfig* robot : {&arm6(), &dual_arm12()}) {
    config::RobotConfig known = *robot;
    known.model.reset();
    ASSERT_TRUE(config::holds_at_once(known));
    for (std::size_t lost = 0; lost <= robot->joints.size(); ++lost) {
      const bool stops = lost == robot->joints.size();
      ScenarioRun run(*robot, silence(robot->joints[stops ? 0 : lost], "60 s", stops ? "50 s" : "1 s"), known);
      for (int tick = 0; tick < 10'000 && run.record().header.mode != Mode::tracking; ++tick) run.step();
      for (int tick = 0; tick < 900; ++tick) run.step();
      const std::vector<double> at = run.positions();
      if (stops) run.step(OperatorRequest::stop);
      for (int tick = 0; tick < 3000; ++tick) run.step();
      EXPECT_TRUE(pipeline::is_latched(run.record().header.mode));
      const pipeline::TickConfig config = setup::tick_config_of(*robot, 0);
      const std::vector<double> now = run.positions();
      for (std::size_t j = 0; j < at.size(); ++j)
        EXPECT_TRUE((!stops && hangs_on(config, j, lost)) || std::abs(now[j] - at[j]) <= kSag)
            << robot->robot << ": " << (stops ? "stopped" : "without " + robot->joints[lost].name) << ", "
            << robot->joints[j].name << " moved by " << now[j] - at[j] << " rad";
    }
  }
}

}  // namespace
}  // namespace takt::lab
