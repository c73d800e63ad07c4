// SPDX-License-Identifier: Apache-2.0
// The robot that docs/modes.md is measured with, in virtual time (tests/executive/pipeline/rig.hpp): two policies that
// answer every observation at once, unless they are silent, with gains and torques.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "tests/executive/pipeline/rig.hpp"

namespace takt::docs {

// Other values than the robot's own, so that one can be told from the other.
inline constexpr float kCommandStiffness = 90, kCommandDamping = 3, kCommandTorque = 0.8F;

class Robot : public pipeline::testing::Rig {
 public:
  explicit Robot(const pipeline::TickConfig& robot) : Rig(robot) {}

  void go(int ticks, OperatorRequest request = OperatorRequest::none);
  void go_until(Mode wanted);
  void go_until_unusable();
  void track();    // and moves
  void degrade();  // by a silence, and 50 ms old
  void stop();     // asked for by a program, and 20 ms old

  bool speaks = true, fallback_speaks = true;
  float wants = 0.3F, fallback_wants = -0.9F;

 private:
  CommandChunk answer(float q, std::uint64_t hash);

  std::unique_ptr<CommandChunk> first_ = std::make_unique<CommandChunk>(), second_ = std::make_unique<CommandChunk>();
};

// One line: a situation that was not reached, or has no words.
std::string failed(std::string_view where, std::string_view when, std::string_view why);

}  // namespace takt::docs
