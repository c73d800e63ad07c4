// SPDX-License-Identifier: Apache-2.0
// What strangers do to one bus, and how it loses frames. Pure, virtual time; same seed, same losses.
//
// A babbler sends as many empty frames as the bus's bit rate carries, on an id without a listener. A rival is a second
// host with a driver of its own: it enables the drive and commands position zero without stiffness, once per step.
// There is no arbitration: every sender is heard beside the others. Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/protocol/joint_driver.hpp"
#include "executive/contract/feedback.hpp"
#include "simulation/device.hpp"

namespace takt::simulation {

struct BusFaults {
  BusState state = BusState::up;
  bool babble = false;
  double drop = 0;                       // share of frames lost in each direction, 0..1
  std::vector<std::size_t> rivals_of{};  // joints that a second host commands
  bool operator==(const BusFaults&) const = default;
};

class BusTrouble {
 public:
  static constexpr std::size_t kMostFramesPerStep = 256;

  BusTrouble(const config::RobotConfig& robot, std::size_t bus);
  void set(const BusFaults& faults);
  [[nodiscard]] const BusFaults& faults() const { return faults_; }
  // True: the frame that crosses the bus now is lost.
  bool loses();
  // What strangers say during one step, appended.
  void speak(Frames& out);
  // Rivals listen to what drives say.
  void overhear(const drivers::CanFrame& frame, MonoTime now);
  [[nodiscard]] std::size_t babble_per_step() const { return babble_per_step_; }

 private:
  struct Rival {
    std::size_t joint;
    std::unique_ptr<drivers::JointDriver> host;
  };
  const config::RobotConfig& robot_;  // outlives this
  BusFaults faults_;
  std::mt19937_64 random_;
  drivers::CanFrame babble_;
  std::size_t babble_per_step_;
  std::vector<Rival> rivals_;
};

}  // namespace takt::simulation
