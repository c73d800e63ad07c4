// Goal: an impedance command becomes the number that the mode's header table promises, and torque never leaves its
// range. Method: numbers worked out by hand; random and hostile commands against the range.
#include "drivers/protocol/cia402/cia402_law.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace takt::drivers::cia402 {
namespace {

using config::Cia402Mode;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();

// 10 Nm rated, 3 Nm asked for at most; 4096 counts per turn.
Scale scale(Cia402Mode mode) {
  return {.mode = mode, .counts_per_turn = 4096, .rated_torque = 10, .most_per_mille = 300, .velocity_limit = 4};
}

TEST(Cia402Law, TorqueIsTheImpedanceLawInPerMille) {
  const Scale cst = scale(Cia402Mode::cst);
  // 2 (0.5 - 0.25) + 0.5 (1 - 3) + 0.25 = -0.25 Nm of 10.
  const Measured measured{.counts = 0, .q = 0.25F, .dq = 3};
  EXPECT_EQ(target_of(cst, {.q = 0.5F, .dq = 1, .kp = 2, .kd = 0.5F, .tau = 0.25F}, measured), -25);
  EXPECT_EQ(target_of(cst, {.tau = -1.25F}, {}), -125);
  EXPECT_EQ(target_of(cst, {.tau = 0.0149F}, {}), 1) << "rounded to the nearest";
  EXPECT_EQ(target_of(cst, {.tau = 0.0151F}, {}), 2);
  EXPECT_EQ(target_of(cst, {.tau = 3.1F}, {}), 300);
  EXPECT_EQ(target_of(cst, {.tau = -99}, {}), -300);
  EXPECT_EQ(resting_target(cst, measured), 0);
}

TEST(Cia402Law, TorqueNeverLeavesItsRange) {
  EXPECT_TRUE(rc::check([](float q, float dq, float kp, float kd, float tau, float measured_q, float measured_dq) {
    const auto hostile = [](float x) {
      return *rc::gen::element(x, x, kNan, kInf, -kInf, std::numeric_limits<float>::max(), 1e30F, -1e30F, 0.0F);
    };
    const auto most = *rc::gen::inRange<std::int16_t>(0, 32767);
    Scale cst = scale(Cia402Mode::cst);
    cst.most_per_mille = most;
    cst.rated_torque = *rc::gen::element(1e-6F, 0.5F, 10.0F, 4e6F);
    const DriveSetpoint setpoint{hostile(q), hostile(dq), hostile(kp), hostile(kd), hostile(tau)};
    const std::int32_t target = target_of(cst, setpoint, {.counts = 0, .q = measured_q, .dq = measured_dq});
    RC_ASSERT(std::abs(target) <= most);
    const bool finite = std::isfinite(setpoint.q) && std::isfinite(setpoint.dq) && std::isfinite(setpoint.kp) &&
                        std::isfinite(setpoint.kd) && std::isfinite(setpoint.tau);
    if (!finite) RC_ASSERT(target == 0);
  }));
}

TEST(Cia402Law, PositionNeedsStiffness) {
  const Scale csp = scale(Cia402Mode::csp);
  const Measured measured{.counts = 777, .q = 1.19F, .dq = 2};
  const auto quarter = static_cast<float>(std::numbers::pi / 2);
  EXPECT_EQ(target_of(csp, {.q = quarter, .kp = 1}, measured), 1024);
  EXPECT_EQ(target_of(csp, {.q = -quarter, .kp = 500, .tau = 9}, measured), -1024);
  EXPECT_EQ(target_of(csp, {.q = quarter, .kd = 5, .tau = 9}, measured), 777) << "damping alone holds nothing";
  EXPECT_EQ(target_of(csp, {.q = kNan, .kp = 1}, measured), 777);
  EXPECT_EQ(target_of(csp, {.q = quarter, .kp = kInf}, measured), 777);
  EXPECT_EQ(resting_target(csp, measured), 777);
}

TEST(Cia402Law, VelocityClosesErrorsAtTheRatioOfTheGains) {
  const Scale csv = scale(Cia402Mode::csv);
  const double counts_per_rad = 4096 / (2 * std::numbers::pi);
  const Measured measured{.counts = 5, .q = 0.5F, .dq = 1};
  // 0.25 + 10 / 2 (0.7 - 0.5) = 1.25 rad/s.
  EXPECT_EQ(target_of(csv, {.q = 0.7F, .dq = 0.25F, .kp = 10, .kd = 2}, measured), std::lround(1.25 * counts_per_rad));
  EXPECT_EQ(target_of(csv, {.q = 99, .kp = 10, .kd = 2}, measured), std::lround(4 * counts_per_rad)) << "limit";
  EXPECT_EQ(target_of(csv, {.q = -99, .kp = 10, .kd = 2}, measured), std::lround(-4 * counts_per_rad));
  EXPECT_EQ(target_of(csv, {.q = 99, .dq = 3, .kp = 10}, measured), 0) << "no damping was asked for";
  EXPECT_EQ(target_of(csv, {.q = 99, .kd = 3}, measured), 0) << "a damped stop";
  EXPECT_EQ(target_of(csv, {.q = 1, .kp = 1e30F, .kd = 1e-30F}, measured), 0) << "overflow";
  EXPECT_EQ(target_of(csv, {.q = kNan, .kp = 10, .kd = 2}, measured), 0);
  EXPECT_EQ(resting_target(csv, measured), 0);
}

TEST(Cia402Law, CountsSaturateAndComeBack) {
  Scale fine = scale(Cia402Mode::csp);
  fine.counts_per_turn = 1 << 30;
  EXPECT_EQ(to_counts(100, fine), std::numeric_limits<std::int32_t>::max());
  EXPECT_EQ(to_counts(-100, fine), std::numeric_limits<std::int32_t>::min());
  EXPECT_EQ(to_counts(1e300, fine), std::numeric_limits<std::int32_t>::max());
  EXPECT_TRUE(rc::check([&fine](std::int32_t counts) { RC_ASSERT(to_counts(to_rad(counts, fine), fine) == counts); }));
}

}  // namespace
}  // namespace takt::drivers::cia402
