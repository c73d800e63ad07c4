// SPDX-License-Identifier: Apache-2.0
// Why no answer of a policy server is played, told by what is known on the robot: which part failed, in words for
// people. Pure. Thread rule: one thread.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "executive/contract/mono_time.hpp"
#include "policy_host/remote/answer_gate.hpp"
#include "policy_host/remote/machine_probe.hpp"
#include "policy_host/remote/peer.hpp"

namespace takt::policy_host::remote {

// What a server said of itself last.
struct ServerState {
  PeerId sender;
  std::string name;          // printable
  std::string address = {};  // of its machine, as it claims
  std::string problem;       // printable: why its policy publishes nothing, in the policy's words
  bool has_policy = false, lacks_samples = false, has_other_files = false;
  std::uint64_t epoch = 0;
  Duration shown_age;  // negative: never
  MonoTime heard_at;
};

class Silence {
 public:
  // How often a server says how it is: often enough to be known as lost when its answers are missed.
  static constexpr Duration status_period(Duration max_age) {
    return std::clamp(Duration{max_age.ns / 4}, milliseconds(10), milliseconds(250));
  }
  // A server whose newest word is older is not heard.
  static constexpr Duration heard_for(Duration max_age) { return status_period(max_age) * 4; }
  // From the newest answer played to when its absence is to be explained: what is lost with it is missed by then.
  static constexpr Duration patience(Duration max_age) {
    return std::max(max_age, heard_for(max_age)) + status_period(max_age) * 2;
  }

  void heard(const ServerState& state);
  void refused(AnswerVerdict verdict) { ++refused_[static_cast<std::size_t>(verdict)]; }
  // An answer was played: what was refused before explains nothing.
  void played() { refused_ = {}; }
  // `leader`: whose answers were played last; unknown: none were yet. `epoch`: of this robot's session. `listeners`:
  // servers that DDS knows in the domain.
  // `machine`: the leader's.
  [[nodiscard]] std::string reason(const PeerId& leader, std::uint64_t epoch, std::uint32_t listeners, Duration max_age,
                                   MonoTime now, Machine machine = Machine::unknown) const;
  // Which its machine has, as it claims; empty: it is not known.
  [[nodiscard]] std::string address_of(const PeerId& server) const;

 private:
  [[nodiscard]] std::string reason_of(const ServerState& server, std::uint64_t epoch, Duration max_age, MonoTime now,
                                      Machine machine) const;
  static bool is_heard(const ServerState& server, Duration max_age, MonoTime now) {
    return now - server.heard_at <= heard_for(max_age);
  }
  [[nodiscard]] std::string most_refused() const;
  std::vector<ServerState> servers_;  // at most kMostServers
  std::array<std::uint64_t, kAnswerVerdictCount> refused_{};
};

}  // namespace takt::policy_host::remote
