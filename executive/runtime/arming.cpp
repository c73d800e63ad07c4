// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/arming.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <string_view>

#include "config/joint_units.hpp"
#include "config/units.hpp"
#include "drivers/protocol/protocol_table.hpp"
#include "executive/contract/tick_facts.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/rest_watch.hpp"

namespace takt::runtime {
namespace {

// Some causes per joint, and a few of the whole robot.
constexpr std::size_t kMaxBlockers = 8 * kMaxJoints;

std::string sentence_of(const pipeline::ArmingBlocker& blocker, const TickRecord& latest,
                        const config::RobotConfig& robot) {
  const std::vector<config::Joint>& joints = robot.joints;
  std::string what(blocker.what);
  if (blocker.joint < 0) return what;
  const auto joint = static_cast<std::size_t>(blocker.joint);
  const std::uint32_t code = latest.joints[joint].feedback.error_code;
  if (blocker.what == pipeline::kDriveFaultBlocker && code != 0 && joint < joints.size())
    what += ": " + drivers::error_text(robot, joint, code);
  return "joint " + (joint < joints.size() ? joints[joint].name : std::to_string(joint)) + ": " + what;
}

}  // namespace

std::vector<std::string> missing_for_arming(const TickRecord& latest, const pipeline::TickConfig& config,
                                            const config::RobotConfig& robot, const ArmingSituation& situation) {
  if (situation.shutting_down) return {"the executive is shutting down: start it again"};
  std::vector<std::string> sentences;
  if (!situation.realtime && !situation.allow_non_realtime) {
    sentences.emplace_back("real-time set-up is incomplete: correct it, or start with --allow-non-realtime");
  }
  if (!situation.policy_attached && !situation.policy_in_file)
    sentences.emplace_back(
        "the robot file has no `policy`: docs/first-policy.md says how; for a program docs/configuration.md");
  else if (!situation.policy_attached)
    sentences.emplace_back(latest.header.candidate.in_charge != 0
                               ? "the candidate in charge does not run: start it again, or takt policy back"
                               : "no policy is attached: takt-policy-host --robot FILE, as a service: systemctl start "
                                 "takt-policy-host@robot");
  if (latest.header.tick == 0) sentences.emplace_back("the control loop has not run yet: try again");
  std::array<pipeline::ArmingBlocker, kMaxBlockers> blockers{};
  const std::size_t count = pipeline::arming_blockers(latest, config, blockers);
  for (const auto& blocker : std::span(blockers).first(std::min(count, blockers.size()))) {
    const auto falling = situation.buses != nullptr ? situation.buses->falling(blocker.cause, robot.buses)
                                                    : std::optional<std::vector<std::string>>();
    if (falling)
      sentences.insert(sentences.end(), falling->begin(), falling->end());
    else
      sentences.push_back(sentence_of(blocker, latest, robot));
  }
  return sentences;
}

std::vector<std::string> drive_faults(const TickRecord& latest, const pipeline::TickConfig& config,
                                      const config::RobotConfig& robot) {
  std::array<pipeline::ArmingBlocker, kMaxBlockers> blockers{};
  const std::size_t count = pipeline::arming_blockers(latest, config, blockers);
  std::vector<std::string> sentences;
  for (const auto& blocker : std::span(blockers).first(std::min(count, blockers.size())))
    if (blocker.what == pipeline::kDriveFaultBlocker) sentences.push_back(sentence_of(blocker, latest, robot));
  return sentences;
}

std::string still_moves(const TickRecord& latest, JointMask asked, const pipeline::TickConfig& config,
                        const std::vector<config::Joint>& joints) {
  constexpr std::string_view kAwaitRest =
      "wait until every joint with power rests, then reset; where one never does, hold it and take the power (takt "
      "stop --now): what hangs falls";
  const auto speed = [&](std::size_t joint) { return std::abs(latest.joints[joint].dq_estimate); };
  std::optional<std::size_t> fastest;
  for (std::size_t j = 0; j < std::min<std::size_t>(latest.header.joint_count, joints.size()); ++j)
    if ((asked & bit_of_joint(j)) != 0 && (!fastest || speed(j) > speed(*fastest))) fastest = j;
  if (!fastest) return fmt::format("the robot still moves: {}", kAwaitRest);
  const config::Joint& joint = joints[*fastest];
  return fmt::format("joint {} still moves, at {:.3g} {}, and rests once below {:g} for {}: {}", joint.name,
                     speed(*fastest), config::kJointVelocity.unit(joint.kind),
                     pipeline::rest_velocity_of(config, *fastest), config::format_duration(pipeline::kRestDwell),
                     kAwaitRest);
}

std::string lack_of_observations(const TickRecord& latest, const pipeline::TickConfig& config,
                                 const config::RobotConfig& robot) {
  constexpr std::size_t kNamed = 3;
  const TickRecordHeader& header = latest.header;
  std::string joints;
  std::size_t silent = 0;
  for (std::size_t j = 0; j < std::min<std::size_t>(header.joint_count, robot.joints.size()); ++j) {
    const MonoTime heard = latest.joints[j].feedback.received_at;
    if (heard.is_set() && header.now - heard <= config.feedback_timeout) continue;
    if (++silent <= kNamed) joints += (silent == 1 ? "" : ", ") + robot.joints[j].name;
  }
  if (silent > kNamed) joints += fmt::format(" and {} more", silent - kNamed);
  if (silent == 1) return fmt::format("it gets no fresh observation: joint {} is silent", joints);
  if (silent > 1) return fmt::format("it gets no fresh observation: joints {} are silent", joints);
  const MonoTime sensed = header.imu.sensed_at;
  if (header.tick != 0 && config.imu.present && (!sensed.is_set() || header.now - sensed > config.imu.timeout))
    return fmt::format("it gets no fresh observation: sensor {} is silent", robot.imu.value_or(config::Imu{}).sensor);
  return {};
}

std::string active_causes(const TickRecordHeader& tick) {
  return fmt::format("{}", fmt::join(names_of_active_causes(tick), ", "));
}

}  // namespace takt::runtime
