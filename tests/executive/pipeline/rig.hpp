// SPDX-License-Identifier: Apache-2.0
// A robot for tests in virtual time: independent joints with inertia, friction and (optionally) the gravity of a link
// tree, behind ideal drives that close the impedance loop of the previous tick's setpoint. No clock: 1 ms per tick.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>

#include "executive/pipeline/control_tick.hpp"
#include "executive/pipeline/gravity_model.hpp"

namespace takt::pipeline::testing {

// A plausible robot of n joints in a chain; every limit differs a little from joint to joint.
TickConfig robot(std::uint32_t joints);

// A chunk of `steps` equal targets that answers `observation`, all stamps sound, fields q only.
CommandChunk chunk_for(const TickConfig& config, std::uint64_t observation, MonoTime observed_at, MonoTime now,
                       std::uint64_t sequence, float q_target, std::uint16_t steps = 16);

class Rig {
 public:
  explicit Rig(const TickConfig& config, MonoTime start = {1'000'000'000});

  // One tick: feedback of joints that reply, the tick, then the physics of one period.
  const TickOutput& tick(const CommandChunk* command = nullptr, OperatorRequest request = OperatorRequest::none,
                         Arrival mailbox = Arrival::accepted, std::size_t command_bytes = 0);
  // A tick in which a good policy with no delay answers the newest observation.
  const TickOutput& tick_with_policy(float q_target, OperatorRequest request = OperatorRequest::none);
  // Standby -> tracking with a good policy that asks for q_target.
  void arm(float q_target = 0.0F);
  void run(int ticks) {
    for (int i = 0; i < ticks; ++i) tick();
  }
  void run_with_policy(int ticks, float q_target) {
    for (int i = 0; i < ticks; ++i) tick_with_policy(q_target);
  }

  [[nodiscard]] const TickRecordHeader& header() const { return out->record.header; }
  [[nodiscard]] Mode mode() const { return out->record.header.mode; }

  struct Drive {
    float q = 0, dq = 0, tau = 0;
    int enabling_ticks = 0;
    bool silent = false;   // no replies
    bool gripped = false;  // by a hand, which keeps the joint where it is, as well as it can
    float gripped_at = 0;  // rad
    bool fault = false;
    bool drops_out = false;  // disables itself
    bool never_enables = false;
    JointSetpoint told{};  // by the newest frame: a drive goes on with it until its next turn
    bool told_enabled = false;
    bool asked = true;  // since the tick before, so that it answers
  };

  TickConfig config;
  TickStatePtr state;
  std::unique_ptr<TickOutput> out = std::make_unique<TickOutput>();
  TickInput input;
  MonoTime now;
  std::array<Drive, kMaxJoints> drives{};
  JointMask late = 0;  // joints whose setpoint comes too late: they get the damping, and the next tick knows
  std::uint64_t sequence = 0;
  std::uint64_t newest_observation = 0;
  std::map<std::uint64_t, MonoTime> sensed_at;  // the test's own memory of observations
  std::map<std::uint64_t, MonoTime> published_at;

 private:
  GravityModel gravity_;
  void sense();
  void move();
  std::unique_ptr<CommandChunk> scratch_ = std::make_unique<CommandChunk>();
};

}  // namespace takt::pipeline::testing
