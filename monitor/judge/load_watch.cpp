// SPDX-License-Identifier: Apache-2.0
#include "monitor/judge/load_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace takt::monitor {
namespace {

constexpr Duration kRest = milliseconds(500);
constexpr float kStill = 0.02F;         // rad/s or m/s
constexpr double kMostApart = 0.2;      // of the model's torque
constexpr double kMostFriction = 0.05;  // of the joint's limit: what a gear at rest may hold by itself

}  // namespace

LoadWatch::LoadWatch(const config::RobotConfig& robot) {
  if (!robot.model || robot.imu) return;
  for (const config::Joint& joint : robot.joints) limits_.push_back({joint.limits.torque, joint.passive});
  sums_.resize(limits_.size());
}

bool LoadWatch::rests(const TickRecord& record) const {
  if (record.header.joint_count != limits_.size()) return false;
  for (std::size_t each = 0; each < limits_.size(); ++each) {
    const JointRecord& joint = record.joints[each];
    const bool is_driven = limits_[each].passive || (joint.drive_enabled != 0 && std::isfinite(joint.feedback.tau));
    if (!is_driven || !(std::abs(joint.dq_estimate) < kStill)) return false;
  }
  return true;
}

std::span<const LoadMismatch> LoadWatch::tick(const TickRecord& record) {
  found_.clear();
  if (record.header.drives_enabled == 0) judged_ = false;
  if (judged_ || limits_.empty() || !rests(record)) {
    ticks_ = 0;
    return {};
  }
  if (ticks_++ == 0) {
    rests_since_ = record.header.now;
    std::ranges::fill(sums_, Sums{});
  }
  for (std::size_t joint = 0; joint < sums_.size(); ++joint) {
    sums_[joint].measured += static_cast<double>(record.joints[joint].feedback.tau);
    sums_[joint].model += static_cast<double>(record.joints[joint].tau_gravity);
  }
  if (record.header.now - rests_since_ >= kRest) judge(record.header);
  return found_;
}

void LoadWatch::judge(const TickRecordHeader& header) {
  judged_ = true;
  for (std::size_t joint = 0; joint < sums_.size(); ++joint) {
    const double measured = sums_[joint].measured / static_cast<double>(ticks_);
    const double model = sums_[joint].model / static_cast<double>(ticks_);
    const double apart = std::abs(measured - model);
    if (limits_[joint].passive) continue;
    if (apart > kMostApart * std::abs(model) && apart > kMostFriction * limits_[joint].torque)
      found_.push_back({header.tick, header.now, joint, measured, model});
  }
}

std::string sentence_of(const LoadMismatch& mismatch, const config::RobotConfig& robot) {
  const config::Joint& joint = robot.joints[mismatch.joint];
  const std::string share =
      std::abs(mismatch.model) < 1e-6
          ? ""
          : fmt::format(" ({:+.0f} %)", 100 * (mismatch.measured - mismatch.model) / mismatch.model);
  return fmt::format(
      "joint {} holds {:.3g} {} at rest, by `model` {:.3g}{}: correct the masses, or enter what it carries; a stop "
      "carries what `model` says",
      joint.name, mismatch.measured, joint.kind == config::JointKind::slide ? "N" : "Nm", mismatch.model, share);
}

}  // namespace takt::monitor
