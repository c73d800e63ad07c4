// SPDX-License-Identifier: Apache-2.0
// What the drives on a robot's buses say, decoded: a listener beside a program that drives them, or, where none does,
// one that asks them itself and keeps them disabled.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/bus/can_bus.hpp"
#include "drivers/protocol/joint_driver.hpp"

namespace takt::cli {

class BusWatch {
 public:
  // One bus per entry of the robot file, in its order.
  BusWatch(const config::RobotConfig& robot, std::vector<std::unique_ptr<drivers::CanBus>> buses);

  // Takes in what arrived. Call it every few milliseconds, and every control period once it asks.
  void listen();
  // Whether a frame for one of the drives was heard: another program drives them.
  [[nodiscard]] bool heard_commands() const { return heard_commands_; }
  // From now on listen() also tells every drive to be disabled and to report, and sets it up.
  void begin_to_ask();
  // Replies per second, below, are those between the last two calls of this.
  void count(MonoTime now);
  // A table: joint, protocol, state, position, torque, temperature, age of the newest reply, replies per second, error.
  [[nodiscard]] std::string table(MonoTime now) const;
  // The same as one line of JSON.
  [[nodiscard]] std::string json(MonoTime now) const;

 private:
  struct Watched {
    std::unique_ptr<drivers::JointDriver> driver;
    std::uint64_t replies = 0, counted = 0;
    double per_second = 0;
  };
  [[nodiscard]] std::string error_of(std::size_t joint) const;
  void make_drivers(bool asks);
  void ask();

  const config::RobotConfig& robot_;
  std::vector<std::unique_ptr<drivers::CanBus>> buses_;
  std::vector<Watched> joints_;
  std::vector<drivers::ReceivedFrame> received_;
  std::vector<std::uint64_t> frames_, strangers_;  // per bus
  bool asks_ = false, heard_commands_ = false;
  MonoTime counted_at_;
};

}  // namespace takt::cli
