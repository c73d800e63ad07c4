// SPDX-License-Identifier: Apache-2.0
#include "commissioning/velocity_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "drivers/protocol/shown_unit.hpp"

namespace takt::commissioning {
namespace {

constexpr double kRpmPerRadPerSecond = 60 / (2 * std::numbers::pi);
constexpr double kWorstKnown = 0.25;  // share: below that a scale says little

std::string decimal(double value, int places) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.*f", places, value);
  return text.data();
}

std::string likely_reason(double scale) {
  const auto is_near = [scale](double known) { return std::abs(scale / known - 1) < 0.1; };
  if (scale < 0) return "its sign is the opposite of the position's: `direction` of only one of the two";
  if (is_near(1 / kRpmPerRadPerSecond) || is_near(kRpmPerRadPerSecond))
    return "revolutions per minute and rad/s are mixed up: velocity_unit";
  if (scale < 0.5 || scale > 2)
    return "one of them is of the motor's side: the gear ratio, of this file or in the drive";
  return "the velocity's range in this file is not the drive's: read its register, or write it there";
}

}  // namespace

void VelocityFit::begin(MonoTime at, double q, double dq) {
  *this = VelocityFit(step_, kind_);
  first_at_ = last_at_ = at;
  first_q_ = low_q_ = high_q_ = q;
  last_dq_ = dq;
}

void VelocityFit::take(MonoTime received_at, double q, double dq) {
  if (!received_at.is_set() || received_at <= last_at_) return;
  if (!first_at_.is_set() || received_at - last_at_ > kLongestGap) return begin(received_at, q, dq);
  const Duration gap = received_at - last_at_;
  integral_ += (dq + last_dq_) / 2 * gap.seconds();
  if (gap > kUsualGap) unseen_ += std::abs(dq - last_dq_) / 2 * gap.seconds();
  low_q_ = std::min(low_q_, q);
  high_q_ = std::max(high_q_, q);
  fastest_ = std::max(fastest_, std::abs(dq));
  last_at_ = received_at;
  last_dq_ = dq;
  add((received_at - first_at_).seconds(), integral_, q - first_q_);
}

void VelocityFit::add(double t, double integral, double q) {
  n_ += 1;
  t_ += t;
  i_ += integral;
  q_ += q;
  tt_ += t * t;
  ti_ += t * integral;
  tq_ += t * q;
  ii_ += integral * integral;
  iq_ += integral * q;
}

VelocityScale VelocityFit::judge() const {
  VelocityScale found;
  const double moved = high_q_ - low_q_;
  const bool slides = kind_ == config::JointKind::slide;
  if (n_ < kLeastReadings || moved < (slides ? kLeastSlide : kLeastMotion)) {
    found.sentence = "the velocity's scale is not judged: " + decimal(n_, 0) + " readings over " +
                     drivers::shown(kind_, moved) + " are too few";
    return found;
  }
  const double tt = tt_ - t_ * t_ / n_, ti = ti_ - t_ * i_ / n_, ii = ii_ - i_ * i_ / n_;
  const double tq = tq_ - t_ * q_ / n_, iq = iq_ - i_ * q_ / n_;
  const double determinant = tt * ii - ti * ti;
  if (fastest_ == 0 || determinant <= 1e-6 * tt * ii) {
    found.sentence = fastest_ == 0
                         ? "the velocity's scale is not judged: the drive reports none"
                         : "the velocity's scale is not judged: it reports the same speed at rest and on the way";
    return found;
  }
  const double scale = (tt * iq - ti * tq) / determinant;
  const double integrated = moved / std::max(std::abs(scale), 1e-9);
  const double mean_speed = integrated / (last_at_ - first_at_).seconds();
  const double by_steps = step_ / 2 / std::max(mean_speed, fastest_ / 2), by_gaps = unseen_ / integrated;
  found.uncertainty = by_steps + by_gaps;
  if (found.uncertainty > kWorstKnown) {
    found.sentence = by_steps > by_gaps ? "the velocity's scale is not judged: it comes in steps of " +
                                              (slides ? decimal(step_ / drivers::kMillimetre, 3) + " mm/s"
                                                      : decimal(step_, 3) + " rad/s") +
                                              ": jog faster"
                                        : "the velocity's scale is not judged: readings are missing while it changed: "
                                          "jog again, on a quieter computer";
    return found;
  }
  found.scale = scale;
  const bool right = std::abs(scale - 1) <= kTolerance + found.uncertainty;
  found.verdict = right ? VelocityScale::Verdict::right : VelocityScale::Verdict::wrong;
  if (!right)
    found.sentence = "the drive's position changes by " + decimal(scale, 3) +
                     " of what its velocity says (known within " + decimal(100 * found.uncertainty, 0) +
                     " %): " + likely_reason(scale);
  return found;
}

}  // namespace takt::commissioning
