// SPDX-License-Identifier: Apache-2.0
// Goal: after a drive was without supply while its host ran, no joint is armed whose reading is off from where it truly
// stands by more than 0.05 rad, and a drive that knows its place is armed without a question.
// Method: tick, drivers and simulated drives in virtual time, one joint on a flywheel per protocol; 200 poses at
// random. At half of them the drive was told its zero and not told to save it. The oracle is the plant's true position.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <random>
#include <string>

#include "config/load.hpp"
#include "drivers/tools/discovery.hpp"
#include "simulation/free_inertias.hpp"
#include "simulation/robot_plant.hpp"
#include "tests/simulation/whole_loop.hpp"

namespace takt::plant {
namespace {

struct Kind {
  const char* name;
  std::size_t joint;  // of config/dual_arm12.yaml
  bool takes_zero;    // has a frame for it
};
constexpr Kind kKinds[] = {
    {"mit", 0, true}, {"robstride", 3, true}, {"odrive", 4, false}, {"moteus", 9, false}, {"cia402", 7, false}};

config::RobotConfig lone(std::size_t joint, double pose) {
  config::RobotConfig robot = config::load("config/dual_arm12.yaml").value();
  robot.joints = {robot.joints[joint]};
  robot.buses = {robot.buses[robot.joints[0].bus]};
  config::Joint& only = robot.joints[0];
  only.bus = 0;
  only.home = pose;
  only.limits.q_min = -3;
  only.limits.q_max = 3;
  robot.fallbacks.clear();
  robot.degraded.fallback = "none";
  robot.model.reset();
  return robot;
}

struct Outcome {
  bool armed = false;
  double off = 0;  // rad: reading less true position
};

// The drive is told its zero where it stands (`zeroed`), loses its supply, and boots; then arming is tried.
Outcome power_cycle_and_arm(const Kind& kind, double pose, bool zeroed, bool saved) {
  const config::RobotConfig robot = lone(kind.joint, pose);
  Plant plant = Plant::on_free_inertias(robot).value();
  test::WholeLoop loop(robot, plant);
  loop.run(500);
  double zero = 0;
  if (zeroed) {
    const auto frames = drivers::zero_frames(robot.joints[0].drive);
    Frames said;
    for (std::size_t i = 0; i < (saved ? frames.size() : 1); ++i) plant.receive(plant.bus_of(0), frames[i], said);
    loop.run(500);
    zero = plant.state().q[0] - static_cast<double>(loop.joint(0).feedback.q);
    loop.tick(OperatorRequest::reset);
  }
  loop.run(100);
  plant.drive(0).power_cycle(plant.now());
  loop.run(1000);
  Outcome outcome;
  outcome.armed = loop.arm();
  outcome.off = std::abs(static_cast<double>(loop.joint(0).feedback.q) - (plant.state().q[0] - zero));
  return outcome;
}

TEST(PlaceAfterPowerCycle, NoJointIsArmedThatReadsElsewhere) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> any(-1.2, 1.2);
  int armed = 0, wrong = 0, knowing = 0, asked = 0;
  for (int i = 0; i < 200; ++i) {
    const Kind& kind = kKinds[static_cast<std::size_t>(i) % std::size(kKinds)];
    const bool zeroed = kind.takes_zero && (i / 5) % 2 == 0;
    const double pose = any(random);
    const Outcome outcome = power_cycle_and_arm(kind, pose, zeroed, false);
    armed += outcome.armed ? 1 : 0;
    wrong += outcome.armed && outcome.off > 0.05 ? 1 : 0;
    const bool knows = outcome.off <= 0.05;
    knowing += knows ? 1 : 0;
    asked += knows && !outcome.armed ? 1 : 0;
    EXPECT_FALSE(outcome.armed && outcome.off > 0.05) << kind.name << " at " << pose << ", off by " << outcome.off;
  }
  std::printf("200 power cycles: %d armed, %d of them elsewhere; %d drives knew their place, %d of them not armed\n",
              armed, wrong, knowing, asked);
  EXPECT_LE(20 * asked, knowing);
  EXPECT_GT(armed, 100);
}

TEST(PlaceAfterPowerCycle, AZeroThatWasSavedIsThereAgain) {
  for (const Kind& kind : {kKinds[0], kKinds[1]}) {
    const Outcome outcome = power_cycle_and_arm(kind, 0.8, true, true);
    EXPECT_TRUE(outcome.armed) << kind.name;
    EXPECT_LE(outcome.off, 0.01) << kind.name;
  }
  EXPECT_FALSE(power_cycle_and_arm(kKinds[1], 0.8, true, false).armed)
      << "a RobStride forgets what it was not told to save";
}

}  // namespace
}  // namespace takt::plant
