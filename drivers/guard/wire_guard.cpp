// SPDX-License-Identifier: Apache-2.0
#include "drivers/guard/wire_guard.hpp"

#include "drivers/guard/decoders.hpp"
#include "drivers/guard/judge.hpp"
#include "drivers/guard/replace.hpp"

namespace takt::drivers {
namespace {

guard::Demand read(const guard::JointFacts& facts, const CanFrame& frame) noexcept {
  switch (facts.protocol) {
    case config::DriveProtocol::mit:
      return guard::read_mit(facts, frame);
    case config::DriveProtocol::robstride:
      return guard::read_robstride(facts, frame);
    case config::DriveProtocol::odrive:
      return guard::read_odrive(facts, frame);
    case config::DriveProtocol::moteus:
      return guard::read_moteus(facts, frame);
    case config::DriveProtocol::cia402:
      return guard::read_cia402(facts, frame);
  }
  return {};
}

}  // namespace

WireGuard::WireGuard(const config::RobotConfig& robot) : feedback_timeout_(robot.feedback.timeout) {
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    const guard::JointFacts facts = guard::facts_of(robot, joint);
    joints_.push_back({facts, {}, facts.offset});
  }
}

WireVerdict WireGuard::pass(std::size_t joint, std::size_t bus, const GuardedMoment& moment, const JointRecord& record,
                            CanFrame& frame) noexcept {
  auto& [facts, last, offset] = joints_[joint];
  facts.offset = offset + moment.shift;
  const MonoTime sensed = record.feedback.received_at;
  const bool heard = sensed.is_set() && moment.decided_at - sensed <= feedback_timeout_;
  const guard::Demand demand = bus == facts.bus ? read(facts, frame) : guard::Demand{};
  const WireVerdict verdict = guard::judge(
      facts, demand, {moment.decided_at, moment.now, moment.valid_until, moment.enabled, heard}, record, last);
  if (verdict == WireVerdict::allowed) return verdict;
  if (moment.enabled) {
    frame = guard::damping_frame(facts, record, heard, last);
  } else {
    frame = guard::disable_frame(facts);
    last = {};
  }
  return verdict;
}

}  // namespace takt::drivers
