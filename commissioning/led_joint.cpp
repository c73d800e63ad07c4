// SPDX-License-Identifier: Apache-2.0
#include "commissioning/led_joint.hpp"

#include "drivers/protocol/protocol_table.hpp"

namespace takt::commissioning {

std::string drive_trouble(const config::Drive& drive, const JointFeedback& feedback, MonoTime now) {
  if (feedback.drive_state == DriveState::fault)
    return "its drive reports " + drivers::error_name(drive, feedback.error_code);
  if (feedback.drive_state != DriveState::enabled) return "its drive left the enabled state by itself";
  if (now - feedback.received_at > kLedSilence) return "its drive fell silent";
  return {};
}

}  // namespace takt::commissioning
