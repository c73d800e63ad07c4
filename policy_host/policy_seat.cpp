// SPDX-License-Identifier: Apache-2.0
#include "policy_host/policy_seat.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <span>
#include <utility>

#include "config/observation_shape.hpp"
#include "config/paths.hpp"
#include "executive/ipc/executive_segments.hpp"
#include "policy_host/executive_link.hpp"

namespace takt::policy_host {

PolicySeat::PolicySeat(const config::RobotConfig& robot, std::uint64_t policy_hash, SeatOptions options,
                       ipc::Segment observations)
    : options_(std::move(options)),
      expected_(hello_of(robot, policy_hash, Role::policy, "")),
      largest_input_(config::largest_policy_input(robot)),
      observations_(std::move(observations)),
      writer_(observations_.writable(), ipc::observation_mailbox()) {}

std::expected<std::unique_ptr<PolicySeat>, std::string> PolicySeat::open(const config::RobotConfig& robot,
                                                                         std::uint64_t policy_hash,
                                                                         SeatOptions options) {
  auto segment = ipc::Segment::create("takt-observation", ipc::ring_bytes(ipc::observation_mailbox()), true);
  if (!segment) return std::unexpected(segment.error());
  auto seat = std::unique_ptr<PolicySeat>(new PolicySeat(robot, policy_hash, std::move(options), std::move(*segment)));
  // Formatted before it is sealed, sealed before the first policy is greeted.
  if (auto sealed = seat->observations_.seal_against_new_writers(); !sealed) return std::unexpected(sealed.error());
  PolicySeat* const at = seat.get();
  auto server =
      ipc::RendezvousServer::listen(config::executive_socket(seat->options_.runtime_directory), geteuid(),
                                    {.admit = [at](const ipc::Peer& peer) { return at->admit(peer); },
                                     .acknowledged = [at](const ipc::Peer& peer) { at->hand_over(peer); },
                                     .recorded = {},
                                     .said = [at](const ipc::Peer&, const PolicyWord& word) { at->hear(word); },
                                     .left = [at](const ipc::Peer&) { at->leave(); },
                                     .request = {}},
                                    seat->options_.policy_user);
  if (!server) return std::unexpected(server.error());
  seat->server_ = std::make_unique<ipc::RendezvousServer>(std::move(*server));
  return seat;
}

std::string PolicySeat::refusal_of(const Hello& hello) const {
  if (hello.role != Role::policy)
    return fmt::format("this is {}, and has what a robot's policy wants: not what {}s want", options_.server,
                       name(hello.role));
  if (hello.config_hash != 0 && hello.config_hash != expected_.config_hash)
    return fmt::format("the policy was started with another robot file than {}: use the same", options_.server);
  if (hello.policy_hash != expected_.policy_hash)
    return "the policy is not the file that policy.file names: serve that one, or name yours in the robot file";
  if (hello.joint_count != expected_.joint_count || hello.joint_names_hash != expected_.joint_names_hash)
    return "the policy commands other joints than the robot file has: use a policy made for this robot";
  if (hello.step_count != expected_.step_count)
    return "the policy's chunks have another number of steps than policy.steps: make them equal";
  return {};
}

ipc::Admission PolicySeat::admit(const ipc::Peer& peer) {
  if (auto refusal = refusal_of(peer.hello); !refusal.empty()) return {std::move(refusal), {}};
  // Unmapped here until the policy has mapped it: see the sealing order in ipc/segment.hpp.
  auto segment = ipc::Segment::create("takt-command", ipc::ring_bytes(ipc::command_mailbox()), false);
  if (!segment) return {segment.error(), {}};
  offered_ = std::move(*segment);
  ipc::Admission admission{{}, {observations_.fd(), offered_->fd()}, options_.lockstep};
  if (largest_input_ != 0) {
    // A host that records its inputs expects a ring for them. It is not read: there is no recorder here.
    auto inputs =
        ipc::Segment::create("takt-policy-input", ipc::ring_bytes(ipc::policy_input_ring(largest_input_)), false);
    if (!inputs) return {inputs.error(), {}};
    inputs_ = std::move(*inputs);
    admission.descriptors.push_back(inputs_->fd());
  }
  return admission;
}

void PolicySeat::hand_over(const ipc::Peer& peer) {
  if (!offered_) return;
  ipc::Segment mapped = std::move(*offered_);
  offered_.reset();
  const auto turn_away = [&](const std::string& why) {
    if (options_.turned_away) options_.turned_away(peer, why);
  };
  if (auto sealed = mapped.seal_against_new_writers(); !sealed) return turn_away(sealed.error());
  if (auto seen = mapped.map_read_only(); !seen) return turn_away(seen.error());
  auto reader = ipc::SlotReader::attach(mapped.readable(), ipc::command_mailbox());
  if (!reader) return turn_away(reader.error());
  mailbox_.emplace(std::move(mapped), *reader);
  ++session_;
  forget_words();
  if (options_.taken) options_.taken(peer);
}

void PolicySeat::leave() {
  if (mailbox_ && options_.left) options_.left();
  offered_.reset();
  mailbox_.reset();
  forget_words();
}

void PolicySeat::hear(const PolicyWord& word) {
  if (word.kind == PolicyWordKind::problem) {
    problem_ = word.sentence;
  } else {
    source_before_ = std::exchange(source_, word.sentence);
    source_from_ = word.first_sequence;
  }
}

void PolicySeat::forget_words() {
  problem_.clear();
  source_.clear();
  source_before_.clear();
  source_from_ = 0;
}

void PolicySeat::serve(std::chrono::milliseconds within) {
  server_->serve(within);
}

void PolicySeat::evict() {
  server_->evict(Role::policy);
}

void PolicySeat::publish(const Observation& observation) noexcept {
  writer_.publish(std::as_bytes(std::span(&observation, 1)));
}

bool PolicySeat::read(CommandChunk& chunk) noexcept {
  if (!mailbox_) return false;
  const ipc::ReadResult result = mailbox_->reader.read_latest(std::as_writable_bytes(std::span(&chunk, 1)));
  if (result.status != ipc::ReadStatus::fresh || result.size < sizeof(CommandHeader)) return false;
  return chunk.header.step_count <= kMaxChunkSteps && chunk.header.joint_count <= kMaxJoints &&
         result.size == chunk.used_bytes();
}

}  // namespace takt::policy_host
