// SPDX-License-Identifier: Apache-2.0
// One joint before the guard: a robot of every protocol, and a record that says what the tick decided.
#pragma once

#include <optional>
#include <string_view>

#include "config/load.hpp"
#include "drivers/guard/wire_guard.hpp"
#include "tests/drivers/bus/frame_text.hpp"

namespace takt::drivers::test {

inline config::RobotConfig every_protocol() {
  return config::load("config/dual_arm12.yaml").value();
}

inline std::size_t joint_named(const config::RobotConfig& robot, std::string_view name) {
  for (std::size_t joint = 0; joint < robot.joints.size(); ++joint)
    if (robot.joints[joint].name == name) return joint;
  throw std::out_of_range("no such joint");
}

inline constexpr MonoTime kDecided{1'000'000'000};

// What one joint's tick decided, and when; everything young and enabled unless a test says otherwise.
struct Decision {
  float q = 0, dq = 0, kp = 0, kd = 0, tau = 0;
  float at_q = 0, at_dq = 0;      // the estimate, and the feedback
  std::optional<float> own_dq{};  // what the drive says of its speed, where that is not the estimate
  Duration feedback_age = milliseconds(1);
  GuardedMoment moment{kDecided, kDecided + microseconds(50), kDecided + milliseconds(100), true};

  [[nodiscard]] JointRecord record() const {
    JointRecord record;
    record.feedback.received_at = moment.decided_at - feedback_age;
    record.feedback.q = record.q_estimate = at_q;
    record.dq_estimate = at_dq;
    record.feedback.dq = own_dq.value_or(at_dq);
    record.q_command = q;
    record.dq_command = dq;
    record.kp_command = kp;
    record.kd_command = kd;
    record.tau_command = tau;
    return record;
  }
};

class GuardBench {
 public:
  explicit GuardBench(std::string_view joint, const config::RobotConfig& from = every_protocol())
      : robot(from), joint_(joint_named(robot, joint)), guard(robot) {}

  WireVerdict pass(const CanFrame& frame, const Decision& decision = {}) {
    left = frame;
    return guard.pass(joint_, robot.joints[joint_].bus, decision.moment, decision.record(), left);
  }
  WireVerdict pass(std::uint32_t id, std::string_view bytes, const Decision& decision = {}) {
    return pass(takt::test::frame_of(id, bytes, is_fd(), is_extended()), decision);
  }
  [[nodiscard]] const config::Joint& joint() const { return robot.joints[joint_]; }

  config::RobotConfig robot;

 private:
  [[nodiscard]] bool is_fd() const { return joint().drive.protocol == config::DriveProtocol::moteus; }
  [[nodiscard]] bool is_extended() const {
    return is_fd() || joint().drive.protocol == config::DriveProtocol::robstride;
  }
  std::size_t joint_;

 public:
  WireGuard guard;
  CanFrame left;  // what may leave after pass()
};

}  // namespace takt::drivers::test
