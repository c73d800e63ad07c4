// SPDX-License-Identifier: Apache-2.0
// Where a policy takes its seat when there is no executive: the executive's socket and mailboxes alone. Whatever
// attaches to an executive as the policy (takt-policy-host, libtakt-client, the Python package) attaches here as it is:
// on another machine than the robot (remote/server.hpp), and in virtual time (evidence/rollout/policy_process.hpp).
//
// The policy is as little trusted as at the executive: its mailbox is sealed before it is read, commands are copied.
// Thread rule: one thread. Errors: one sentence, from open().
#pragma once

#include <chrono>
#include <cstdint>
#include <expected>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "config/robot_config.hpp"
#include "executive/contract/command_chunk.hpp"
#include "executive/contract/observation.hpp"
#include "executive/contract/session.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/ipc/slot_ring.hpp"

namespace takt::policy_host {

struct SeatOptions {
  std::string runtime_directory;
  std::string server;                // what has the seat, for who is turned away: "takt-policy-server"
  std::optional<uid_t> policy_user;  // who may be the policy, besides ours and root
  bool lockstep = false;             // Welcome::lockstep
  std::function<void(const ipc::Peer&)> taken = {};
  std::function<void()> left = {};
  std::function<void(const ipc::Peer&, const std::string& why)> turned_away = {};  // whose mailbox was no good
};

class PolicySeat {
 public:
  // Precondition: robot.policy.
  static std::expected<std::unique_ptr<PolicySeat>, std::string> open(const config::RobotConfig& robot,
                                                                      std::uint64_t policy_hash, SeatOptions options);
  PolicySeat(const PolicySeat&) = delete;
  PolicySeat& operator=(const PolicySeat&) = delete;
  ~PolicySeat() = default;

  // Greets who comes, waiting at most `within` for it.
  void serve(std::chrono::milliseconds within = std::chrono::milliseconds(0));
  void publish(const Observation& observation) noexcept;
  // The newest command, if it was not returned before and may be one: its counts are inside the capacity.
  bool read(CommandChunk& chunk) noexcept;
  // Ends the session of who sits there; it may come again.
  void evict();
  [[nodiscard]] bool is_taken() const { return mailbox_.has_value(); }
  // Counts the policies that sat here: another number, another policy or another life of it.
  [[nodiscard]] std::uint64_t session() const { return session_; }
  // What the policy that sits there says of itself, printable: why it publishes nothing, and whose commands the one of
  // that sequence is. Empty: nothing. serve() hears it.
  [[nodiscard]] const std::string& problem() const { return problem_; }
  [[nodiscard]] const std::string& source_of(std::uint64_t sequence) const {
    return sequence >= source_from_ ? source_ : source_before_;
  }

 private:
  PolicySeat(const config::RobotConfig& robot, std::uint64_t policy_hash, SeatOptions options,
             ipc::Segment observations);
  ipc::Admission admit(const ipc::Peer& peer);
  [[nodiscard]] std::string refusal_of(const Hello& hello) const;
  void hand_over(const ipc::Peer& peer);
  void leave();
  void hear(const PolicyWord& word);
  void forget_words();
  struct Mailbox {
    ipc::Segment segment;
    ipc::SlotReader reader;
  };
  SeatOptions options_;
  Hello expected_;
  std::size_t largest_input_;  // bytes; 0: inputs are not recorded
  ipc::Segment observations_;
  ipc::SlotWriter writer_;
  std::optional<ipc::Segment> offered_, inputs_;
  std::optional<Mailbox> mailbox_;
  std::uint64_t session_ = 0;
  std::string problem_, source_, source_before_;
  std::uint64_t source_from_ = 0;                  // sequence of the first command that is of source_
  std::unique_ptr<ipc::RendezvousServer> server_;  // last: its handlers use the above
};

}  // namespace takt::policy_host
