// SPDX-License-Identifier: Apache-2.0
// One driver per protocol, fed by arbitrary bytes: what must hold whatever crosses the bus and whatever is asked for.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "config/drive_ids.hpp"
#include "config/robot_config.hpp"
#include "drivers/bus/can_frame.hpp"
#include "drivers/guard/wire_guard.hpp"
#include "drivers/protocol/protocol_table.hpp"

namespace takt::drivers::test {

class AbusedDriver {
 public:
  AbusedDriver(const config::RobotConfig& robot, std::size_t joint)
      : drive_(robot.joints[joint].drive),
        ids_(config::ids_of(drive_)),
        driver_(make_joint_driver(robot, joint).value()),
        guard_(robot),
        joint_(joint),
        bus_(robot.joints[joint].bus) {}

  // What is wrong; empty: nothing. What `bytes` are too few for counts as zero.
  std::string frame(std::span<const std::uint8_t> bytes) {
    ReceivedFrame received;
    received.received_at = now_ = now_ + microseconds(100);
    CanFrame& frame = received.frame;
    const std::uint8_t kind = take<std::uint8_t>(bytes);
    // Most frames carry an id that the drive answers with: others are turned away at once.
    const std::uint32_t any = take<std::uint32_t>(bytes);
    const config::IdPattern& pattern = ids_.replies[any % ids_.replies.size()];
    frame.extended = (kind & 1U) != 0 ? pattern.extended : (kind & 2U) != 0;
    frame.id = (kind & 4U) != 0 ? any : (pattern.id & pattern.mask) | (any & ~pattern.mask);
    frame.id &= frame.extended ? 0x1FFF'FFFFU : 0x7FFU;
    frame.fd = (kind & 8U) != 0;
    frame.remote = (kind & 0x70U) == 0x70U;
    constexpr std::array<std::uint8_t, 16> kLengths{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    frame.length = kLengths[take<std::uint8_t>(bytes) % (frame.fd ? 16U : 9U)];
    std::memcpy(frame.data, bytes.data(), std::min<std::size_t>(bytes.size(), frame.length));
    driver_->decode(received);
    return wrong_feedback();
  }
  std::string setpoint(bool enable, std::span<const std::uint8_t> bytes) {
    DriveSetpoint wanted;
    for (float* value : {&wanted.q, &wanted.dq, &wanted.kp, &wanted.kd, &wanted.tau}) *value = take<float>(bytes);
    std::array<CanFrame, kMaxFramesPerDrive> out;
    const std::size_t count = driver_->encode(enable, wanted, MonoTime{}, MonoTime{take<std::int64_t>(bytes)}, out);
    if (count > out.size()) return "more frames than there is room for";
    for (std::size_t i = 0; i < count; ++i) {
      if (!is_legal(out[i])) return "no CAN bus can carry frame " + std::to_string(i);
      if (!is_ours(out[i])) return "frame with an id that is not ours to send";
    }
    return {};
  }
  // Any frame before the guard: what may leave afterwards is legal, ours, and passes a second time.
  std::string guarded(bool enable, std::span<const std::uint8_t> bytes) {
    CanFrame frame;
    const std::uint8_t kind = take<std::uint8_t>(bytes);
    const std::uint32_t any = take<std::uint32_t>(bytes);
    const config::IdPattern& pattern = ids_.commands[any % ids_.commands.size()];
    frame.extended = (kind & 1U) != 0 ? pattern.extended : (kind & 2U) != 0;
    frame.id = ((kind & 4U) != 0 ? any : (pattern.id & pattern.mask) | (any & ~pattern.mask)) &
               (frame.extended ? 0x1FFF'FFFFU : 0x7FFU);
    frame.fd = frame.bit_rate_switch = (kind & 8U) != 0;
    constexpr std::array<std::uint8_t, 16> kLengths{0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};
    frame.length = kLengths[take<std::uint8_t>(bytes) % (frame.fd ? 16U : 9U)];
    JointRecord record;
    record.feedback.received_at = now_;
    record.feedback.q = record.q_estimate = take<float>(bytes);
    record.dq_estimate = take<float>(bytes);
    std::memcpy(frame.data, bytes.data(), std::min<std::size_t>(bytes.size(), frame.length));
    const GuardedMoment moment{now_, now_, (kind & 0x10U) != 0 ? now_ : MonoTime{}, enable};
    const WireVerdict verdict = guard_.pass(joint_, bus_, moment, record, frame);
    if (!is_legal(frame)) return "the guard lets a frame pass that no CAN bus can carry";
    if (!is_ours(frame)) return "the guard lets a frame pass that is not ours to send";
    if (verdict == WireVerdict::allowed) return {};
    const WireVerdict again = guard_.pass(joint_, bus_, moment, record, frame);
    return again == WireVerdict::allowed
               ? std::string()
               : "the guard refuses what it sent in place of a refused frame: " +
                     std::string(kWireVerdictNames.at(static_cast<std::size_t>(again))) + " after " +
                     std::string(kWireVerdictNames.at(static_cast<std::size_t>(verdict)));
  }
  [[nodiscard]] std::string_view name() const { return config::name(drive_.protocol); }

 private:
  template <class T>
  static T take(std::span<const std::uint8_t>& bytes) {
    T value{};
    const std::size_t size = std::min(bytes.size(), sizeof(T));
    std::memcpy(&value, bytes.data(), size);
    bytes = bytes.subspan(size);
    return value;
  }
  // A remote frame is a question, and has the id of its answer.
  [[nodiscard]] bool is_ours(const CanFrame& frame) const {
    for (const auto* patterns : {frame.remote ? &ids_.replies : &ids_.commands, &ids_.broadcasts})
      for (const config::IdPattern& one : *patterns)
        if (one.matches(frame.id, frame.extended)) return true;
    return false;
  }
  [[nodiscard]] std::string wrong_feedback() const {
    const JointFeedback& feedback = driver_->feedback();
    const bool finite = std::isfinite(feedback.q) && std::isfinite(feedback.dq) && std::isfinite(feedback.tau) &&
                        std::isfinite(feedback.temperature_C);
    return finite ? "" : "feedback that is NaN";
  }

  config::Drive drive_;
  config::DriveIds ids_;
  std::unique_ptr<JointDriver> driver_;
  WireGuard guard_;
  std::size_t joint_, bus_;
  MonoTime now_{1};
};

inline std::vector<AbusedDriver> one_of_each(const config::RobotConfig& robot) {
  std::vector<AbusedDriver> drivers;
  std::vector<std::string> seen;
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint) {
    const config::Drive& drive = robot.joints[joint].drive;
    const std::string kind = std::string(config::name(drive.protocol)) + drive.variant;
    if (std::ranges::find(seen, kind) != seen.end()) continue;
    seen.push_back(kind);
    drivers.emplace_back(robot, joint);
  }
  return drivers;
}

}  // namespace takt::drivers::test
