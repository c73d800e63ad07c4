#include "policy_host/executive_link.hpp"

#include <chrono>
#include <cstring>
#include <span>
#include <utility>

#include "config/load.hpp"
#include "executive/ipc/executive_segments.hpp"

namespace takt::policy_host {
namespace {

constexpr std::chrono::milliseconds kAttachTimeout{500};

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

ExecutiveLink::ExecutiveLink(ipc::Lease lease, ipc::Segment observations, ipc::Segment commands, ipc::SlotReader reader,
                             ipc::SlotWriter writer)
    : lease_(std::move(lease)),
      observations_(std::move(observations)),
      commands_(std::move(commands)),
      reader_(std::move(reader)),
      writer_(std::move(writer)) {}

std::expected<ExecutiveLink, std::string> ExecutiveLink::attach(const std::string& socket, const Hello& hello) {
  auto lease = ipc::attach(socket, hello, kAttachTimeout);
  if (!lease) return std::unexpected(lease.error());
  if (lease->descriptors.size() <= ipc::kCommandDescriptor) {
    return std::unexpected(socket + ": the executive handed out too few mailboxes; use one of the same version");
  }
  auto observations = ipc::Segment::adopt_read_only(lease->descriptors[ipc::kObservationDescriptor].release(),
                                                    ipc::ring_bytes(ipc::observation_mailbox()));
  if (!observations) return std::unexpected(observations.error());
  auto commands = ipc::Segment::adopt_writable(lease->descriptors[ipc::kCommandDescriptor].release(),
                                               ipc::ring_bytes(ipc::command_mailbox()));
  if (!commands) return std::unexpected(commands.error());
  auto reader = ipc::SlotReader::attach(observations->readable(), ipc::observation_mailbox());
  if (!reader) return std::unexpected(reader.error());
  ipc::SlotWriter writer(commands->writable(), ipc::command_mailbox());
  // Only after the mailbox is formatted: from here on the executive reads it.
  if (auto done = ipc::acknowledge(*lease); !done) return std::unexpected(done.error());
  return ExecutiveLink(std::move(*lease), std::move(*observations), std::move(*commands), std::move(*reader),
                       std::move(writer));
}

bool ExecutiveLink::read(Observation& observation) noexcept {
  return reader_.read_latest(std::as_writable_bytes(std::span(&observation, 1))).status == ipc::ReadStatus::fresh;
}

void ExecutiveLink::publish(const CommandChunk& chunk) noexcept {
  writer_.publish(std::as_bytes(std::span(&chunk, 1)).first(chunk.used_bytes()));
}

}  // namespace takt::policy_host
