// SPDX-License-Identifier: Apache-2.0
// The CAN buses of a rollout in virtual time: frames take their time on the wire one after the other, drives answer
// when the command has crossed, and replies reach the host at an instant of their own.
//
// Wire time is the worst case of each frame (drivers/protocol/bus_load.hpp). A drive obeys a command within the tick it
// was sent in. Frames pass the last guard, as in the executive. No arbitration, no error frames: a perturbed bus
// loses frames, delays replies, or carries nothing. Thread rule: one thread at a time.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "config/robot_config.hpp"
#include "drivers/guard/wire_guard.hpp"
#include "drivers/protocol/joint_driver.hpp"
#include "evidence/rollout/perturbation.hpp"
#include "evidence/rollout/random.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "simulation/plant.hpp"

namespace takt::evidence {

class VirtualBus {
 public:
  // The error is one sentence: a protocol this build does not speak. `robot` and `disturbance` outlive this.
  // `guarded`: frames pass the last guard; else they leave as they are.
  static std::expected<VirtualBus, std::string> make(const config::RobotConfig& robot, const Disturbance& disturbance,
                                                     std::uint64_t seed, bool guarded = true);

  // Everything that has arrived by `now`, decoded into joints and buses.
  void receive(simulation::Plant& plant, MonoTime now, pipeline::TickInput& input);
  // One setpoint per joint; the first frame starts at `now`.
  void send(simulation::Plant& plant, MonoTime now, const pipeline::TickOutput& output);

 private:
  struct OnTheWay {
    drivers::ReceivedFrame received;
    MonoTime readable_at;
  };
  struct Bus {
    std::vector<std::size_t> joints;
    std::vector<OnTheWay> on_the_way;
    MonoTime free_at;  // the wire is taken until then
    BusHealth health;
  };
  VirtualBus(const config::RobotConfig& robot, const Disturbance& disturbance, std::uint64_t seed,
             std::vector<std::unique_ptr<drivers::JointDriver>> drivers, bool guarded);
  // Afterwards the frame may leave, whatever it was before.
  WireVerdict guard(std::size_t joint, std::size_t bus, MonoTime now, const pipeline::TickOutput& output,
                    drivers::CanFrame& frame);
  // False: the frame is lost. Otherwise the wire is taken for the frame's time.
  bool carry(std::size_t bus, const drivers::CanFrame& frame, MonoTime now);
  void expect_replies(std::size_t bus, MonoTime now);
  void decode(Bus& bus, const drivers::ReceivedFrame& received);
  [[nodiscard]] bool is_off(std::size_t bus, MonoTime now) const;

  const config::RobotConfig& robot_;
  const Disturbance& disturbance_;
  Random losses_;
  std::vector<std::unique_ptr<drivers::JointDriver>> drivers_;
  std::vector<Bus> buses_;
  drivers::WireGuard guard_;
  bool guarded_;
  std::vector<WireVerdict> refused_;  // per joint, the first since the last receive()
  std::vector<Turns> turns_;          // per joint
  std::vector<drivers::CanFrame> encoded_;
  simulation::Frames said_;
};

}  // namespace takt::evidence
