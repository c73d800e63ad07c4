// SPDX-License-Identifier: Apache-2.0
// Does what the robot file's `model` weighs hang on the robot that is there? While a robot rests on its drives, the
// torque that a drive measures holds what hangs on its joint, and the model says how much that is. Stops carry what the
// model says: an arm that is heavier sags, a lighter one rises.
//
// Judged once after each arming, over the first half second in which every joint rests. Nothing is said of robots
// without a model, and of those with an IMU, whose feet carry a part. Thread rule: one thread at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/tick_record.hpp"

namespace takt::monitor {

// A joint whose measured torque is more than a fifth from its model's, and more than a gear's friction.
struct LoadMismatch {
  std::uint64_t tick = 0;  // the last of the rest
  MonoTime at;
  std::size_t joint = 0;
  double measured = 0, model = 0;  // Nm or N, joint side, means over the rest
};

class LoadWatch {
 public:
  explicit LoadWatch(const config::RobotConfig& robot);
  // Those found in this tick; valid until the next call.
  std::span<const LoadMismatch> tick(const TickRecord& record);

 private:
  struct Sums {
    double measured = 0, model = 0;
  };
  [[nodiscard]] bool rests(const TickRecord& record) const;
  void judge(const TickRecordHeader& header);

  struct Limit {
    double torque = 0;  // Nm or N
    bool passive = false;
  };
  std::vector<Limit> limits_;  // one per joint; empty: nothing is judged
  std::vector<Sums> sums_;
  std::vector<LoadMismatch> found_;
  MonoTime rests_since_;
  std::uint64_t ticks_ = 0;  // of this rest
  bool judged_ = false;      // since the drives were enabled
};

// "joint elbow holds 12.1 Nm at rest, by its model 8.0 Nm (+51 %): correct `model`'s masses, ..."
std::string sentence_of(const LoadMismatch& mismatch, const config::RobotConfig& robot);

}  // namespace takt::monitor
