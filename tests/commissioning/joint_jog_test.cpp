// SPDX-License-Identifier: Apache-2.0
// Goal: a jog moves its joint as far as asked and back into the disabled state, never pulls harder than told, and ends
// with a reason when the drive is not there, does not enable, faults or falls silent. Method: host driver and simulated
// drive on a free inertia in virtual time.
#include "commissioning/joint_jog.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>

#include "drivers/protocol/protocol_table.hpp"
#include "simulation/cia402_device.hpp"
#include "simulation/device_table.hpp"
#include "tests/simulation/plant_robots.hpp"

namespace takt::commissioning {
namespace {

class Jog : public testing::Test {
 protected:
  Jog() {
    simulation::Frames said;
    device_->update({gear_ * q_, gear_ * dq_}, now_, {}, said);
  }
  void run(const JogWish& wish, Duration limit = seconds(20)) {
    JointJog jog(joint(), wish, *driver_, gravity_);
    while (!jog.ended() && now_ < MonoTime{} + limit) step(jog);
    EXPECT_TRUE(jog.ended());
    failure_ = jog.failure();
    moved_ = jog.moved();
    velocity_ = jog.velocity_scale();
    own_ = jog.own_scale();
    believed_ = jog.believed();
  }
  // The joint's drive is a CiA 402 one: as the file has it, and as it is.
  void replace_drive(
      const std::function<void(config::Drive&)>& file, const std::function<void(config::Drive&)>& truth,
      const std::function<void(simulation::Cia402Profile&)>& profile = [](simulation::Cia402Profile&) {}) {
    config::Drive& drive = robot_.joints[3].drive;
    drive.protocol = config::DriveProtocol::cia402;
    drive.mode = config::Cia402Mode::cst;
    drive.id = 5;
    drive.counts_per_turn = 4096;
    drive.rated_torque = drive.torque_range = 10;
    config::Drive real = drive;
    file(drive);
    truth(real);
    driver_ = drivers::make_joint_driver(robot_, 3).value();
    simulation::Cia402Profile told = simulation::profile_of(real);
    profile(told);
    device_ = std::make_unique<simulation::Cia402Device>(real, milliseconds(100), told);
    simulation::Frames said;
    device_->update({gear_ * q_, gear_ * dq_}, now_, {}, said);
  }
  void step(JointJog& jog) {
    now_ = now_ + milliseconds(1);
    std::array<drivers::CanFrame, drivers::kMaxFramesPerDrive> out;
    simulation::Frames answers;
    const std::size_t sent = jog.tick(now_, out);
    for (std::size_t i = 0; i < sent && is_there_; ++i) device_->receive(out[i], now_, answers);
    const double motor = gear_ * device_->update({gear_ * q_, gear_ * dq_}, now_, milliseconds(1), answers);
    const double torque = is_wired_backwards_ ? -motor : motor;
    most_torque_ = std::max(most_torque_, std::abs(torque + static_cast<double>(joint().kd) * dq_));
    if (!is_blocked_) {
      dq_ = (dq_ + 0.001 * (torque + load_) / inertia_) * (device_->brake_engaged() ? 0 : 1);
      q_ += 0.001 * dq_;
    }
    for (const drivers::CanFrame& answer : answers) {
      jog.take(answer);
      driver_->decode({answer, now_});
    }
    if (jog.phase() == JointJog::Phase::moving && fault_) {
      device_->inject(*fault_);
      fault_.reset();
    }
  }
  [[nodiscard]] const config::Joint& joint() const { return robot_.joints[3]; }

  config::RobotConfig robot_ = test::demo_arm();
  std::unique_ptr<drivers::JointDriver> driver_ = drivers::make_joint_driver(robot_, 3).value();
  std::unique_ptr<simulation::Device> device_ = simulation::make_device(robot_.joints[3].drive, milliseconds(100));
  MonoTime now_{1};
  double q_ = 0.3, dq_ = 0, most_torque_ = 0, moved_ = 0;
  double load_ = 0;        // Nm on the joint from outside
  double inertia_ = 0.02;  // kg m^2, of a slide kg
  double gear_ = 1;
  bool is_there_ = true, is_blocked_ = false, is_wired_backwards_ = false;
  GravityTerm gravity_;
  std::optional<simulation::DeviceFault> fault_;
  std::string failure_;
  VelocityScale velocity_;
  std::optional<OwnScale> own_;
  std::string believed_;
};

TEST_F(Jog, MovesAsFarAsAskedAndLetsGo) {
  run({.by = 0.1, .speed = 0.2, .torque = 1});
  EXPECT_EQ(failure_, "");
  EXPECT_NEAR(q_, 0.4, 0.01);
  EXPECT_NEAR(moved_, 0.1, 0.01);
  EXPECT_EQ(device_->state(), simulation::DeviceState::disabled);
  EXPECT_EQ(velocity_.verdict, VelocityScale::Verdict::right) << velocity_.sentence;
}

// Goal: a slide moves by millimetres with no more force than told, and is released when blocked. Method: 0.4 kg on
// 100 rad to a metre.
TEST_F(Jog, ASlideMovesByMillimetres) {
  test::slide(robot_.joints[3]);
  inertia_ = 0.4;
  gear_ = 100;
  q_ = 0.01;
  driver_ = drivers::make_joint_driver(robot_, 3).value();
  device_ = simulation::make_device(robot_.joints[3].drive, milliseconds(100));
  simulation::Frames said;
  device_->update({gear_ * q_, 0}, now_, {}, said);
  run({.by = 0.005, .speed = 0.01, .torque = 5});
  EXPECT_EQ(failure_, "");
  EXPECT_NEAR(q_, 0.015, 0.0005);
  EXPECT_NEAR(moved_, 0.005, 0.0005);
  EXPECT_LT(most_torque_, 6) << "the packed fields' quanta aside";
  EXPECT_EQ(velocity_.verdict, VelocityScale::Verdict::right) << velocity_.sentence;
  EXPECT_EQ(believed_, "gear_ratio");
  run({.by = 0.05, .speed = 0.01, .torque = 5});
  EXPECT_NE(failure_.find("it would go to 65.0 mm, outside limits.position 0.0 mm to 40.0 mm"), std::string::npos)
      << failure_;
  is_blocked_ = true;
  run({.by = 0.005, .speed = 0.01, .torque = 5}, seconds(60));
  EXPECT_TRUE(failure_.starts_with("strayed -2.0 mm from where it was led")) << failure_;
  EXPECT_EQ(device_->state(), simulation::DeviceState::disabled);
}

const auto kNothing = [](config::Drive&) {};
const auto kTwiceTheCounts = [](config::Drive& drive) { drive.counts_per_turn = 8192; };

// A CiA 402 drive with twice the counts that the file says moves half as far; what its driver makes a velocity of are
// those very positions.
TEST_F(Jog, AScaleThatTheDriveItselfHasOtherwiseIsNamed) {
  replace_drive(kNothing, kTwiceTheCounts);
  run({.by = 0.1, .speed = 0.2, .torque = 1}, seconds(30));
  EXPECT_EQ(failure_, "");
  EXPECT_NEAR(q_, 0.35, 0.01) << "truly half of it";
  ASSERT_TRUE(own_.has_value());
  EXPECT_EQ(own_->verdict, OwnScale::Verdict::wrong);
  EXPECT_EQ(
      own_->sentence,
      "the drive has 8192 counts per motor turn (6092, 6091), the robot file says counts_per_turn 4096: the joint "
      "moves 0.5 times as far");
}

TEST_F(Jog, AScaleThatTheDriveItselfHasIsJudged) {
  replace_drive(kNothing, kNothing);
  run({.by = 0.1, .speed = 0.2, .torque = 1}, seconds(30));
  EXPECT_EQ(failure_, "");
  ASSERT_TRUE(own_.has_value());
  EXPECT_EQ(own_->verdict, OwnScale::Verdict::right) << own_->sentence;
  EXPECT_EQ(believed_, "");
  EXPECT_EQ(velocity_.verdict, VelocityScale::Verdict::right) << velocity_.sentence;
}

TEST_F(Jog, AScaleThatOnlyTheFileSaysIsNotJudged) {
  replace_drive(kNothing, kTwiceTheCounts, [](simulation::Cia402Profile& profile) {
    profile.encoder.reset();
    profile.feed.reset();
    profile.velocity_unit.reset();
  });
  run({.by = 0.1, .speed = 0.2, .torque = 1}, seconds(30));
  EXPECT_EQ(failure_, "");
  ASSERT_TRUE(own_.has_value());
  EXPECT_EQ(own_->verdict, OwnScale::Verdict::not_judged);
  EXPECT_EQ(believed_, "counts_per_turn");
  EXPECT_EQ(velocity_.verdict, VelocityScale::Verdict::not_judged) << velocity_.scale;
}

// Turns per minute are no counts: a drive that tells them measures the counts of one that tells no encoder.
TEST_F(Jog, AVelocityInTurnsPerMinuteMeasuresTheCounts) {
  replace_drive(kNothing, kTwiceTheCounts, [](simulation::Cia402Profile& profile) {
    profile.encoder.reset();
    profile.feed.reset();
    profile.speed_counts = 60'000;
    profile.velocity_unit = 0xFDB4'4700;
  });
  run({.by = 0.15, .speed = 0.2, .torque = 1}, seconds(30));
  EXPECT_EQ(failure_, "");
  EXPECT_EQ(velocity_.verdict, VelocityScale::Verdict::wrong) << velocity_.scale << velocity_.sentence;
  EXPECT_NEAR(velocity_.scale, 2, 0.1);
  EXPECT_NE(velocity_.sentence.find("counts_per_turn"), std::string::npos) << velocity_.sentence;
}

// A gear that is not there: everything that the drive tells goes with it.
TEST_F(Jog, AGearIsForAnEyeToJudge) {
  run({.by = 0.1, .speed = 0.2, .torque = 1});
  EXPECT_EQ(believed_, "");
  robot_.joints[3].drive.gear_ratio = 3;
  driver_ = drivers::make_joint_driver(robot_, 3).value();
  run({.by = 0.1, .speed = 0.2, .torque = 1}, seconds(60));
  EXPECT_EQ(believed_, "gear_ratio");
}

// The drive packs its velocity into four fifths of the range that the file says.
TEST_F(Jog, AVelocityOfAnotherRangeIsNamed) {
  config::Drive& drive = robot_.joints[3].drive;
  drive.variant = "tmotor";  // a Damiao drive would tell its range, and be refused
  drive.watchdog_waiver = "a bench";
  driver_ = drivers::make_joint_driver(robot_, 3).value();
  config::Drive other = drive;
  other.velocity_range *= 0.8;
  device_ = simulation::make_device(other, milliseconds(100));
  simulation::Frames said;
  device_->update({gear_ * q_, gear_ * dq_}, now_, {}, said);
  run({.by = 0.15, .speed = 0.2, .torque = 1});
  EXPECT_EQ(velocity_.verdict, VelocityScale::Verdict::wrong) << velocity_.scale;
  EXPECT_NE(velocity_.sentence.find("range"), std::string::npos) << velocity_.sentence;
}

TEST_F(Jog, NeverPullsHarderThanTold) {
  is_blocked_ = true;
  run({.by = -1, .speed = 0.5, .torque = 0.5});
  EXPECT_GT(most_torque_, 0.4);
  EXPECT_LT(most_torque_, 0.53) << "the packed fields' quanta aside";
  EXPECT_NE(failure_.find("strayed"), std::string::npos) << failure_;
  EXPECT_NEAR(moved_, 0, 1e-3);
}

// Goal: what cannot be done as asked is refused, not done in part. Method: from inside beyond the limit; from outside,
// where the way in is free.
TEST_F(Jog, ATargetBeyondTheLimitsIsRefusedAndNothingMoves) {
  q_ = joint().limits.q_max - 0.1;
  const double before = q_;
  run({.by = 8.7, .speed = 1, .torque = 2});
  EXPECT_NE(failure_.find("outside limits.position"), std::string::npos) << failure_;
  EXPECT_EQ(q_, before);
  EXPECT_EQ(most_torque_, 0) << "not even enabled";
}

TEST_F(Jog, FromOutsideItsLimitsTheWayInIsFree) {
  q_ = joint().limits.q_max + 0.1;
  run({.by = -0.15, .speed = 0.2, .torque = 1});
  EXPECT_EQ(failure_, "");
  EXPECT_NEAR(moved_, -0.15, 0.01);
}

// Goal: a loaded joint goes where it is led, either way; one that is not carried is released before it went far.
// Method: 3 Nm on a joint that is pulled by 1 Nm at most, with and without a model that knows of them.
TEST_F(Jog, GravityIsCarriedByTheModelEitherWay) {
  load_ = -3;
  gravity_ = [] { return std::optional(3.0); };
  for (const double by : {0.1, -0.1}) {
    run({.by = by, .speed = 0.2, .torque = 1}, now_ - MonoTime{} + seconds(20));
    EXPECT_EQ(failure_, "") << by;
    EXPECT_NEAR(moved_, by, 0.01) << by;
  }
}

TEST_F(Jog, AJointThatFallsIsLetGoWithinTwoDegreesAndSaysSo) {
  load_ = -3;
  run({.by = 0.1, .speed = 0.2, .torque = 1});
  EXPECT_NE(failure_.find("strayed -2."), std::string::npos) << failure_;
  EXPECT_EQ(device_->state(), simulation::DeviceState::disabled);
  EXPECT_GT(moved_, -0.06);
}

TEST_F(Jog, WithoutThePositionsThatGravityDependsOnNothingIsEnabled) {
  gravity_ = []() -> std::optional<double> { return std::nullopt; };
  run({.by = 0.1, .speed = 0.2, .torque = 1});
  EXPECT_NE(failure_.find("gravity is not known"), std::string::npos) << failure_;
  EXPECT_EQ(most_torque_, 0);
}

// Blocked within the two degrees that a jog may stray.
TEST_F(Jog, AStepThatWasNotTakenIsAFailure) {
  is_blocked_ = true;
  run({.by = 0.02, .speed = 0.2, .torque = 0.2});
  EXPECT_NE(failure_.find("moved 0.0 deg instead of 1.1 deg"), std::string::npos) << failure_;
}

// Motor and encoder disagree about which way is forward: the drive runs away from where it is led.
TEST_F(Jog, AMotorThatTurnsAgainstItsEncoderIsLetGoAndSaysSo) {
  is_wired_backwards_ = true;
  run({.by = 0.1, .speed = 0.2, .torque = 1});
  EXPECT_NE(failure_.find("strayed -"), std::string::npos) << failure_;
  EXPECT_NE(failure_.find("turning the wrong way"), std::string::npos) << failure_;
  EXPECT_GT(q_, 0.3 - 0.2) << "let go before it went far";
}

// A direction that the robot file has wrong agrees with itself: it shows in which way the joint went, to who looks.
TEST_F(Jog, AWrongDirectionInTheFileMovesTheJointTheOtherWay) {
  robot_.joints[3].drive.direction *= -1;
  driver_ = drivers::make_joint_driver(robot_, 3).value();
  run({.by = 0.1, .speed = 0.2, .torque = 1});
  EXPECT_EQ(failure_, "");
  EXPECT_NEAR(moved_, 0.1, 0.01) << "as the file counts";
  EXPECT_NEAR(q_, 0.2, 0.01) << "in truth";
}

TEST_F(Jog, SaysWhenNobodyAnswers) {
  is_there_ = false;
  run({.by = 0.1, .speed = 0.2, .torque = 1});
  EXPECT_EQ(failure_, "no answer from its drive: is it powered, and are id and bus right?");
}

// A drive that answers every question and refuses its set-up reports no position.
TEST_F(Jog, SaysWhatADriveRefusesThatReportsNothing) {
  config::Drive& drive = robot_.joints[3].drive;
  drive.protocol = config::DriveProtocol::cia402;
  drive.mode = config::Cia402Mode::cst;
  drive.id = 5;
  drive.counts_per_turn = 4096;
  drive.rated_torque = drive.torque_range = 10;
  driver_ = drivers::make_joint_driver(robot_, 3).value();
  config::Drive other = drive;
  other.rated_torque = 12;
  device_ = simulation::make_device(other, milliseconds(100));
  simulation::Frames said;
  device_->update({gear_ * q_, gear_ * dq_}, now_, {}, said);
  run({.by = 0.1, .speed = 0.2, .torque = 1});
  EXPECT_NE(failure_.find("its drive does not get ready: the drive's own settings differ from the robot file: object "
                          "6076:00"),
            std::string::npos)
      << failure_;
}

TEST_F(Jog, SaysWhatTheDriveReports) {
  fault_ = simulation::DeviceFault::over_current;
  run({.by = 0.1, .speed = 0.2, .torque = 1});
  EXPECT_EQ(failure_, "its drive reports over-current");
  EXPECT_NE(device_->state(), simulation::DeviceState::enabled);
}

TEST_F(Jog, CanBeStoppedAtAnyTime) {
  JointJog jog(joint(), {.by = 1, .speed = 0.1, .torque = 1}, *driver_);
  for (int ms = 0; ms < 1000; ++ms) step(jog);
  EXPECT_EQ(jog.phase(), JointJog::Phase::moving);
  jog.stop();
  for (int ms = 0; ms < 200; ++ms) step(jog);
  EXPECT_TRUE(jog.ended());
  EXPECT_EQ(jog.failure(), "");
  EXPECT_EQ(device_->state(), simulation::DeviceState::disabled);
}

}  // namespace
}  // namespace takt::commissioning
