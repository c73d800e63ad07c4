// SPDX-License-Identifier: Apache-2.0
// What a robot's bridge knows of the observations that it showed, and its verdict on what comes back. The other machine
// is trusted with nothing: an answer counts only for an observation of this session, with this robot file, policy and
// shape, once, and not behind a newer one. A server is the process that DDS names: what another sends under its number
// neither counts as that server's nor makes it repeat itself. Age is not judged here: the executive does, by its own
// clock.
//
// Pure; no allocation after construction. Thread rule: one thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "executive/contract/command_chunk.hpp"
#include "executive/contract/mono_time.hpp"
#include "executive/contract/observation.hpp"
#include "policy_host/remote/peer.hpp"

namespace takt::policy_host::remote {

// An observation on its way out; stamps of the robot's clock.
struct Shown {
  std::uint64_t id = 0;
  MonoTime published_at;       // by the executive
  MonoTime dequeued_at;        // by the bridge
  MonoTime outside_sensed_at;  // oldest of the samples shown with it; unset: none
  MonoTime oldest_sensed_at;   // of the joints' samples inside
};

// An answer as it came.
struct Answer {
  PeerId sender;  // by DDS; the rest are claims
  std::uint64_t server = 0, epoch = 0, config_hash = 0, policy_hash = 0, observation_id = 0, sequence = 0;
  Duration queued, inferred;  // claims
  Duration older;             // claim: it rests on samples that much older than the oldest shown; 0: on none
  std::uint32_t dropped = 0;
  Duration step_period;
  std::uint32_t step_count = 0, joint_count = 0;
  std::uint8_t fields = 0;
  std::uint32_t value_count = 0;
};

enum class AnswerVerdict : std::uint8_t {
  usable,
  other_robot,  // another robot file or policy
  other_epoch,  // of an earlier session
  unknown,      // answers what was not shown, or too long ago
  wrong_shape,
  not_finite,
  of_another,  // under the number of another sender, whose answers are usable
  repeated,    // not newer than the sender's last
  overtaken,   // behind a newer one, or too late to be of use
};
inline constexpr std::size_t kAnswerVerdictCount = 9;

constexpr std::string_view name(AnswerVerdict verdict) {
  constexpr std::array<std::string_view, kAnswerVerdictCount> names{
      "usable",         "for another robot file or policy", "of an earlier session",         "to no known observation",
      "of wrong shape", "with values that are no numbers",  "under another server's number", "repeated",
      "too late"};
  return names[static_cast<std::size_t>(verdict)];
}

struct GateFacts {
  std::uint64_t config_hash = 0, policy_hash = 0;
  std::uint32_t step_count = 0, joint_count = 0;
  Duration step_period, max_age;
};

class AnswerGate {
 public:
  explicit AnswerGate(const GateFacts& facts) : facts_(facts) {}

  // A new session: nothing is shown yet, nothing from before is believed.
  void begin(std::uint64_t epoch);
  [[nodiscard]] std::uint64_t epoch() const { return epoch_; }
  void show(const Shown& shown) { shown_[shown.id % shown_.size()] = shown; }
  // `all_finite`: of its values. A usable answer is remembered as its sender's last.
  AnswerVerdict judge(const Answer& answer, bool all_finite, MonoTime now);
  // The usable answer is to be played: older ones are overtaken from now on. Its header, with all that is known here:
  // the network, both ways, is part of `publish`.
  CommandHeader play(const Answer& answer, MonoTime now);
  // Of the command that is played next in this session.
  [[nodiscard]] std::uint64_t next_sequence() const { return sequence_ + 1; }
  // Whose chunk the executive means by this sequence of a session's command; server 0: none that is known.
  struct Played {
    std::uint64_t server = 0, sequence = 0;
  };
  [[nodiscard]] Played played(std::uint64_t sequence) const;
  // What a server is told of the chunk in use. Nothing, where it is the candidate's: its numbers are of another
  // mailbox.
  struct Followed {
    Played chunk;
    std::uint32_t committed_from = 0, committed_count = 0;
  };
  [[nodiscard]] Followed followed(const Observation& observation) const;

 private:
  [[nodiscard]] bool has_shape(const Answer& answer) const;
  struct Heard {
    PeerId sender;
    std::uint64_t server = 0, sequence = 0;
    MonoTime usable_at;
  };
  [[nodiscard]] bool is_taken(const Answer& answer, MonoTime now) const;
  Heard& heard(const PeerId& sender);
  GateFacts facts_;
  std::uint64_t epoch_ = 0, newest_played_ = 0, sequence_ = 0;
  std::array<Shown, 1024> shown_{};
  std::array<Heard, 16> heard_{};  // senders; a further one takes the place of the one that was useful longest ago
  struct PlayedAs {
    std::uint64_t sequence = 0;
    Played chunk;
  };
  std::array<PlayedAs, 256> played_{};
};

}  // namespace takt::policy_host::remote
