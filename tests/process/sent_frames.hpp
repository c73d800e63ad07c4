// SPDX-License-Identifier: Apache-2.0
// Reads the commands a run sent to its drives back from can.log.zst, with a decoder of its own written from the
// protocol description, and says whether any of them left the robot's envelope, or was an order to a drive's settings:
// those may be asked for, never changed.
#pragma once

#include <cstddef>
#include <string>

#include "config/robot_config.hpp"

namespace takt::test {

struct SentFrames {
  std::size_t motion_commands = 0;  // frames that were neither enable, disable nor zero
  std::size_t questions = 0;        // about a drive's settings
  std::string first_violation;      // empty: every command was inside
};

SentFrames judge_sent_frames(const std::string& run, const config::RobotConfig& robot);

}  // namespace takt::test
