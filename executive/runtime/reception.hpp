// SPDX-License-Identifier: Apache-2.0
// Who comes to the executive's socket, and what they get: a policy its two mailboxes, a monitor or a viewer the record
// rings, an operator an answer. Policies are admitted by admission.hpp; requests reach the control thread through the
// operator inbox.
//
// A policy session: admitted -> a new command segment goes out -> the policy maps it and acknowledges -> the segment is
// sealed and handed to the control thread -> the connection ends -> the mailbox is taken back. The command in use lives
// on until its own age ends it: a departure has no path of its own through the decision.
//
// The ring of its inputs goes out with it, and to its readers; it is not mapped here. It waits for its session
// before the policy comes, so that a reader misses nothing. When the session ends its readers are sent away, who read
// the rest and come back for the next. Thread rule: service thread. Allocates, logs, waits up to kRequestPatience
// inside a request.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <expected>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/robot_config.hpp"
#include "executive/ipc/rendezvous.hpp"
#include "executive/ipc/segment.hpp"
#include "executive/pipeline/tick_config.hpp"
#include "executive/runtime/admission.hpp"
#include "executive/runtime/mailbox_handover.hpp"
#include "executive/runtime/operator_inbox.hpp"
#include "executive/runtime/operator_log.hpp"
#include "executive/runtime/pending_arms.hpp"
#include "executive/runtime/policy_words.hpp"
#include "executive/runtime/published_segments.hpp"
#include "executive/runtime/recorded_through.hpp"
#include "executive/runtime/status_board.hpp"
#include "executive/runtime/tick_follower.hpp"

namespace takt::runtime {

// A request is reported on when the tick that read it is over, or after this long.
inline constexpr std::chrono::milliseconds kRequestPatience{100};

// All of it outlives the reception.
struct ReceptionParts {
  const config::RobotConfig& robot;
  const pipeline::TickConfig& config;
  PerSeat<AdmissionRules> rules;  // the candidate's are the policy's, but for its hash
  PublishedSegments& published;
  PerSeat<MailboxHandover>& mailboxes;
  OperatorInbox& requests;
  RecordedThrough& recorded;
  StatusBoard& board;
  TickFollower& follower;
  std::optional<uid_t> policy_user = {};  // who may be the policy besides our own user (ipc/rendezvous.hpp)
};

class Reception {
 public:
  // Refused when another executive serves the socket.
  static std::expected<std::unique_ptr<Reception>, std::string> open(const std::string& socket_path,
                                                                     const ReceptionParts& parts);
  Reception(const Reception&) = delete;
  Reception& operator=(const Reception&) = delete;

  // Known once the control thread prepared itself; before that arming is refused.
  void set_realtime(bool realtime, bool allow_non_realtime);
  void begin_shutdown() { shutting_down_ = true; }
  // Handles the clients that are there, waiting at most `timeout` for one.
  void serve(std::chrono::milliseconds timeout);
  // As RendezvousServer's.
  [[nodiscard]] bool has_name() const { return server_->has_name(); }

 private:
  explicit Reception(const ReceptionParts& parts) : parts_(parts) {}
  ipc::RendezvousServer::Handlers handlers();

  ipc::Admission admit(const ipc::Peer& peer);
  // What a policy of a seat has been lent.
  struct Lease {
    std::optional<ipc::Segment> offered = {};  // to a policy that has not acknowledged yet
    std::optional<ipc::Segment> inputs = {};   // of this session or, before it, of the next; none: not recorded
    bool attached = false;                     // acknowledged, sealed and handed over
  };
  std::expected<void, std::string> prepare_inputs(Lease& lease);
  ipc::Admission admit_policy(const ipc::Peer& peer);
  ipc::Admission admit_input_reader(const ipc::Peer& peer);
  void hand_over(const ipc::Peer& peer);
  void take_leave(const ipc::Peer& peer);
  void watch_silence();
  void tell_policy_words();

  OperatorReply answer(pid_t asker, const OperatorMessage& message, std::string_view text);
  [[nodiscard]] std::vector<std::string> missing() const;
  void arm(pid_t asker, OperatorReply& reply);
  void stop(OperatorVerb verb, OperatorReply& reply);
  void reset(OperatorReply& reply);
  void mark(std::string_view text, OperatorReply& reply);
  void swap(std::uint64_t policy_hash, OperatorReply& reply);
  void back(OperatorReply& reply);
  // True when a tick that read `request` is over.
  bool wait_for(OperatorRequest request, std::uint64_t after_tick);
  // Whose host's commands are the policy's.
  [[nodiscard]] Seat seat_in_charge() const;
  StatusSnapshot status();
  [[nodiscard]] IncidentNote incident() const;

  ReceptionParts parts_;
  std::unique_ptr<ipc::RendezvousServer> server_;
  PerSeat<Lease> leases_;
  // What follows another one differs from it. The policy's counts the candidate's, too: the two may change places.
  PerSeat<std::uint8_t> sessions_{};
  PolicyWords words_;
  OperatorLog operators_;
  PendingArms pending_arms_;
  MonoTime policy_lived_at_;  // the policy in charge came, spoke, or had a usable command in a tick
  bool realtime_ = false;
  bool allow_non_realtime_ = false;
  bool shutting_down_ = false;
};

}  // namespace takt::runtime
