// SPDX-License-Identifier: Apache-2.0
// The recorder's hold on what one policy's host says of its network's inputs: a connection and a ring of its own, for
// one session of the host after the other. The executive hands the ring out and closes the connection when the session
// ends; what is left in the ring is read then, and the next session's is asked for. Beyond a ring's worth at once, two
// answers per observation are kept: no policy of ours says more, and a host must not decide what else fits on the disk.
// Where inputs are not recorded this
// does nothing. Thread rule: one thread; drain() may wait for the executive's greeting, at most twice a second.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/session.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "monitor/record/policy_input_stream.hpp"
#include "monitor/record/token_bucket.hpp"

namespace takt::monitor {

class PolicyInputSession {
 public:
  // `of`: policy, or fallback where the robot has a fallback policy.
  PolicyInputSession(const std::string& runtime_directory, const config::RobotConfig& robot, Player of);
  void drain(MonoTime now, const RecordSink& sink);

 private:
  struct Attached {
    ipc::Lease lease;
    ipc::Segment segment;
    PolicyInputStream stream;
  };
  void attach();

  std::string socket_;
  Hello hello_;
  std::size_t largest_input_;
  Player of_;
  TokenBucket bucket_;
  std::optional<Attached> attached_;
  MonoTime next_attempt_;
};

}  // namespace takt::monitor
