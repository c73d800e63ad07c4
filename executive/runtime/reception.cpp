// SPDX-License-Identifier: Apache-2.0
#include "executive/runtime/reception.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <thread>
#include <utility>

#include "config/observation_shape.hpp"
#include "executive/incident/log_hint.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "executive/runtime/arming.hpp"
#include "executive/runtime/clock.hpp"

namespace takt::runtime {
std::expected<std::unique_ptr<Reception>, std::string> Reception::open(const std::string& socket_path,
                                                                       const ReceptionParts& parts) {
  std::unique_ptr<Reception> reception(new Reception(parts));
  for (Lease& lease : reception->leases_.values)
    if (auto prepared = reception->prepare_inputs(lease); !prepared) return std::unexpected(prepared.error());
  auto server = ipc::RendezvousServer::listen(socket_path, geteuid(), reception->handlers(), parts.policy_user);
  if (!server) return std::unexpected(server.error());
  reception->server_ = std::make_unique<ipc::RendezvousServer>(std::move(*server));
  return reception;
}

ipc::RendezvousServer::Handlers Reception::handlers() {
  return {.admit = [this](const ipc::Peer& peer) { return admit(peer); },
          .acknowledged = [this](const ipc::Peer& peer) { hand_over(peer); },
          .recorded = [this](const ipc::Peer&, std::uint64_t tick) { parts_.recorded.set(tick); },
          .said =
              [this](const ipc::Peer&, const PolicyWord& word) {
                policy_lived_at_ = SystemClock().now();
                words_.take(word, policy_lived_at_);
              },
          .left = [this](const ipc::Peer& peer) { take_leave(peer); },
          .request =
              [this](const ipc::Peer& peer, const OperatorMessage& message, std::string_view text) {
                const MonoTime heard_at = SystemClock().now();
                const OperatorReply reply = answer(peer.pid, message, text);
                operators_.note(peer, message.verb, reply, heard_at);
                return reply;
              }};
}

void Reception::set_realtime(bool realtime, bool allow_non_realtime) {
  realtime_ = realtime;
  allow_non_realtime_ = allow_non_realtime;
}

void Reception::serve(std::chrono::milliseconds timeout) {
  server_->serve(timeout);
  for (MailboxHandover& mailboxes : parts_.mailboxes.values) mailboxes.settle();
  watch_silence();
  tell_policy_words();
  operators_.pass_all([this](const OperatorWord& word) { return server_->pass_on(word); });
}

// A host that hangs cannot say so, and one without observations is not to blame. Before the robot is stopped for want
// of commands the reason is there.
void Reception::watch_silence() {
  const MonoTime now = SystemClock().now();
  const Seat seat = seat_in_charge();
  const Role role = kPolicyRoles[seat];
  const ipc::Peer* const host = server_->holder(role);
  const bool is_usable = takt::is_usable(parts_.follower.latest().header.seats[Seat::policy].freshness);
  if (is_usable || host == nullptr || !leases_[seat].attached) policy_lived_at_ = now;
  if (is_usable) return words_.answers(role, now);
  if (now - policy_lived_at_ <= Duration{parts_.config.freshness.stop_after.ns / 4 * 3}) return;
  const std::string lack = lack_of_observations(parts_.follower.latest(), parts_.config, parts_.robot);
  words_.presume(role,
                 !lack.empty() ? lack
                               : fmt::format("{} (pid {}) is attached and says nothing: it hangs, or is too slow",
                                             host->hello.program, host->pid),
                 now);
}

void Reception::tell_policy_words() {
  for (const PolicyWord& word : words_.take_due(SystemClock().now())) {
    const std::string_view sentence(word.sentence);
    if (word.kind == PolicyWordKind::source)
      spdlog::info("{}: commands from {} on are of {}", name(word.role), word.first_sequence, sentence);
    else if (sentence.empty())
      spdlog::info("{}: what kept it from answering is over", name(word.role));
    else
      spdlog::warn("{}: {}", name(word.role), sentence);
    server_->pass_on(word);
  }
}

ipc::Admission Reception::admit(const ipc::Peer& peer) {
  ipc::Admission admission;
  const Role role = peer.hello.role;
  if (role == Role::operator_console) return admission;
  if (is_policy(role)) {
    admission = admit_policy(peer);
  } else if (is_input_reader(role)) {
    admission = admit_input_reader(peer);
  } else if (role == Role::sensor_reader) {
    admission.refusal = "the executive serves no sensor: connect to sensor-<name>.sock in the same directory";
  } else {
    admission.refusal = refusal_of_monitor(peer.hello, parts_.rules[Seat::policy]);
    if (admission.refusal.empty()) admission.descriptors = parts_.published.monitor_descriptors();
    if (admission.refusal.empty() && role == Role::monitor) words_.tell_all_again();
  }
  if (admission.refusal.empty()) {
    spdlog::info("{} admitted: pid {} ({})", name(peer.hello.role), peer.pid, peer.hello.program);
  } else {
    spdlog::warn("{} refused: pid {} ({}): {}", name(peer.hello.role), peer.pid, peer.hello.program, admission.refusal);
  }
  return admission;
}

ipc::Admission Reception::admit_policy(const ipc::Peer& peer) {
  const Seat seat = *seat_of(peer.hello.role);
  if (seat == Seat::fallback && !pipeline::has_fallback_policy(parts_.config))
    return {"the robot has no fallback policy: name one of kind `policy` in degraded.fallback, or do not start it", {}};
  const bool is_another = seat == Seat::candidate && seat_in_charge() == Seat::candidate;
  const std::uint64_t in_charge = is_another ? parts_.board.read().tick.candidate.policy_hash : 0;
  auto refusal = seat == Seat::candidate ? refusal_of_candidate(peer.hello, parts_.rules[seat], in_charge)
                                         : refusal_of_policy(peer.hello, parts_.rules[seat]);
  if (!refusal.empty()) return {std::move(refusal), {}};
  // Unmapped here until the policy has mapped it: see the sealing order in ipc/segment.hpp.
  auto segment = ipc::Segment::create("takt-command", ipc::ring_bytes(ipc::command_mailbox()), false);
  if (!segment) return {segment.error(), {}};
  Lease& lease = leases_[seat];
  lease.offered = std::move(*segment);
  ipc::Admission admission{{}, {parts_.published.observation_descriptor(), lease.offered->fd()}};
  if (lease.inputs) admission.descriptors.push_back(lease.inputs->fd());
  return admission;
}

std::expected<void, std::string> Reception::prepare_inputs(Lease& lease) {
  const std::size_t largest = config::largest_policy_input(parts_.robot);
  lease.inputs.reset();
  if (largest == 0) return {};
  auto segment = ipc::Segment::create("takt-policy-input", ipc::ring_bytes(ipc::policy_input_ring(largest)), false);
  if (!segment) return std::unexpected(segment.error());
  lease.inputs = std::move(*segment);
  return {};
}

ipc::Admission Reception::admit_input_reader(const ipc::Peer& peer) {
  if (auto refusal = refusal_of_monitor(peer.hello, parts_.rules[Seat::policy]); !refusal.empty())
    return {std::move(refusal), {}};
  const Lease& lease = leases_[*seat_of(peer.hello.role)];
  if (!lease.inputs) return {"this robot's policy inputs are not recorded (docs/policies.md says which are)", {}};
  return {{}, {lease.inputs->fd()}};
}

void Reception::hand_over(const ipc::Peer& peer) {
  const Seat seat = *seat_of(peer.hello.role);
  Lease& lease = leases_[seat];
  if (!lease.offered) return;
  ipc::Segment mapped = std::move(*lease.offered);
  lease.offered.reset();
  if (lease.inputs) {
    if (auto sealed = lease.inputs->seal_against_new_writers(); !sealed)
      spdlog::error("{} pid {}: {}", name(peer.hello.role), peer.pid, sealed.error());
  }
  std::uint8_t& session = sessions_[seat == Seat::candidate ? Seat::policy : seat];
  session = static_cast<std::uint8_t>(session == UINT8_MAX ? 1 : session + 1);
  auto mailbox = CommandMailbox::seal(std::move(mapped), session, peer.hello.policy_hash);
  if (!mailbox) {
    spdlog::error("{} pid {}: {}", name(peer.hello.role), peer.pid, mailbox.error());
    return;  // never read; the policy's commands go nowhere until it attaches again
  }
  parts_.mailboxes[seat].want(std::move(*mailbox));
  lease.attached = true;
  words_.begin(peer.hello.role, SystemClock().now());
  spdlog::info("{} pid {}: mailbox sealed, session {}", name(peer.hello.role), peer.pid, session);
}

void Reception::take_leave(const ipc::Peer& peer) {
  if (peer.hello.role == Role::operator_console) return;
  spdlog::info("{} left: pid {}", name(peer.hello.role), peer.pid);
  if (peer.hello.role == Role::monitor) parts_.recorded.set(0);
  if (!is_policy(peer.hello.role)) return;
  const Seat seat = *seat_of(peer.hello.role);
  Lease& lease = leases_[seat];
  lease.offered.reset();
  if (std::exchange(lease.attached, false)) {
    parts_.mailboxes[seat].want(nullptr);
    words_.end(peer.hello.role, fmt::format("its host left ({}, pid {})", peer.hello.program, peer.pid),
               SystemClock().now());
  }
  if (auto prepared = prepare_inputs(lease); !prepared) spdlog::error("{}", prepared.error());
  server_->evict(kInputReaderRoles[seat]);
}

Seat Reception::seat_in_charge() const {
  return parts_.board.read().tick.candidate.in_charge != 0 ? Seat::candidate : Seat::policy;
}

StatusSnapshot Reception::status() {
  StatusSnapshot status = parts_.board.read();
  const auto pid_of = [this](Role role) {
    const ipc::Peer* const holder = server_->holder(role);
    return holder != nullptr ? static_cast<std::uint64_t>(holder->pid) : 0;
  };
  for (const Seat seat : kSeats) status.policy_pids[seat] = pid_of(kPolicyRoles[seat]);
  status.monitor_pid = pid_of(Role::monitor);
  status.realtime = realtime_ ? 1 : 0;
  status.recorder_required = parts_.config.unrecorded_limit != 0 ? 1 : 0;
  const TickRecord& record = parts_.follower.latest();
  for (std::size_t joint = 0; joint < record.header.joint_count; ++joint) {
    if (parts_.config.joints[joint].passive) continue;
    ++status.drive_count;
    status.enabled_drives += record.joints[joint].drive_enabled;
  }
  return status;
}

IncidentNote Reception::incident() const {
  IncidentNote note;
  const incident::IncidentWatch* const incidents = parts_.follower.incidents();
  if (incidents == nullptr || !incidents->latest()) return note;
  const std::optional<incident::Incident>& incident = incidents->latest();
  note.tick = incident->tick;
  note.at = incident->at;
  note.first_tick = incident->chain.front().tick;
  note.error_code = incident->error_code;
  note.mode = incident->to;
  note.cause = incident->cause;
  note.asked = incident->asked ? 1 : 0;
  note.stands = incidents->stands() ? 1 : 0;
  note.stop_asked = note.asked;
  for (const OperatorRequest stop : {OperatorRequest::stop, OperatorRequest::press_stop, OperatorRequest::deenergise})
    if (parts_.follower.last_read(stop) >= incident->tick) note.stop_asked = 1;
  incident->where.copy(note.where, sizeof note.where - 1);
  incident::with_known_reason(incident->sentence, words_.problem_since(Role::policy, incident->at))
      .copy(note.sentence, sizeof note.sentence - 1);
  return note;
}

}  // namespace takt::runtime
