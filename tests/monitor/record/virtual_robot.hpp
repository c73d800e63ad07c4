// SPDX-License-Identifier: Apache-2.0
// A robot in virtual time: the real decision of config/arm6.yaml, drives that follow their setpoints, and a policy that
// answers every observation after some ticks, or not. Publishes records into rings as the executive does.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/ipc/slot_ring.hpp"
#include "executive/pipeline/control_tick.hpp"
#include "monitor/record/record_stream.hpp"
#include "monitor/record/run_manifest.hpp"

namespace takt::monitor {

// config/arm6.yaml as the repository has it. Fails the test when it does not load.
const config::RobotConfig& demo_robot();

class VirtualRobot {
 public:
  static constexpr std::uint64_t kArmAt = 100;  // tick of the operator's arming request
  static constexpr std::uint64_t kPolicyHash = 0x1122'3344'5566'7788;
  static constexpr std::uint64_t kKeyframeEvery = 200;

  // Decides by `robot`, whose joints and buses are the demo's.
  explicit VirtualRobot(const config::RobotConfig& robot = demo_robot());
  void run(std::uint64_t ticks);
  // While true the policy answers nothing.
  bool policy_is_frozen = false;
  std::uint64_t answer_ticks = 12;  // from an observation to its answer
  std::uint64_t arm_at = kArmAt;    // tick of the operator's arming request
  std::uint64_t mark_at = 0;        // tick of a person's mark; 0 never
  // Applied to what a tick is about to read: noise, lateness, faults.
  std::function<void(pipeline::TickInput&)> spoil_input;
  // Of a refused message only the header is published.
  bool cuts_what_is_refused = false;
  // Applied to every answer before it is delivered.
  std::function<void(CommandChunk&)> spoil_answer;

  [[nodiscard]] RingMemories rings() const;
  [[nodiscard]] const TickRecord& latest() const { return output_->record; }
  [[nodiscard]] RunManifest manifest() const;

 private:
  struct RingMemory {
    explicit RingMemory(const ipc::RingShape& shape);
    std::size_t size;
    std::unique_ptr<std::byte, void (*)(void*)> data;
    ipc::SlotWriter writer;
  };
  struct Answer {
    std::uint64_t due;
    std::unique_ptr<CommandChunk> chunk;
  };
  void step();
  void sense();
  void answer(const Observation& observation);
  void publish();

  pipeline::TickConfig config_;
  pipeline::TickStatePtr state_;
  std::unique_ptr<pipeline::TickInput> input_ = std::make_unique<pipeline::TickInput>();
  std::unique_ptr<pipeline::TickOutput> output_ = std::make_unique<pipeline::TickOutput>();
  std::vector<Answer> answers_;
  std::unique_ptr<CommandChunk> command_;
  std::uint64_t sequence_ = 0;
  RingMemory ticks_, commands_, keyframes_, frames_;
};

}  // namespace takt::monitor
