// SPDX-License-Identifier: Apache-2.0
// The policy's lease at the executive: observations in (read-only), command chunks out, and what they were made from
// where that is recorded.
//
// One session: a new link is made after the executive went away, with fresh mailboxes. Errors are one sentence, the
// executive's own when it refuses. Thread rule: one thread; read and publish neither block nor allocate, nothing here
// blocks after attach().
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <string_view>

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
  enum class Time : std::uint8_t { clock, clock_or_lockstep };  // Welcome::lockstep
  // `largest_input`: bytes of the largest payload given to publish_input(), config::largest_policy_input() of the
  // robot; 0: none is ever given. `knows`: what the caller can live by.
  static std::expected<ExecutiveLink, std::string> attach(const std::string& socket, const Hello& hello,
                                                          std::size_t largest_input = 0, Time knows = Time::clock);
  [[nodiscard]] bool is_lockstep() const { return lease_.lockstep; }

  // True once the executive closed the session or died.
  [[nodiscard]] bool is_over() const { return ipc::is_over(lease_); }
  // The newest observation, if it was not returned before.
  bool read(Observation& observation) noexcept;
  void publish(const CommandChunk& chunk) noexcept;
  // Why no command is published, in words for people (contract/policy_word.hpp); empty: that is over. Told when it
  // changes, once a second at most.
  void state_problem(MonoTime now, std::string_view sentence);
  // Which other process makes the commands from this one on.
  void state_source(std::string_view sentence, std::uint64_t first_sequence) const;
  // A policy_input.hpp. Precondition: attached with a largest_input, and no longer than it.
  void publish_input(std::span<const std::byte> input) noexcept;

 private:
  struct Writable {
    ipc::Segment segment;
    ipc::SlotWriter writer;
  };
  static std::expected<Writable, std::string> adopt(ipc::Lease& lease, std::size_t descriptor,
                                                    const ipc::RingShape& shape);
  ExecutiveLink(ipc::Lease lease, ipc::Segment observations, ipc::SlotReader reader, Writable commands,
                std::optional<Writable> inputs);
  ipc::Lease lease_;
  ipc::Segment observations_;
  ipc::SlotReader reader_;
  Writable commands_;
  std::optional<Writable> inputs_;
  std::string problem_;
  MonoTime problem_told_;
};

}  // namespace takt::policy_host
