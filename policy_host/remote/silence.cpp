// SPDX-License-Identifier: Apache-2.0
#include "policy_host/remote/silence.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace takt::policy_host::remote {
namespace {

constexpr std::size_t kMostServers = 16;

std::string not_heard(Machine machine) {
  switch (machine) {
    case Machine::answers:
      return "is not heard, and its machine answers: takt-policy-server ended there, or hangs";
    case Machine::silent:
      return "is not heard, nor is its machine: the network to it failed, or the machine itself";
    case Machine::unknown:
      break;
  }
  return "is not heard: its machine, its takt-policy-server or the network between failed";
}

}  // namespace

void Silence::heard(const ServerState& state) {
  auto found = std::ranges::find(servers_, state.sender, &ServerState::sender);
  if (found == servers_.end() && servers_.size() < kMostServers) found = servers_.insert(found, state);
  if (found == servers_.end()) found = std::ranges::min_element(servers_, {}, &ServerState::heard_at);
  *found = state;
}

std::string Silence::most_refused() const {
  const auto usable = static_cast<std::size_t>(AnswerVerdict::usable);
  std::size_t most = usable;
  for (std::size_t i = 0; i < refused_.size(); ++i)
    if (i != usable && refused_[i] != 0 && (most == usable || refused_[i] > refused_[most])) most = i;
  return most == usable ? "" : std::string(name(static_cast<AnswerVerdict>(most)));
}

std::string Silence::address_of(const PeerId& server) const {
  const auto found = std::ranges::find(servers_, server, &ServerState::sender);
  return found == servers_.end() ? std::string() : found->address;
}

std::string Silence::reason_of(const ServerState& server, std::uint64_t epoch, Duration max_age, MonoTime now,
                               Machine machine) const {
  if (!is_heard(server, max_age, now)) return not_heard(machine);
  if (server.has_other_files) return "has another robot file or policy.file: use the same on both machines";
  if (!server.has_policy) return "has no policy: its host left, or has not come";
  const bool shows_none = server.shown_age < Duration{} || server.shown_age > max_age;
  // One that came without its samples, among others, is no reason.
  if (server.lacks_samples && shows_none) return "does not get the sensors' samples: the network to it is too slow";
  if (server.epoch != 0 && server.epoch != epoch) return "answers another robot of this name";
  if (server.epoch == 0 || shows_none) return "does not hear this robot: the network to it failed";
  if (!server.problem.empty()) return "hears this robot, and its policy says: " + server.problem;
  if (const std::string refused = most_refused(); !refused.empty())
    return "gives answers that are not played: " + refused;
  return "hears this robot, and its policy does not answer";
}

std::string Silence::reason(const PeerId& leader, std::uint64_t epoch, std::uint32_t listeners, Duration max_age,
                            MonoTime now, Machine machine) const {
  auto server = std::ranges::find(servers_, leader, &ServerState::sender);
  // Another one that is heard has more to say than a leader that is not.
  if (server == servers_.end() || !is_heard(*server, max_age, now)) {
    const auto newest = std::ranges::max_element(servers_, {}, &ServerState::heard_at);
    if (newest != servers_.end() && is_heard(*newest, max_age, now)) server = newest;
  }
  if (server != servers_.end())
    return fmt::format("policy server {} {}", server->name,
                       reason_of(*server, epoch, max_age, now, server->sender == leader ? machine : Machine::unknown));
  return listeners == 0 ? "no policy server is in the DDS domain: is takt-policy-server running, and the network up?"
                        : "a policy server is in the DDS domain, and is not heard: the network from it failed";
}

}  // namespace takt::policy_host::remote
