// SPDX-License-Identifier: Apache-2.0
// What an exporter says of a policy's inputs and outputs, in one form for all exporters that say it (LEAPP's YAML,
// exploy's metadata). What is not said stays unsaid; nothing is filled in.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"

namespace takt::policy_host {

enum class Meaning : std::uint8_t {
  unsaid,
  joint_position,         // rad
  joint_velocity,         // rad/s
  joint_torque,           // Nm
  base_orientation,       // quaternion, base in world
  base_angular_velocity,  // rad/s, base frame
  base_linear_velocity,   // m/s, base frame
  projected_gravity,      // its direction, base frame
  command,                // of a person
  sensor,                 // what no robot says of itself: another body, another frame, the surroundings
};

struct DescribedInput {
  std::string name;
  std::size_t width = 0;
  Meaning meaning = Meaning::unsaid;
  std::string word;                               // the exporter's own: "state/body/rotation"
  std::vector<std::string> joints;                // of each value; empty: not said
  std::string quaternion;                         // "wxyz", "xyzw"; empty: not said
  std::vector<std::string> units;                 // of the quantity, one as good as the other; empty: not said
  std::string frame;                              // what it is expressed in: "base", "world"; empty: not said
  std::vector<std::string> elements;              // of a command: "lin_vel_x"; as many as values, or empty
  std::vector<std::pair<double, double>> ranges;  // of a command: likewise
};

struct DescribedOutput {
  std::string name;
  std::optional<CommandField> field;  // absent: nothing that a joint can be told
  std::string word;
  std::size_t width = 0;  // of one step
  std::size_t steps = 1;
  Duration step_period;  // of a chunk; 0: not said
  std::vector<std::string> joints;
};

// Gains and poses of the joints, in an order of their own; lists as long as `joints`, or empty.
struct DescribedJoints {
  std::vector<std::string> joints;
  std::vector<double> stiffness, damping, default_position;
};

struct DescribedPolicy {
  std::string format;                    // "LEAPP bundle"
  Duration period;                       // 0: not said
  std::vector<DescribedInput> inputs;    // what comes from outside, in the network's order
  std::vector<DescribedOutput> outputs;  // what goes outside
  DescribedJoints joints;
  std::vector<std::string> notes;  // what is left open
};

// The sensor that may stand for an input, in words: "a sensor whose unit is m/s and whose frame is base".
std::string sensor_for(const DescribedInput& input);

constexpr std::string_view name(Meaning meaning) {
  switch (meaning) {
    case Meaning::unsaid:
      return "not said";
    case Meaning::joint_position:
      return "joint positions, rad (slides: m)";
    case Meaning::joint_velocity:
      return "joint velocities, rad/s (slides: m/s)";
    case Meaning::joint_torque:
      return "joint torques, Nm (slides: N)";
    case Meaning::base_orientation:
      return "the base's orientation in the world, a quaternion";
    case Meaning::base_angular_velocity:
      return "the base's angular velocity, rad/s, base frame";
    case Meaning::base_linear_velocity:
      return "the base's linear velocity, m/s, base frame";
    case Meaning::projected_gravity:
      return "gravity's direction, base frame";
    case Meaning::command:
      return "a command";
    case Meaning::sensor:
      return "an outside sensor's";
  }
  return "invalid";
}

}  // namespace takt::policy_host
