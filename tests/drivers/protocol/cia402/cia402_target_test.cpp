// SPDX-License-Identifier: Apache-2.0
// Goal: a setpoint becomes the number that the mode's header table promises. Method: numbers worked out by hand;
// setpoints that are not numbers.
#include "drivers/protocol/cia402/cia402_target.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace takt::drivers::cia402 {
namespace {

using config::Cia402Mode;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

// 10 Nm rated; 4096 counts per turn.
Scale scale(Cia402Mode mode) {
  return {.mode = mode, .counts_per_turn = 4096, .speed_counts = 4096, .rated_torque = 10};
}

TEST(Cia402Target, TorqueIsTheSetpointsInPerMilleAndNothingElse) {
  const Scale cst = scale(Cia402Mode::cst);
  EXPECT_EQ(target_of(cst, {.q = 0.5F, .dq = 1, .kp = 2, .kd = 0.5F, .tau = 0.25F}, 17), 25) << "no law in here";
  EXPECT_EQ(target_of(cst, {.tau = -1.25F}, 0), -125);
  EXPECT_EQ(target_of(cst, {.tau = 20}, 0), 2000) << "twice the rated torque";
  EXPECT_EQ(target_of(cst, {.tau = 0.0149F}, 0), 1) << "rounded to the nearest";
  EXPECT_EQ(target_of(cst, {.tau = 0.0151F}, 0), 2);
  EXPECT_EQ(target_of(cst, {.tau = 1e30F}, 0), kMostPerMille) << "all that 16 bits can say";
  EXPECT_EQ(target_of(cst, {.tau = -1e30F}, 0), -kMostPerMille);
  EXPECT_EQ(resting_target(cst, 17), 0);
}

TEST(Cia402Target, NothingThatIsNotFiniteMovesAnything) {
  for (const Cia402Mode mode : {Cia402Mode::cst, Cia402Mode::csp, Cia402Mode::csv}) {
    const Scale any = scale(mode);
    for (const float odd : {kNan, kInf, -kInf})
      for (float DriveSetpoint::*part :
           {&DriveSetpoint::q, &DriveSetpoint::dq, &DriveSetpoint::kp, &DriveSetpoint::kd, &DriveSetpoint::tau}) {
        DriveSetpoint setpoint{.q = 1, .dq = 1, .kp = 1, .kd = 1, .tau = 1};
        setpoint.*part = odd;
        EXPECT_EQ(target_of(any, setpoint, 777), resting_target(any, 777));
      }
  }
}

TEST(Cia402Target, PositionNeedsStiffness) {
  const Scale csp = scale(Cia402Mode::csp);
  const auto quarter = static_cast<float>(std::numbers::pi / 2);
  EXPECT_EQ(target_of(csp, {.q = quarter, .kp = 1}, 777), 1024);
  EXPECT_EQ(target_of(csp, {.q = -quarter, .kp = 500, .tau = 9}, 777), -1024);
  EXPECT_EQ(target_of(csp, {.q = quarter, .kd = 5, .tau = 9}, 777), 777) << "damping alone holds nothing";
  EXPECT_EQ(resting_target(csp, 777), 777);
}

TEST(Cia402Target, VelocityIsTheSetpoints) {
  const Scale csv = scale(Cia402Mode::csv);
  const double counts_per_rad = 4096 / (2 * std::numbers::pi);
  EXPECT_EQ(target_of(csv, {.q = 0.7F, .dq = 1.25F, .kp = 10, .kd = 2}, 5), std::lround(1.25 * counts_per_rad));
  EXPECT_EQ(target_of(csv, {.dq = -3}, 5), std::lround(-3 * counts_per_rad));
  EXPECT_EQ(resting_target(csv, 5), 0);
  // Roboteq's manual says rpm: 1 rad/s is 9.549 rpm, and no 652 counts.
  Scale rpm = csv;
  rpm.speed_counts = 60;
  EXPECT_EQ(target_of(rpm, {.dq = 1}, 5), 10);
  EXPECT_EQ(target_of(rpm, {.dq = -100}, 5), -955);
}

TEST(Cia402Target, CountsSaturateAndComeBack) {
  Scale fine = scale(Cia402Mode::csp);
  fine.counts_per_turn = 1 << 30;
  EXPECT_EQ(to_counts(100, fine), std::numeric_limits<std::int32_t>::max());
  EXPECT_EQ(to_counts(-100, fine), std::numeric_limits<std::int32_t>::min());
  EXPECT_EQ(to_counts(1e300, fine), std::numeric_limits<std::int32_t>::max());
  EXPECT_TRUE(rc::check([&fine](std::int32_t counts) { RC_ASSERT(to_counts(to_rad(counts, fine), fine) == counts); }));
}

}  // namespace
}  // namespace takt::drivers::cia402
