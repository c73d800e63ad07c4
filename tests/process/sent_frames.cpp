// SPDX-License-Identifier: Apache-2.0
#include "tests/process/sent_frames.hpp"

#include <array>
#include <cstdint>
#include <cstdlib>
#include <sstream>

#include "monitor/record/frame_log.hpp"

namespace takt::test {

namespace {

using Payload = std::array<unsigned, 8>;

constexpr unsigned long kDamiaoRegisters = 0x7FF;
constexpr unsigned kReadRegister = 0x33;

bool is_special(const Payload& bytes) {
  for (std::size_t i = 0; i < 7; ++i) {
    if (bytes[i] != 0xFF) return false;
  }
  return bytes[7] >= 0xFB;
}

// A field of `bits` width over [low, high].
double unpack(unsigned raw, unsigned bits, double low, double high) {
  return low + raw * (high - low) / ((1U << bits) - 1U);
}

struct Bound {
  const char* what;
  double value, low, high, quantum;
};

std::string judge(const Payload& b, const config::Joint& joint) {
  const config::Drive& drive = joint.drive;
  const unsigned p = b[0] << 8U | b[1];
  const unsigned v = b[2] << 4U | b[3] >> 4U;
  const unsigned kp = (b[3] & 0xFU) << 8U | b[4];
  const unsigned kd = b[5] << 4U | b[6] >> 4U;
  const unsigned t = (b[6] & 0xFU) << 8U | b[7];
  const double side = drive.direction;
  const double q = side * unpack(p, 16, -drive.position_range, drive.position_range) / drive.gear_ratio + drive.offset;
  const double dq = side * unpack(v, 12, -drive.velocity_range, drive.velocity_range) / drive.gear_ratio;
  const double tau = side * unpack(t, 12, -drive.torque_range, drive.torque_range) * drive.gear_ratio;
  const config::Limits& limits = joint.limits;
  // The packed fields resolve no better than one quantum, and the encoder truncates.
  const Bound bounds[] = {
      {"position", q, limits.q_min, limits.q_max, 2 * drive.position_range / 65535},
      {"velocity", dq, -limits.velocity, limits.velocity, 2 * drive.velocity_range / 4095},
      {"kp", unpack(kp, 12, 0, drive.kp_range), 0, limits.kp, drive.kp_range / 4095},
      {"kd", unpack(kd, 12, 0, drive.kd_range), 0, limits.kd, drive.kd_range / 4095},
      {"torque", tau, -limits.torque, limits.torque, 2 * drive.torque_range / 4095},
  };
  for (const Bound& bound : bounds) {
    if (bound.value < bound.low - 1.01 * bound.quantum || bound.value > bound.high + 1.01 * bound.quantum) {
      return joint.name + ": " + bound.what + " " + std::to_string(bound.value) + " outside " +
             std::to_string(bound.low) + " .. " + std::to_string(bound.high);
    }
  }
  return {};
}

const config::Joint* joint_of(const config::RobotConfig& robot, const std::string& interface, unsigned long id) {
  for (const config::Joint& joint : robot.joints) {
    if (robot.buses[joint.bus].interface == interface && joint.drive.id == id) return &joint;
  }
  return nullptr;
}

}  // namespace

SentFrames judge_sent_frames(const std::string& run, const config::RobotConfig& robot) {
  SentFrames result;
  std::istringstream log(monitor::read_frame_log(monitor::RunFolder(run)).value_or(""));
  std::string stamp, interface, frame;
  for (std::string line; std::getline(log, line);) {
    // (seconds.microseconds) interface id#data
    const std::size_t first = line.find(' ');
    const std::size_t second = line.find(' ', first + 1);
    const std::size_t hash = line.find('#');
    if (first == std::string::npos || second == std::string::npos || hash == std::string::npos) continue;
    interface = line.substr(first + 1, second - first - 1);
    const unsigned long id = std::strtoul(line.substr(second + 1, hash - second - 1).c_str(), nullptr, 16);
    const config::Joint* joint = joint_of(robot, interface, id);
    if (joint == nullptr && id != kDamiaoRegisters) continue;
    Payload bytes{};
    for (std::size_t i = 0; i < bytes.size() && hash + 2 + 2 * i < line.size(); ++i) {
      bytes[i] = static_cast<unsigned>(std::strtoul(line.substr(hash + 1 + 2 * i, 2).c_str(), nullptr, 16));
    }
    if (joint == nullptr) {
      ++result.questions;
      constexpr unsigned kWriteRegister = 0x55, kTimeout = 9;  // the only order: the drive's own time-out
      const bool sets_timeout = bytes[2] == kWriteRegister && bytes[3] == kTimeout;
      if (bytes[2] != kReadRegister && !sets_timeout && result.first_violation.empty())
        result.first_violation = line + ": an order to a drive's settings";
      continue;
    }
    if (is_special(bytes)) continue;
    ++result.motion_commands;
    const std::string violation = judge(bytes, *joint);
    if (!violation.empty() && result.first_violation.empty()) result.first_violation = line + ": " + violation;
  }
  return result;
}

}  // namespace takt::test
