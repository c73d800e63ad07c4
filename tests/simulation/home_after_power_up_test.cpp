// SPDX-License-Identifier: Apache-2.0
// Goal: a drive that forgets with its supply where its joint is, is enabled only once it was told, or a user made
// sure of it, and never after it may have forgotten again. Method: simulated drives of either kind and their host
// drivers in virtual time. Where the joint truly is says the rotor; what the drive counts from was written down here
// from the robot file's keys (40 deg: 9 places per turn).
#include <gtest/gtest.h>

#include <memory>
#include <numbers>
#include <span>

#include "commissioning/home_place.hpp"
#include "config/drive_presets.hpp"
#include "drivers/protocol/odrive/odrive_driver.hpp"
#include "drivers/protocol/placed_driver.hpp"
#include "tests/simulation/drive_loop.hpp"

namespace takt::simulation {
namespace {

using config::PositionAfterPowerUp;
constexpr double kStep = 2 * std::numbers::pi / 9;

config::Drive odrive() {
  config::Drive drive;
  drive.protocol = config::DriveProtocol::odrive;
  drive.id = 3;
  drive.gear_ratio = 8;
  drive.direction = -1;
  drive.torque_range = 3;
  drive.watchdog_waiver = "a bench";
  drive.position_after_power_up = PositionAfterPowerUp::unknown;
  return drive;
}

config::Drive tmotor() {
  const config::DrivePreset& preset = *config::find_drive_preset(config::DriveProtocol::mit, "AK10-9");
  config::Drive drive;
  drive.variant = "tmotor";
  drive.id = 3;
  drive.reply_id = 0x13;
  drive.position_range = preset.position;
  drive.velocity_range = preset.velocity;
  drive.torque_range = preset.torque;
  drive.kp_range = preset.kp;
  drive.kd_range = preset.kd;
  drive.watchdog_waiver = "a bench";
  drive.position_after_power_up = PositionAfterPowerUp::one_of_several;
  drive.places_per_turn = 9;
  return drive;
}

// As test::DriveLoop makes it: limits at 0.
config::Joint joint_of(const config::Drive& drive) {
  config::Joint joint;
  joint.drive = drive;
  return joint;
}

void wait(test::DriveLoop& loop, int ticks = 300) {
  for (int i = 0; i < ticks; ++i) loop.tick(false);
}

bool home_is_unknown(const test::DriveLoop& loop) {
  const JointFeedback& feedback = loop.host->feedback();
  return feedback.drive_state == DriveState::fault &&
         drivers::kind_of(feedback.error_code) == drivers::SetupFault::home_unknown;
}

bool can_be_enabled(test::DriveLoop& loop) {
  bool enabled = false;
  for (int i = 0; i < 1000 && !enabled; ++i) {
    loop.tick(true);
    enabled = loop.device->state() == DeviceState::enabled;
  }
  wait(loop);
  return enabled;
}

void tell(test::DriveLoop& loop, const config::Drive& drive, double q) {
  const auto frame = commissioning::home_frame(joint_of(drive), q);
  ASSERT_TRUE(frame);
  Frames said;
  loop.device->receive(*frame, loop.now, said);
}

// Says what it is told to have read, once a tick.
class Reading final : public drivers::JointDriver {
 public:
  explicit Reading(const float& q) : q_(q) {}
  std::size_t encode(bool, const drivers::DriveSetpoint&, MonoTime, MonoTime,
                     std::span<drivers::CanFrame>) noexcept override {
    return 0;
  }
  [[nodiscard]] bool is_set_up() const noexcept override { return true; }
  bool decode(const drivers::ReceivedFrame& received) noexcept override {
    feedback_.received_at = received.received_at;
    feedback_.q = q_;
    feedback_.drive_state = DriveState::disabled;
    ++feedback_.replies;
    return true;
  }
  [[nodiscard]] const JointFeedback& feedback() const noexcept override { return feedback_; }

 private:
  const float& q_;
  JointFeedback feedback_;
};

// Goal: what a slide may have moved without notice is of its motor, 0.05 rad. Method: a drive that counts from its
// start, on 100 rad to a metre; 0.4 mm are 0.04 rad, 0.6 mm 0.06.
TEST(HomeAfterPowerUp, OfASlideAJumpIsOfItsMotor) {
  float q = 0.02F;
  drivers::PlacedDriver placed({.per_rad = 0.01F}, std::make_unique<Reading>(q));
  placed.assume_home(q, 0.001F);
  MonoTime now{1};
  const auto is_known_at = [&](float at) {
    q = at;
    now = now + milliseconds(1);
    placed.decode({{}, now});
    return placed.feedback().error_code == 0;
  };
  EXPECT_TRUE(is_known_at(0.02F));
  EXPECT_TRUE(is_known_at(0.0204F));
  EXPECT_FALSE(is_known_at(0.0210F));
}

TEST(HomeAfterPowerUp, AnOdriveThatWasToldSaysSoByItsOwnReading) {
  test::DriveLoop loop(odrive(), milliseconds(100));
  loop.motor_q = 1.1 * -8;
  wait(loop);
  EXPECT_TRUE(home_is_unknown(loop));
  EXPECT_NEAR(loop.host->feedback().q, 0, 1e-3) << "counts from where it was switched on";
  EXPECT_FALSE(can_be_enabled(loop));
  tell(loop, odrive(), 0.02);
  wait(loop);
  EXPECT_FALSE(home_is_unknown(loop));
  EXPECT_NEAR(loop.host->feedback().q, 0.02, 1e-4);
  EXPECT_TRUE(can_be_enabled(loop));
}

// Another host's driver, which knows nothing but the drive's word: knowledge outlives the program, not the supply.
TEST(HomeAfterPowerUp, AnOdriveForgetsItWithItsSupplyAlone) {
  test::DriveLoop loop(odrive(), milliseconds(100));
  tell(loop, odrive(), 0);
  wait(loop);
  tell(loop, odrive(), 0);
  loop.host = std::move(test::DriveLoop(odrive(), milliseconds(100)).host);
  wait(loop);
  EXPECT_TRUE(can_be_enabled(loop));
  loop.device->power_cycle(loop.now);
  wait(loop, 3000);
  EXPECT_TRUE(home_is_unknown(loop));
  EXPECT_FALSE(can_be_enabled(loop));
}

// Goal: no travel since power-on looks as if the drive had been told. Method: both ends of wide limits, either
// direction.
TEST(HomeAfterPowerUp, AnOdriveThatWasNotToldNeverLooksAsIfItWas) {
  for (const int direction : {1, -1}) {
    config::Joint joint = joint_of(odrive());
    joint.drive.direction = direction;
    joint.drive.offset = 0.7;
    joint.limits.q_min = -3;
    joint.limits.q_max = 2;
    joint.limits.position_margin = 0.1;
    const auto mark = drivers::odrive_home_mark(joint);
    ASSERT_TRUE(mark);
    const double travel = 5.2 * 8 / (2 * std::numbers::pi);
    EXPECT_GT(mark->least, travel + 1) << "one turn of doubt where it began";
    for (const double q : {-3.1, 2.1}) {
      const double told = double{mark->turns} + (q - 0.7) * direction * 8 / (2 * std::numbers::pi);
      EXPECT_GT(told, double{mark->least} + 0.5) << q;
    }
  }
}

TEST(HomeAfterPowerUp, ATMotorOfSeveralPlacesNeedsSomebodysWord) {
  test::DriveLoop loop(tmotor(), milliseconds(100));
  loop.motor_q = 2 * kStep + 0.1;
  wait(loop);
  EXPECT_NEAR(loop.host->feedback().q, 0.1, 1e-3) << "two steps are forgotten";
  EXPECT_TRUE(home_is_unknown(loop));
  EXPECT_FALSE(can_be_enabled(loop));
  loop.host->assume_home(0.1F, 0.05F);
  wait(loop);
  EXPECT_FALSE(home_is_unknown(loop));
  EXPECT_TRUE(can_be_enabled(loop));
}

TEST(HomeAfterPowerUp, AWordAboutAnotherPlaceIsNone) {
  test::DriveLoop loop(tmotor(), milliseconds(100));
  loop.motor_q = 0.1;
  loop.host->assume_home(0.2F, 0.05F);
  wait(loop);
  EXPECT_TRUE(home_is_unknown(loop));
  loop.motor_q = 0.2;
  wait(loop);
  EXPECT_TRUE(home_is_unknown(loop)) << "it held for the first reading";
}

TEST(HomeAfterPowerUp, ATMotorThatFellSilentMayHaveForgotten) {
  test::DriveLoop loop(tmotor(), milliseconds(100));
  loop.host->assume_home(0, 0.05F);
  wait(loop);
  ASSERT_FALSE(home_is_unknown(loop));
  loop.device->power_cycle(loop.now);
  wait(loop, 3000);
  EXPECT_TRUE(home_is_unknown(loop));
}

// A blink that was not noticed: only what it reads differs.
TEST(HomeAfterPowerUp, ATMotorThatJumpsBySeveralStepsHasForgotten) {
  test::DriveLoop loop(tmotor(), milliseconds(100));
  loop.host->assume_home(0, 0.05F);
  wait(loop);
  ASSERT_FALSE(home_is_unknown(loop));
  loop.motor_q += kStep;
  wait(loop);
  EXPECT_TRUE(home_is_unknown(loop));
}

}  // namespace
}  // namespace takt::simulation
