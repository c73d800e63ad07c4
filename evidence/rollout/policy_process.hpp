// SPDX-License-Identifier: Apache-2.0
// A policy that is a program (takt.connect, takt/client.h), in virtual time: started as `takt run --policy-host` starts
// it, behind the same boundary (policy_host/boundary.hpp), beside a seat without an executive that shows it one
// observation at a time and waits for its answer.
//
// When things happen is not the program's affair but the model's (virtual_policy.hpp): how long it really takes counts
// for nothing, and all stamps that it is shown are virtual. Every rollout is a session of its own, which a policy
// learns by `reset`; what it remembers all the same, and what it draws, is its own: such rollouts are as repeatable as
// it is. It sees what takt-policy-host would be shown: of a sensor with a queue the newest sample only.
//
// A program that ends or hangs is silent from then on, as it would be on the robot; the next session starts it anew.
// Thread rule: one thread at a time. A copy of this object in a forked child starts a process of its own.
#pragma once

#include <cstdint>
#include <expected>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/sensor_sample.hpp"
#include "executive/ipc/sensor_server.hpp"
#include "policy_host/boundary.hpp"
#include "policy_host/policy_seat.hpp"
#include "simulation/kept_process.hpp"

namespace takt::evidence {

class PolicyProcess {
 public:
  struct Patience {
    Duration start = seconds(120);  // until it has connected: a network loads
    Duration answer = seconds(30);  // to one observation
  };
  // `command`: for /bin/sh; `--robot FILE --runtime-dir FOLDER` go behind it.
  explicit PolicyProcess(std::string command, policy_host::Grants grants = {});
  PolicyProcess(std::string command, const Patience& patience, policy_host::Grants grants = {});
  PolicyProcess(const PolicyProcess&) = delete;
  PolicyProcess& operator=(const PolicyProcess&) = delete;
  ~PolicyProcess();

  // A session for a rollout of `robot`, which outlives it, and is the same every time. The error is one sentence: the
  // program does not start, or refuses the robot; what it said itself stands in stderr.
  std::expected<void, std::string> begin(const config::RobotConfig& robot, std::uint64_t policy_hash);
  // The same in the middle of a rollout, of another process: the one before has crashed.
  std::expected<void, std::string> begin_anew();
  // False: it has no answer. `samples`, `images`: one per sensor of the robot file; of those in use, judged usable.
  bool answer(const Observation& observation, std::span<const SensorSample> samples,
              std::span<const std::span<const std::uint8_t>> images, CommandChunk& chunk);
  // Ends the process, whose place is taken away; begin() starts another.
  void end();
  // Why it answers nothing any more in this session; empty: it does.
  [[nodiscard]] const std::string& silence() const { return silence_; }

 private:
  struct Source {
    std::size_t sensor;  // index into the robot's
    std::unique_ptr<ipc::SensorServer> server;
    SensorSample shown;  // newest; of an image its stamps
  };
  std::expected<void, std::string> prepare();
  std::expected<void, std::string> begin_session(bool anew);
  std::expected<void, std::string> take_seat(bool anew);
  std::expected<void, std::string> start();
  std::expected<void, std::string> wait_for_policy(std::uint64_t session_before);
  void show(Source& source, const SensorSample& sample, std::span<const std::uint8_t> image);
  void fall_silent(const std::string& why);
  void disown();
  [[nodiscard]] bool is_ours() const;

  std::string command_;
  Patience patience_;
  policy_host::Grants grants_;
  const config::RobotConfig* robot_ = nullptr;
  std::uint64_t policy_hash_ = 0;
  std::string folder_;
  pid_t owner_ = 0;  // of folder and seat
  std::unique_ptr<policy_host::PolicySeat> seat_;
  std::vector<Source> sources_;
  simulation::KeptProcess process_;
  std::string silence_ = "not begun";
};

}  // namespace takt::evidence
