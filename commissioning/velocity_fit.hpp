// SPDX-License-Identifier: Apache-2.0
// Does the velocity that a drive reports belong to its position? Fitted while a joint is moved and rests again.
//
//     q(t) - q(0) = scale * integral of dq + offset * t + constant          (least squares over the readings)
//
// A scale of 1 is right. 9.55 is revolutions per minute taken for rad/s or the other way round, a gear's ratio is a
// velocity of the motor's side, 45/50 a range that belongs to another drive. The offset takes up what a code without an
// exact zero reports at rest. How far the scale is known follows from the steps in which the velocity comes, over the
// speed that was reached, and from changes of the velocity between readings far apart, whose course is unknown. Units:
// rad, rad/s, joint side; of a slide m, m/s. Pure. Thread rule: one thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::commissioning {

struct VelocityScale {
  enum class Verdict : std::uint8_t { not_judged, right, wrong };
  Verdict verdict = Verdict::not_judged;
  double scale = 0;        // position's change over the velocity's integral; 0: not judged
  double uncertainty = 0;  // of the scale, as a share
  std::string sentence;    // why it is not judged, or what is wrong; empty: right
};

class VelocityFit {
 public:
  static constexpr double kTolerance = 0.03;                         // share
  static constexpr double kLeastMotion = 0.02, kLeastSlide = 0.001;  // rad; m
  static constexpr std::size_t kLeastReadings = 50;
  // Between two readings: within the first the velocity is taken to change evenly; one longer than the second begins
  // anew.
  static constexpr Duration kUsualGap = milliseconds(5), kLongestGap = milliseconds(50);

  // `step`: in which the velocity is reported, rad/s or m/s; 0: fine enough not to matter.
  explicit VelocityFit(double step, config::JointKind kind = config::JointKind::hinge) : step_(step), kind_(kind) {}

  // A reading with the stamp of the one before is the same one.
  void take(MonoTime received_at, double q, double dq);
  [[nodiscard]] VelocityScale judge() const;

 private:
  void begin(MonoTime at, double q, double dq);
  void add(double t, double integral, double q);

  MonoTime first_at_, last_at_;
  double first_q_ = 0, last_dq_ = 0, integral_ = 0;
  double low_q_ = 0, high_q_ = 0, fastest_ = 0, unseen_ = 0, step_;
  config::JointKind kind_;
  double n_ = 0, t_ = 0, i_ = 0, q_ = 0, tt_ = 0, ti_ = 0, tq_ = 0, ii_ = 0, iq_ = 0;
};

}  // namespace takt::commissioning
