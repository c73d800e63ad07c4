// SPDX-License-Identifier: Apache-2.0
// arming_blockers: the one list behind the operator's arm request, the `takt arm` refusal and `takt status`.
#include <cmath>

#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/freshness.hpp"
#include "executive/pipeline/mode_machine.hpp"
#include "executive/pipeline/velocity_observer.hpp"

namespace takt::pipeline {
namespace {

class BlockerList {
 public:
  explicit BlockerList(std::span<ArmingBlocker> out) : out_(out) {}
  void add_if(bool blocked, std::string_view what, std::int32_t joint = -1, Cause cause = Cause::none) {
    if (blocked && count_ < out_.size()) out_[count_++] = {what, joint, cause};
  }
  [[nodiscard]] std::size_t count() const { return count_; }

 private:
  std::span<ArmingBlocker> out_;
  std::size_t count_ = 0;
};

std::string_view mode_blocker(Mode mode) {
  switch (mode) {
    case Mode::standby:
      return {};
    case Mode::arming:
    case Mode::tracking:
    case Mode::degraded:
      return "already armed";
    case Mode::damped_stop:
      return "in a damped stop: reset first, once the robot rests";
    case Mode::fault_latched:
      return "a fault is latched: clear it and reset first";
  }
  return "in an invalid mode";
}

// What an operator is told while no command is fresh.
std::string_view command_blocker(Arrival last_refusal) {
  switch (last_refusal) {
    case Arrival::none:
    case Arrival::accepted:
      return "no fresh command: the policy host's log says why, docs/troubleshooting.md what to do";
    case Arrival::missing_stamp:
      return "commands do not say when the outside sensors sensed: the policy's host must set outside_sensed_at";
    case Arrival::expired_observation:
    case Arrival::overtaken:
      return "no fresh command: the newest one came too late (older than freshness.max_age)";
    case Arrival::wrong_policy:
      return "no fresh command: the newest one is another policy's than the robot file's";
    case Arrival::contended:
      return "no fresh command: the newest one is written anew while it is read";
    case Arrival::corrupt:
      return "no fresh command: the newest one is corrupt";
    case Arrival::wrong_shape:
      return "no fresh command: the newest one has another number of joints or steps than the robot file says";
    case Arrival::repeated_sequence:
      return "no fresh command: the newest one repeats a sequence number";
    case Arrival::unknown_observation:
      return "no fresh command: the newest one answers an observation that was never published";
    case Arrival::future_observation:
      return "no fresh command: the newest one has a stamp of the future";
    case Arrival::not_finite:
      return "no fresh command: the newest one has a value that is not finite (NaN or infinite)";
    case Arrival::out_of_range:
      return "no fresh command: the newest one is out of its range";
  }
  return "no fresh command";
}

std::string_view fallback_blocker(Arrival last_refusal) {
  if (last_refusal == Arrival::none)
    return "no fresh command of the fallback policy: is its host running (takt-policy-host --fallback)?";
  if (is_refused_for_age(last_refusal)) return "no fresh command of the fallback policy: the newest one came too late";
  if (last_refusal == Arrival::wrong_policy)
    return "no fresh command of the fallback policy: the newest one is another policy's than the robot file's";
  return "no fresh command of the fallback policy: the newest one was refused";
}

void list_joint(const JointRecord& joint, std::int32_t index, const TickRecordHeader& header, const TickConfig& config,
                BlockerList& list) {
  const JointFeedback& feedback = joint.feedback;
  const auto replies = [&joint](ReplyFault fault) { return (joint.reply_faults & bit(fault)) != 0; };
  const bool missing = !feedback.received_at.is_set() || header.now - feedback.received_at > config.feedback_timeout ||
                       !is_plausible(feedback) || replies(ReplyFault::from_future);
  list.add_if(missing, "no recent feedback from the drive", index);
  // A drive that speaks another protocol reports nothing, and yet is known to be wrong.
  list.add_if(missing && feedback.error_code != 0, kDriveFaultBlocker, index);
  if (missing) return;
  list.add_if(replies(ReplyFault::lost), "the drive leaves commands unanswered", index);
  list.add_if(replies(ReplyFault::repeated), "more replies than commands: do two drives share the id?", index);
  list.add_if(replies(ReplyFault::delayed), "the drive's replies come late and in bunches", index);
  list.add_if(replies(ReplyFault::jumped), "its position jumped further than the joint can move: check its encoder",
              index);
  list.add_if(replies(ReplyFault::contradicts),
              "its positions contradict the drive's own velocity: check sign and scale", index);
  list.add_if(
      replies(ReplyFault::moved_unheard),
      "it reads elsewhere than before its drive fell silent: see where it stands; if that is right, takt reset; "
      "if its drive lost its zero, takt joint home or takt bus zero",
      index);
  list.add_if(replies(ReplyFault::frozen), "its position stands still while the joint moves: check its encoder", index);
  const JointLimits& limits = config.joints[static_cast<std::size_t>(index)].limits;
  list.add_if(feedback.drive_state == DriveState::unknown, "the drive is not set up yet", index);
  list.add_if(header.mode == Mode::standby && feedback.drive_state == DriveState::enabled,
              "the drive is still switching off", index);
  list.add_if(feedback.drive_state == DriveState::fault || feedback.error_code != 0, kDriveFaultBlocker, index);
  list.add_if(feedback.q < limits.q_min - limits.q_hard_margin || feedback.q > limits.q_max + limits.q_hard_margin,
              "outside its position limits: move it by hand; a simulated one is at home after a new start", index);
  list.add_if(std::abs(joint.dq_estimate) > limits.velocity, "moving too fast", index);
  const TemperatureLimits& temperature = config.joints[static_cast<std::size_t>(index)].temperature;
  const bool untold =
      (temperature.any() && feedback.temperature_C == 0) || (temperature.of_casing() && feedback.casing_C == 0);
  list.add_if(untold, "the drive tells no temperature, and limits.temperature has a limit for it", index);
}

}  // namespace

std::size_t arming_blockers(const TickRecord& latest, const TickConfig& config, std::span<ArmingBlocker> out) noexcept {
  const TickRecordHeader& header = latest.header;
  BlockerList list(out);
  const std::string_view mode = mode_blocker(header.mode);
  list.add_if(!mode.empty(), mode);
  list.add_if(!is_usable(header.seats[Seat::policy].freshness),
              command_blocker(header.seats[Seat::policy].last_refusal));
  list.add_if(has_fallback_policy(config) && !is_usable(header.seats[Seat::fallback].freshness),
              fallback_blocker(header.seats[Seat::fallback].last_refusal));
  for (const Reaction& row : kReactions)
    list.add_if(!row.blocks_arming.empty() && (header.causes_active & bit(row.cause)) != 0, row.blocks_arming, -1,
                row.cause);
  for (std::size_t j = 0; j < header.joint_count && j < config.joint_count; ++j)
    list_joint(latest.joints[j], static_cast<std::int32_t>(j), header, config, list);
  return list.count();
}

}  // namespace takt::pipeline
