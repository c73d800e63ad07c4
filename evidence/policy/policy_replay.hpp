// SPDX-License-Identifier: Apache-2.0
// Replay of a policy: the recorded inputs of a run go through the network again, and its raw outputs must come out.
//
// The run's own file on the built-in engine gives the same bits. Hidden state is carried from answer to answer and
// forgotten where the host forgot it; history is part of the recorded input, and images are put into it from the files
// of the run folder: an answer that rests on one whose file is not there is not judged. Behind answers that are missing
// (lost, damaged) the state of a recurrent network is unknown: what follows is not judged until the next reset. Another
// file gives a difference: how far its targets are from those of the run, joint by joint, as if it had been shown the
// same. Each answer is then turned into a command again, as the host does, and compared with the command that the
// executive read; a command that no recorded answer explains is told, unless as many answers are declared lost. Errors
// are one sentence, with the exit code. Thread rule: one thread.
#pragma once

#include <cstdint>
#include <expected>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "executive/contract/tick_record.hpp"
#include "monitor/record/recorded_run.hpp"

namespace takt::evidence {

struct PolicyReplayOptions {
  std::string with;         // another ONNX file for the policy; empty: the run's own, and its fallback policy's
  double tolerance = 1e-3;  // rad, rad/s or Nm: a difference in a target that is worth naming; not below 0
};

// Of all steps of all judged answers.
struct JointDistance {
  std::string joint, unit;
  double largest = 0;
  double rms = 0;
};

struct PolicyDifference {
  std::uint64_t observation_id = 0, sequence = 0;
  std::size_t step = 0;
  std::string joint;
  double recorded = 0, recomputed = 0;  // targets
};

struct PolicyReplay {
  Player sender = Player::policy;
  std::string file;
  std::uint64_t hash = 0;           // of the file
  bool is_of_the_run = false;       // the file that the run's host had
  std::string unit;                 // "rad", or "rad (slides: m)"
  std::uint64_t answers = 0;        // recorded
  std::uint64_t identical = 0;      // raw outputs, bit for bit
  std::uint64_t beyond = 0;         // with a target further off than the tolerance, or not a number on one side only
  std::uint64_t not_judged = 0;     // the network's state was unknown
  std::uint64_t missing = 0;        // inferences of which nothing is recorded, behind the first that is
  std::uint64_t before = 0;         // declared lost because the recorder was not there yet
  std::uint64_t lost = 0;           // declared lost since
  std::uint64_t unanswered = 0;     // commands that the executive read, of no recorded answer and none declared lost
  std::uint64_t without_image = 0;  // of those not judged: an image that the network was shown has no sound file
  std::string first_without_image;  // "observation 12: cam0: ..."
  std::uint64_t altered = 0;        // changed after recording: their checksum says so
  std::string first_altered;        // "observation 12: input[3]"
  std::uint64_t commands = 0;       // answers whose command the executive read and recorded whole
  std::uint64_t as_answered = 0;    // of these, what the answer says
  bool is_mixed = false;            // the host mixed earlier answers into its commands: none is compared
  std::vector<JointDistance> joints;
  std::optional<PolicyDifference> first_beyond;
};

struct PolicyReplayReport {
  std::vector<PolicyReplay> policies;  // the policy, and the fallback policy where it answered
  double tolerance = 0;
  std::uint64_t unrecorded_ticks = 0;  // as ReplayReport's
  std::uint64_t missing_ticks = 0;  // recorded, says the manifest, and not in the file: answers are missing with them
  std::uint64_t fallback_unanswered = 0;  // commands of a fallback policy of which no answer at all is recorded
  monitor::McapReport file;
  // Of the run's own file: every judged answer has the same bits. Of another: none is beyond the tolerance.
  [[nodiscard]] bool agrees() const;
  // Nothing was left unjudged.
  [[nodiscard]] bool is_whole() const;
};

struct PolicyReplayRefusal {
  enum class Why : std::uint8_t { no_evidence, policy };  // the run has none; the policy file is not the one, or no fit
  Why why = Why::policy;
  std::string sentence;
};

std::expected<PolicyReplayReport, PolicyReplayRefusal> replay_policy(const monitor::RecordedRun& run,
                                                                     const PolicyReplayOptions& options);

std::string policy_replay_text(const PolicyReplayReport& report);
nlohmann::ordered_json to_json(const PolicyReplayReport& report);

}  // namespace takt::evidence
