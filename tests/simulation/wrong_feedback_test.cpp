// SPDX-License-Identifier: Apache-2.0
// Goal: a drive that obeys and tells what is not true of its joint is found within 50 ms and 0.1 rad of true motion, on
// every protocol, wherever its loop is closed; a jump moves nothing.
// Method: tick, drivers, simulated drives and flywheels in virtual time; the oracle is the plant's true motion. One
// fault per run, which begins at rest and in motion.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <random>
#include <string>

#include "config/load.hpp"
#include "executive/pipeline/joint_watch.hpp"
#include "simulation/free_inertias.hpp"
#include "simulation/robot_plant.hpp"
#include "tests/simulation/whole_loop.hpp"

namespace takt::simulation {
namespace {

const config::RobotConfig& dual_arm() {
  static const config::RobotConfig robot = config::load("config/dual_arm12.yaml").value();
  return robot;
}

// One joint of the two-armed robot by itself: its drive on a flywheel, no gravity, no stops, no friction.
config::RobotConfig lone(std::size_t joint, std::optional<config::Cia402Mode> mode) {
  config::RobotConfig robot = dual_arm();
  robot.joints = {robot.joints[joint]};
  robot.buses = {robot.buses[robot.joints[0].bus]};
  config::Joint& only = robot.joints[0];
  only.bus = 0;
  only.home = 0;
  only.limits.q_min = -3;
  only.limits.q_max = 3;
  if (mode) only.drive.mode = *mode;
  robot.fallbacks.clear();
  robot.degraded.fallback = "none";
  robot.model.reset();
  robot.simulation->viscous = robot.simulation->coulomb = 0;
  return robot;
}

struct Lone {
  std::string name;
  std::size_t joint;
  std::optional<config::Cia402Mode> mode = {};  // of CiA 402; none: as in the file
};
// Every protocol of the robot, and the other modes of CiA 402.
const Lone kDrives[] = {{"mit", 0},
                        {"mit_geared", 2},
                        {"robstride", 3},
                        {"odrive", 4},
                        {"odrive_geared", 8},
                        {"moteus", 9},
                        {"cia402_cst", 7},
                        {"cia402_csp", 7, config::Cia402Mode::csp},
                        {"cia402_csv", 7, config::Cia402Mode::csv}};

struct Wrong {
  std::string name;
  LineFaults line;
};
const Wrong kFrozen[] = {{"frozen_position", {.feedback = {.frozen_position = true}}},
                         {"freeze", {.feedback = {.freeze = true}}}};
const Wrong kSlopes[] = {{"reversed", {.feedback = {.reversed = true}}}, {"scale", {.feedback = {.scale = 2}}}};
const Wrong kJumps[] = {{"jump", {.feedback = {.offset = 0.3}}},
                        {"wrap", {.feedback = {.offset = 2 * std::numbers::pi}}}};

class LoneDrive {
 public:
  explicit LoneDrive(const Lone& lone_drive)
      : robot_(lone(lone_drive.joint, lone_drive.mode)),
        plant(Plant::on_free_inertias(robot_).value()),
        loop(robot_, plant) {}
  bool begin(bool moving) {
    loop.pose[0] = 0.1F;
    if (!loop.arm()) return false;
    loop.run(2000);
    loop.pose[0] = moving ? 1.5F : 0.1F;
    for (int i = 0; moving && i < 2000 && plant.state().dq[0] < 0.5; ++i) loop.tick();
    from = plant.state().q[0];
    return loop.mode() == Mode::tracking;
  }
  [[nodiscard]] double moved() const { return std::abs(plant.state().q[0] - from); }
  [[nodiscard]] bool is_found() const {
    return (loop.out->record.header.causes_active >> static_cast<unsigned>(Cause::feedback_implausible) & 1U) != 0;
  }

 private:
  config::RobotConfig robot_;

 public:
  Plant plant;
  test::WholeLoop loop;
  double from = 0;
};

class WrongFeedback : public testing::TestWithParam<Lone> {};

TEST_P(WrongFeedback, FrozenIsFoundBeforeTheJointGetsFar) {
  for (const Wrong& wrong : kFrozen) {
    for (const bool moving : {false, true}) {
      LoneDrive drive(GetParam());
      ASSERT_TRUE(drive.begin(moving)) << drive.loop.out->record.header.causes_active;
      drive.plant.set_line(0, wrong.line);
      drive.loop.pose[0] = 1.5F;
      int moved_for = 0;
      for (int i = 0; i < 1000 && !drive.is_found(); ++i) {
        drive.loop.tick();
        moved_for += drive.moved() > 0.02 ? 1 : 0;
      }
      EXPECT_TRUE(drive.is_found()) << wrong.name << ", moving: " << moving;
      EXPECT_LE(drive.moved(), 0.1) << wrong.name << ", moving: " << moving;
      EXPECT_LE(moved_for, 50) << wrong.name << ", moving: " << moving;
      EXPECT_EQ(drive.loop.mode(), Mode::fault_latched);
      drive.loop.run(20);
      EXPECT_NE(drive.plant.drive(0).state(), DeviceState::enabled);
    }
  }
}

// What the drive tells no velocity of its own for is not contradicted: then the joint is led astray by its positions.
TEST_P(WrongFeedback, SlopesThatContradictVelocitiesAreFound) {
  for (const Wrong& wrong : kSlopes) {
    LoneDrive drive(GetParam());
    ASSERT_TRUE(drive.begin(true));
    if (!drive.loop.config.joints[0].tells_velocity) return;
    drive.plant.set_line(0, wrong.line);
    for (int i = 0; i < 1000 && !drive.is_found(); ++i) drive.loop.tick();
    EXPECT_TRUE(drive.is_found()) << wrong.name;
    EXPECT_LE(drive.moved(), wrong.name == "scale" ? 0.2 : 0.1) << wrong.name;
    EXPECT_EQ(drive.loop.mode(), Mode::fault_latched);
  }
}

TEST_P(WrongFeedback, AJumpMovesNothing) {
  for (const Wrong& wrong : kJumps) {
    LoneDrive drive(GetParam());
    ASSERT_TRUE(drive.begin(false));
    drive.plant.set_line(0, wrong.line);
    int ticks = 0;
    for (; ticks < 100 && !drive.is_found(); ++ticks) drive.loop.tick();
    EXPECT_TRUE(drive.is_found()) << wrong.name;
    EXPECT_LE(ticks, 50) << wrong.name;
    drive.loop.run(1000);
    EXPECT_EQ(drive.loop.mode(), Mode::fault_latched);
    EXPECT_LE(drive.moved(), 0.01) << wrong.name;
  }
}

// One wrong position: believed by nothing, and over with the next reply.
TEST_P(WrongFeedback, OneOutlierIsNotFollowed) {
  LoneDrive drive(GetParam());
  ASSERT_TRUE(drive.begin(false));
  drive.plant.set_line(0, {.feedback = {.offset = 0.3}});
  drive.loop.tick();
  drive.plant.set_line(0, {});
  double fastest = 0;
  for (int i = 0; i < 300; ++i) {
    drive.loop.tick();
    fastest = std::max(fastest, std::abs(drive.plant.state().dq[0]));
  }
  EXPECT_EQ(drive.loop.mode(), Mode::tracking);
  EXPECT_LE(fastest, 0.15) << "rad/s";
  EXPECT_LE(drive.moved(), 0.02);
}

INSTANTIATE_TEST_SUITE_P(EveryProtocol, WrongFeedback, testing::ValuesIn(kDrives),
                         [](const auto& drive) { return drive.param.name; });

struct Robot {
  std::string name, file;
};

class RightFeedback : public testing::TestWithParam<Robot> {
 protected:
  static constexpr double kPayload = 1;

  // The same watch, on what the tick was told.
  void follow(test::WholeLoop& loop) {
    for (std::size_t j = 0; j < loop.pose.size(); ++j) {
      const JointRecord& joint = loop.joint(j);
      const pipeline::JointConfig& known = loop.config.joints[j];
      pipeline::JointWatch& watch = watches_.at(j);
      pipeline::take_feedback(watch, joint.feedback, loop.out->record.header.now, known, loop.config);
      pipeline::note_told(watch, loop.out->setpoints[j], joint.tau_gravity, joint.q_reference, known);
      const pipeline::FeedbackMargin margin = pipeline::margin_of(watch, known, loop.config);
      contradiction = std::max(contradiction, margin.contradiction);
      frozen = std::max(frozen, margin.frozen);
    }
  }

  float contradiction = 0, frozen = 0;  // largest share of its limit

 private:
  std::array<pipeline::JointWatch, kMaxJoints> watches_{};
};

// All joints go to and fro, the robot is pushed and then laden, and nothing is suspected.
TEST_P(RightFeedback, IsBelievedWhateverTheRobotGoesThrough) {
  const config::RobotConfig robot = config::load(GetParam().file).value();
  for (const bool laden : {false, true}) {
    RobotPlant plant = std::move(*RobotPlant::make(robot, std::array{kPayload}));
    test::WholeLoop loop(robot, plant);
    ASSERT_TRUE(loop.arm());
    std::mt19937 random(7);
    for (int i = 0; i < 12'000; ++i) {
      if (i % 700 == 0)
        for (std::size_t j = 0; j < loop.pose.size(); ++j) {
          const float low = std::max(loop.config.joints[j].limits.q_min, -1.2F);
          const float high = std::min(loop.config.joints[j].limits.q_max, 1.2F);
          loop.pose[j] = low + (high - low) * static_cast<float>(random() % 1000) / 1000.0F;
        }
      BodyTrouble trouble;
      if (laden) trouble.payload = kPayload;
      if (!laden && i % 1000 < 100) trouble.force = 60, trouble.towards = {0.6, 0.64, 0.48};
      plant.set_trouble(trouble);
      if (i == 10'000) loop.has_policy = false;
      loop.tick();
      follow(loop);
      for (std::size_t j = 0; j < loop.pose.size(); ++j)
        ASSERT_EQ(loop.joint(j).reply_faults & 0xF8, 0) << robot.joints[j].name << ", tick " << i << ", " << laden;
    }
    EXPECT_EQ(loop.mode(), Mode::damped_stop) << "its policy died";
  }
  std::printf("%-12s contradiction %.2f, frozen %.2f of their limits\n", GetParam().name.c_str(), double{contradiction},
              double{frozen});
}

INSTANTIATE_TEST_SUITE_P(Robots, RightFeedback,
                         testing::Values(Robot{"arm6", "config/arm6.yaml"},
                                         Robot{"dual_arm12", "config/dual_arm12.yaml"}),
                         [](const auto& robot) { return robot.param.name; });

}  // namespace
}  // namespace takt::simulation
