// SPDX-License-Identifier: Apache-2.0
// The messages as ROS 2's rules lay them out, decoded by Fast CDR: written from the .msg files, not from our encoder.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "tests/process/fastdds_peer.hpp"

namespace takt::test {

struct FastJointState {
  std::int64_t unix_ns = 0;
  std::string frame_id;
  std::vector<std::string> name;
  std::vector<double> position, velocity, effort;
};

struct FastDiagnostic {
  std::uint8_t level = 0;
  std::string name, message, hardware_id;
  std::vector<std::pair<std::string, std::string>> values;
};

struct FastStatus {
  std::int64_t unix_ns = 0;
  std::string robot, machine;
  bool running = false;
  std::uint64_t tick = 0;
  std::string mode, cause, detail, freshness;
  std::int64_t age_ns = 0;
  std::uint32_t window_misses = 0, window_ticks = 0;
  std::uint64_t skipped_periods = 0, overruns = 0;
  std::uint32_t refused_commands = 0, integration_errors = 0;
  std::uint64_t command_sequence = 0, observation_answered = 0;
  bool drives_enabled = false;
  std::vector<std::string> causes_active;
  std::uint64_t lost_joint_states = 0, lost_diagnostics = 0, lost_status = 0, lost_command_ages = 0;
  std::uint64_t request_id = 0;
  std::string request_verb;
  bool request_done = false;
  std::string request_answer;
};

struct FastCommandAge {
  std::int64_t unix_ns = 0;
  std::string robot;
  std::uint64_t tick = 0, command_sequence = 0, observation_id = 0;
  std::int64_t sense_ns = 0, queue_ns = 0, infer_ns = 0, publish_ns = 0, hold_ns = 0, total_ns = 0;
};

// Throw what Fast CDR throws when the payload is too short; a payload that is too long throws too.
FastJointState decode_joint_state(const Payload& payload);
std::vector<FastDiagnostic> decode_diagnostics(const Payload& payload);
FastStatus decode_status(const Payload& payload);
FastCommandAge decode_command_age(const Payload& payload);
Payload encode_request(const std::string& robot, std::uint64_t id, const std::string& verb,
                       const std::string& machine = "");
Payload encode_status(const FastStatus& status);

// sensor_msgs and geometry_msgs, as a camera's or a driver's node sends them. Stamps: Unix ns.
struct FastImage {
  std::int64_t unix_ns = 0;
  std::uint32_t height = 0, width = 0, step = 0;
  std::string encoding;
  std::vector<std::uint8_t> data;
};
Payload encode_image(const FastImage& image);
// Quaternion x y z w, angular velocity, linear acceleration.
Payload encode_imu(std::int64_t unix_ns, const std::vector<double>& ten);
Payload encode_joint_state(const FastJointState& state);
Payload encode_twist(const std::vector<double>& six);

}  // namespace takt::test
