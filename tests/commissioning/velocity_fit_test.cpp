// SPDX-License-Identifier: Apache-2.0
// Goal: a velocity that does not belong to its position is named, with what it most likely is; a right one never is.
// Method: a move of some degrees between two rests, read every millisecond, with noise, offset, coarse steps, lost
// readings and wrong units.
#include "commissioning/velocity_fit.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace takt::commissioning {
namespace {

using Verdict = VelocityScale::Verdict;

struct Move {
  double by = 0.0873;     // rad, 5 degrees
  double speed = 0.1745;  // rad/s, 10 degrees per second
  std::function<double(double dq)> reported = [](double dq) { return dq; };
  std::function<bool(int reading)> is_lost = [](int) { return false; };
  double step = 0;  // rad/s
  config::JointKind kind = config::JointKind::hinge;
};

VelocityScale judged(const Move& move) {
  VelocityFit fit(move.step, move.kind);
  const double way = std::abs(move.by) / move.speed;
  for (int ms = 0; ms < static_cast<int>(1000 * way) + 700; ++ms) {
    const double t = ms * 1e-3 - 0.2;
    const bool moving = t > 0 && t < way;
    const double q = 0.4 + move.by * std::clamp(t / way, 0.0, 1.0);
    const double dq = moving ? std::copysign(move.speed, move.by) : 0;
    if (!move.is_lost(ms)) fit.take(MonoTime{} + milliseconds(1000 + ms), q, move.reported(dq));
  }
  return fit.judge();
}

double stepped(double value, double step) {
  return std::round(value / step) * step;
}

TEST(VelocityFit, AVelocityThatBelongsToItsPositionIsRight) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 0.05);
  EXPECT_EQ(judged({}).verdict, Verdict::right);
  EXPECT_EQ(judged({.by = -0.2}).verdict, Verdict::right);
  const VelocityScale noisy = judged({.by = 0.2, .reported = [&](double dq) { return dq + noise(random); }});
  EXPECT_EQ(noisy.verdict, Verdict::right) << noisy.sentence;
  EXPECT_EQ(judged({.reported = [](double dq) { return dq + 0.011; }}).verdict, Verdict::right) << "no exact zero";
  EXPECT_EQ(judged({.is_lost = [](int reading) { return reading % 7 < 3; }}).verdict, Verdict::right);
}

// MIT drives: 12 bits over +-45 rad/s.
TEST(VelocityFit, CoarseStepsWidenWhatCountsAsRightAndAreTold) {
  constexpr double kStep = 90.0 / 4095;
  for (const double speed : {0.12, 0.16, 0.1745, 0.21, 0.25, 0.3}) {
    const VelocityScale right =
        judged({.speed = speed, .reported = [](double dq) { return stepped(dq, kStep); }, .step = kStep});
    EXPECT_EQ(right.verdict, Verdict::right) << speed << ": " << right.sentence;
    EXPECT_GT(right.uncertainty, 0.01);
  }
  const VelocityScale slow =
      judged({.speed = 0.03, .reported = [](double dq) { return stepped(dq, kStep); }, .step = kStep});
  EXPECT_EQ(slow.verdict, Verdict::not_judged);
  EXPECT_NE(slow.sentence.find("jog faster"), std::string::npos) << slow.sentence;
}

TEST(VelocityFit, WrongScalesAreNamedWithTheirLikeliestReason) {
  struct Row {
    double factor;  // reported over true
    const char* reason;
  };
  constexpr double kRpm = 60 / (2 * std::numbers::pi);
  for (const Row& row : {Row{kRpm, "revolutions per minute"}, Row{1 / kRpm, "revolutions per minute"},
                         Row{6.0, "gear ratio"}, Row{1 / 6.0, "gear ratio"}, Row{45.0 / 50, "range"},
                         Row{33.0 / 50, "range"}, Row{1.05, "range"}, Row{-1.0, "sign"}}) {
    const VelocityScale found = judged({.reported = [&](double dq) { return row.factor * dq; }});
    EXPECT_EQ(found.verdict, Verdict::wrong) << row.factor;
    EXPECT_NEAR(found.scale, 1 / row.factor, 0.02 / std::abs(row.factor)) << row.factor;
    EXPECT_NE(found.sentence.find(row.reason), std::string::npos) << found.sentence;
  }
}

// Goal: a slide is judged over millimetres, and said so. Method: 5 mm at 10 mm/s, right, in revolutions per minute, in
// coarse steps, and too little of it.
TEST(VelocityFit, OfASlideItIsInMillimetres) {
  const Move move{.by = 0.005, .speed = 0.01, .kind = config::JointKind::slide};
  EXPECT_EQ(judged(move).verdict, Verdict::right) << judged(move).sentence;
  Move wrong = move;
  wrong.reported = [](double dq) { return dq * 60 / (2 * std::numbers::pi); };
  EXPECT_EQ(judged(wrong).verdict, Verdict::wrong);
  Move coarse = move;
  coarse.step = 0.008;
  EXPECT_EQ(judged(coarse).sentence, "the velocity's scale is not judged: it comes in steps of 8.000 mm/s: jog faster");
  Move little = move;
  little.by = 0.0009;
  EXPECT_NE(judged(little).sentence.find("readings over 0.9 mm are too few"), std::string::npos);
}

TEST(VelocityFit, TooLittleIsNotJudged) {
  EXPECT_EQ(judged({.by = 0.01}).verdict, Verdict::not_judged);
  EXPECT_EQ(judged({.is_lost = [](int reading) { return reading % 30 != 0; }}).verdict, Verdict::not_judged);
  EXPECT_NE(judged({.reported = [](double) { return 0.0; }}).sentence.find("reports none"), std::string::npos);
  const VelocityFit empty(0);
  EXPECT_EQ(empty.judge().verdict, Verdict::not_judged);
}

// Goal: a computer that paused while the joint sped up does not call the drive's velocity wrong. Method: readings of 30
// ms are missing around the start and the end, where the integral is off by half of what the velocity changed by.
TEST(VelocityFit, WhatNobodySawWidensWhatCountsAsRight) {
  for (const int from : {172, 180, 190, 199}) {
    const VelocityScale found =
        judged({.by = 0.0524, .is_lost = [&](int reading) { return reading > from && reading < from + 30; }});
    EXPECT_EQ(found.verdict, Verdict::right) << from << ": " << found.sentence;
    const VelocityScale rpm = judged({.by = 0.0524,
                                      .reported = [](double dq) { return 9.55 * dq; },
                                      .is_lost = [&](int reading) { return reading > from && reading < from + 30; }});
    EXPECT_EQ(rpm.verdict, Verdict::wrong) << from;
  }
  const VelocityScale blind =
      judged({.by = 0.021, .speed = 0.35, .is_lost = [](int reading) { return reading % 45 > 1; }});
  EXPECT_EQ(blind.verdict, Verdict::not_judged);
}

TEST(VelocityFit, AfterALongGapItBeginsAnew) {
  const VelocityScale found = judged({.by = 0.2,
                                      .reported = [](double dq) { return 2.5 * dq; },
                                      .is_lost = [](int reading) { return reading > 400 && reading < 500; }});
  EXPECT_EQ(found.verdict, Verdict::wrong);
  EXPECT_NEAR(found.scale, 0.4, 0.01);
}

}  // namespace
}  // namespace takt::commissioning
