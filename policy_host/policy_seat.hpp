// Where a policy of a robot on another machine takes its seat: the executive's socket and mailboxes, without the
// executive. Whatever attaches to an executive as the policy (takt-policy-host, libtakt-client, the Python package)
// attaches here as it is.
//
// The policy is as little trusted as at the executive: its mailbox is sealed before it is read, commands are copied.
// Thread rule: one thread. Errors: one sentence, from open().
#pragma once

#include <chrono>
#include <cstdint>
#include <expected>
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

class PolicySeat {
 public:
  // Precondition: robot.policy. `policy_user`: a user who may be the policy, besides ours and root.
  static std::expected<std::unique_ptr<PolicySeat>, std::string> open(const config::RobotConfig& robot,
                                                                   const std::string& runtime_directory,
                                                                   std::uint64_t policy_hash,
                                                                   std::optional<uid_t> policy_user);
  PolicySeat(const PolicySeat&) = delete;
  PolicySeat& operator=(const PolicySeat&) = delete;
  ~PolicySeat() = default;

  // Greets who comes; waits for nobody.
  void serve();
  void publish(const Observation& observation) noexcept;
  // The newest command, if it was not returned before and may be one: its counts are inside the capacity.
  bool read(CommandChunk& chunk) noexcept;
  [[nodiscard]] bool is_taken() const { return mailbox_.has_value(); }
  // Counts the policies that sat here: another number, another policy or another life of it.
  [[nodiscard]] std::uint64_t session() const { return session_; }

 private:
  PolicySeat(const config::RobotConfig& robot, std::uint64_t policy_hash, ipc::Segment observations);
  ipc::Admission admit(const ipc::Peer& peer);
  void hand_over(const ipc::Peer& peer);
  void leave();
  struct Mailbox {
    ipc::Segment segment;
    ipc::SlotReader reader;
  };
  Hello expected_;
  std::size_t largest_input_;  // bytes; 0: inputs are not recorded
  ipc::Segment observations_;
  ipc::SlotWriter writer_;
  std::optional<ipc::Segment> offered_, inputs_;
  std::optional<Mailbox> mailbox_;
  std::uint64_t session_ = 0;
  std::unique_ptr<ipc::RendezvousServer> server_;  // last: its handlers use the above
};

}  // namespace takt::policy_host
