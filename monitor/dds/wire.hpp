// SPDX-License-Identifier: Apache-2.0
// Our messages as idlc's C structures. A Lent<...> borrows every string and number from the message it was made of, and
// owns the arrays of pointers: it lives shorter than the message.
#pragma once

#include <vector>

#include "config/robot_config.hpp"
#include "monitor/dds/messages.hpp"
#include "monitor/dds/outbox.hpp"
#include "ros_types.h"

namespace takt::monitor::dds {

struct LentJointStates {
  sensor_msgs_msg_dds__JointState_ wire{};
  std::vector<char*> names;
};

struct LentDiagnostics {
  diagnostic_msgs_msg_dds__DiagnosticArray_ wire{};
  std::vector<diagnostic_msgs_msg_dds__DiagnosticStatus_> parts;
  std::vector<std::vector<diagnostic_msgs_msg_dds__KeyValue_>> values;
};

struct LentStatus {
  takt_msgs_msg_dds__Status_ wire{};
  std::vector<char*> causes;
};

// The structures point into the Lent they are in: filled in place, never moved.
void lend(const JointStates& message, const config::RobotConfig& robot, LentJointStates& out);
void lend(const Diagnostics& message, const config::RobotConfig& robot, LentDiagnostics& out);
void lend(const Status& message, const Losses& losses, const RequestAnswer& answer, const config::RobotConfig& robot,
          const std::string& machine, LentStatus& out);
takt_msgs_msg_dds__CommandAge_ lend(const CommandAge& message, const config::RobotConfig& robot);

}  // namespace takt::monitor::dds
