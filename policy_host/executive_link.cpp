// SPDX-License-Identifier: Apache-2.0
#include "policy_host/executive_link.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstring>
#include <span>
#include <utility>

#include "config/load.hpp"
#include "executive/contract/contract_layout.hpp"
#include "executive/ipc/executive_segments.hpp"

namespace takt::policy_host {
namespace {

constexpr std::chrono::milliseconds kExecutiveAttachTimeout{500};

}  // namespace

Hello hello_of(const config::RobotConfig& robot, std::uint64_t policy_hash, Role role, const char* program) {
  Hello hello;
  hello.role = role;
  hello.layout = contract_layout();
  hello.config_hash = robot.hash;
  std::strncpy(hello.program, program, sizeof hello.program - 1);
  if (is_policy(role)) {
    hello.policy_hash = policy_hash;
    hello.joint_names_hash = config::joint_names_hash(robot);
    hello.joint_count = static_cast<std::uint32_t>(robot.joints.size());
    hello.step_count = robot.policy->steps;
  }
  return hello;
}

ExecutiveLink::ExecutiveLink(ipc::Lease lease, ipc::Segment observations, ipc::SlotReader reader, Writable commands,
                             std::optional<Writable> inputs)
    : lease_(std::move(lease)),
      observations_(std::move(observations)),
      reader_(std::move(reader)),
      commands_(std::move(commands)),
      inputs_(std::move(inputs)) {}

std::expected<ExecutiveLink::Writable, std::string> ExecutiveLink::adopt(ipc::Lease& lease, std::size_t descriptor,
                                                                         const ipc::RingShape& shape) {
  auto segment = ipc::Segment::adopt_writable(lease.descriptors[descriptor].release(), ipc::ring_bytes(shape));
  if (!segment) return std::unexpected(segment.error());
  ipc::SlotWriter writer(segment->writable(), shape);
  return Writable{std::move(*segment), writer};
}

std::expected<ExecutiveLink, std::string> ExecutiveLink::attach(const std::string& socket, const Hello& hello,
                                                                std::size_t largest_input, Time knows) {
  auto lease = ipc::attach(socket, hello, kExecutiveAttachTimeout);
  if (!lease) return std::unexpected(lease.error());
  if (lease->lockstep && knows == Time::clock)
    return std::unexpected(
        fmt::format("{}: this is virtual time, which {} knows nothing of: --policy-host is for "
                    "policies in Python or C (docs/python-policy.md)",
                    socket, hello.program));
  if (lease->descriptors.size() <= (largest_input == 0 ? ipc::kCommandDescriptor : ipc::kInputDescriptor)) {
    return std::unexpected(socket + ": the executive handed out too few mailboxes; use one of the same version");
  }
  auto observations = ipc::Segment::adopt_read_only(lease->descriptors[ipc::kObservationDescriptor].release(),
                                                    ipc::ring_bytes(ipc::observation_mailbox()));
  if (!observations) return std::unexpected(observations.error());
  auto reader = ipc::SlotReader::attach(observations->readable(), ipc::observation_mailbox());
  if (!reader) return std::unexpected(reader.error());
  auto commands = adopt(*lease, ipc::kCommandDescriptor, ipc::command_mailbox());
  if (!commands) return std::unexpected(commands.error());
  std::optional<Writable> inputs;
  if (largest_input != 0) {
    auto adopted = adopt(*lease, ipc::kInputDescriptor, ipc::policy_input_ring(largest_input));
    if (!adopted) return std::unexpected(adopted.error());
    inputs = std::move(*adopted);
  }
  // Only after the mailbox is formatted: from here on the executive reads it.
  if (auto done = ipc::acknowledge(*lease); !done) return std::unexpected(done.error());
  return ExecutiveLink(std::move(*lease), std::move(*observations), *reader, std::move(*commands), std::move(inputs));
}

bool ExecutiveLink::read(Observation& observation) noexcept {
  return reader_.read_latest(std::as_writable_bytes(std::span(&observation, 1))).status == ipc::ReadStatus::fresh;
}

void ExecutiveLink::publish(const CommandChunk& chunk) noexcept {
  commands_.writer.publish(std::as_bytes(std::span(&chunk, 1)).first(chunk.used_bytes()));
}

void ExecutiveLink::state_problem(MonoTime now, std::string_view sentence) {
  const bool is_new = problem_.empty() || sentence.empty() || now - problem_told_ >= seconds(1);
  if (sentence == problem_ || !is_new) return;
  problem_ = sentence;
  problem_told_ = now;
  ipc::tell(lease_, PolicyWordKind::problem, sentence);
}

void ExecutiveLink::state_source(std::string_view sentence, std::uint64_t first_sequence) const {
  ipc::tell(lease_, PolicyWordKind::source, sentence, first_sequence);
}

void ExecutiveLink::publish_input(std::span<const std::byte> input) noexcept {
  inputs_->writer.publish(input);
}

}  // namespace takt::policy_host
