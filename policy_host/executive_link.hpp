// The policy's lease at the executive: observations in (read-only), command chunks out.
//
// One session: a new link is made after the executive went away, with fresh mailboxes. Errors are one sentence, the
// executive's own when it refuses. Thread rule: one thread; read and publish neither block nor allocate.
#pragma once

#include <cstdint>
#include <expected>
#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/session.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::policy_host {

// What a process of this robot says first. The policy's own fields are filled for the policies' roles.
Hello hello_of(const config::RobotConfig& robot, std::uint64_t policy_hash, Role role, const char* program);

class ExecutiveLink {
 public:
  static std::expected<ExecutiveLink, std::string> attach(const std::string& socket, const Hello& hello);

  // True once the executive closed the session or died.
  [[nodiscard]] bool is_over() const { return ipc::is_over(lease_); }
  // The newest observation, if it was not returned before.
  bool read(Observation& observation) noexcept;
  void publish(const CommandChunk& chunk) noexcept;

 private:
  ExecutiveLink(ipc::Lease lease, ipc::Segment observations, ipc::Segment commands, ipc::SlotReader reader,
                ipc::SlotWriter writer);
  ipc::Lease lease_;
  ipc::Segment observations_;
  ipc::Segment commands_;
  ipc::SlotReader reader_;
  ipc::SlotWriter writer_;
};

}  // namespace takt::policy_host
