// SPDX-License-Identifier: Apache-2.0
// Goal: the search finds the margins that a textbook loop has in closed form, and the sine fit finds a known sine.
// Method: a double integrator under proportional and derivative gain behind a dead time, whose crossovers can be solved
// for by hand; the same for a loop without a margin to find.
#include "lab/study/loop_margins.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "lab/study/injected_sine.hpp"
#include "lab/study/linear_plant.hpp"

namespace takt::study {
namespace {

using Complex = std::complex<double>;
constexpr double kPi = std::numbers::pi;

// L = (kp + kd s) exp(-s delay) / (inertia s^2)
LoopResponse textbook(double kp, double kd, double inertia, double delay) {
  return [=](double omega) {
    const Complex s(0, omega);
    return (kp + kd * s) * std::exp(-s * delay) / (inertia * s * s);
  };
}

// |L| = 1: inertia^2 w^4 - kd^2 w^2 - kp^2 = 0.
double crossover(double kp, double kd, double inertia) {
  const double half = kd * kd / (2 * inertia * inertia);
  return std::sqrt(half + std::sqrt(half * half + kp * kp / (inertia * inertia)));
}

TEST(LoopMargins, OfADoubleIntegratorWithDeadTimeAreItsClosedForm) {
  constexpr double kp = 20, kd = 2, inertia = 0.05, delay = 0.004;
  const LoopMargins found = margins_of(textbook(kp, kd, inertia, delay), {1, 3000, 300, 30});
  const double at = crossover(kp, kd, inertia);
  const double phase = std::atan(kd * at / kp) - at * delay;
  ASSERT_TRUE(found.phase_rad && found.delay_s && found.gain);
  EXPECT_NEAR(*found.crossover, at, 1e-6 * at);
  EXPECT_NEAR(*found.phase_rad, phase, 1e-6);
  EXPECT_NEAR(*found.delay_s, phase / at, 1e-9);
  // Phase -180: atan(kd w / kp) = w delay, whose root is where the gain margin lies.
  const double there = *found.gain_at;
  EXPECT_NEAR(std::atan(kd * there / kp), there * delay, 1e-6);
  EXPECT_NEAR(*found.gain, inertia * there * there / std::hypot(kp, kd * there), 1e-6);
}

TEST(LoopMargins, MoreDelayThanTheDelayMarginIsANegativePhaseMargin) {
  constexpr double kp = 20, kd = 2, inertia = 0.05;
  const LoopMargins without = margins_of(textbook(kp, kd, inertia, 0), {1, 3000, 300, 30});
  ASSERT_TRUE(without.delay_s);
  const LoopMargins less = margins_of(textbook(kp, kd, inertia, 0.99 * *without.delay_s), {1, 3000, 300, 30});
  const LoopMargins more = margins_of(textbook(kp, kd, inertia, 1.01 * *without.delay_s), {1, 3000, 300, 30});
  EXPECT_GT(*less.phase_rad, 0);
  EXPECT_LT(*more.phase_rad, 0);
}

TEST(LoopMargins, WithoutCrossingThereIsNoMargin) {
  const LoopMargins found = margins_of([](double omega) { return 0.5 / Complex(1, omega); }, {0.1, 100, 50, 10});
  EXPECT_FALSE(found.gain || found.phase_rad || found.delay_s);
}

TEST(LoopMargins, AFewMeasuredPointsAreEnough) {
  const LoopMargins fine = margins_of(textbook(20, 2, 0.05, 0.004), {1, 3000, 300, 30});
  const LoopMargins coarse = margins_of(textbook(20, 2, 0.05, 0.004), {1, 3000, 24, 3});
  EXPECT_NEAR(*coarse.phase_rad, *fine.phase_rad, 0.01 * *fine.phase_rad);
  EXPECT_NEAR(*coarse.gain, *fine.gain, 0.01 * *fine.gain);
}

TEST(SineIn, FindsTheSineBesideOffsetAndDrift) {
  constexpr double omega = 37, step_s = 1e-3;
  std::vector<double> samples;
  for (int i = 0; i < 333; ++i) {
    const double phase = omega * step_s * (i + 250);
    samples.push_back(3 * std::sin(phase) - 2 * std::cos(phase) + 5 + 0.01 * i);
  }
  const Complex found = sine_in(samples, omega, step_s, 250);
  EXPECT_NEAR(found.real(), 3, 1e-9);
  EXPECT_NEAR(found.imag(), -2, 1e-9);
}

// A pendulum and a cart that only friction holds: known stiffness, damping and inertia, and one joint without a drive.
class Known final : public simulation::Dynamics {
 public:
  void integrate(simulation::ArmState& state, const Eigen::VectorXd& tau,
                 const std::vector<simulation::Friction>& friction, Duration step) override {
    const double dt = step.seconds();
    const double pendulum = (tau[0] + 9 * std::sin(state.q[0]) - friction[0].viscous * state.dq[0]) / 0.5;
    const double passive = (-4 * state.q[1] + 2 * state.q[0] - friction[1].viscous * state.dq[1]) / 0.25;
    state.dq[0] += dt * pendulum;
    state.dq[1] += dt * passive;
    state.q += dt * state.dq;
  }
};

TEST(LinearPlant, AnyMechanicsComeOutAsTheirMatrices) {
  Known known;
  const auto plant = linearise(known, Eigen::Vector2d(0, 0), Eigen::Vector2d(0.1, 0.3));
  ASSERT_TRUE(plant) << plant.error();
  Eigen::Matrix4d a;
  a << 0, 0, 1, 0, 0, 0, 0, 1, 18, 0, -0.2, 0, 8, -16, 0, -1.2;
  EXPECT_LT((plant->a - a).cwiseAbs().maxCoeff(), 1e-4) << plant->a;
  EXPECT_NEAR(plant->b(2, 0), 2, 1e-6);
  EXPECT_NEAR(plant->b(3, 1), 0, 1e-9) << "nothing drives the second joint";
}

TEST(LinearPlant, APoseThatNothingHoldsIsRefused) {
  Known known;
  EXPECT_FALSE(linearise(known, Eigen::Vector2d(0, 0.2), Eigen::Vector2d(0, 0)));
  EXPECT_TRUE(linearise(known, Eigen::Vector2d(0.4, 0.2), Eigen::Vector2d(0, 0))) << "where the spring is at rest";
}

TEST(LinearPlant, SampledAsAHeldTorqueMovesIt) {
  Known known;
  const auto plant = linearise(known, Eigen::Vector2d(0, 0), Eigen::Vector2d(0, 0));
  ASSERT_TRUE(plant);
  const SampledPlant sampled = sample(*plant, milliseconds(10));
  // ddq = 18 q + 2 tau from rest: q = (cosh(w t) - 1) tau / 9, w^2 = 18.
  EXPECT_NEAR(sampled.gamma(0, 0), (std::cosh(std::sqrt(18.0) * 0.01) - 1) / 9, 1e-9);
}

}  // namespace
}  // namespace takt::study
